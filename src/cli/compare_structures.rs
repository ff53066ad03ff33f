//! What `query` and `locate` share: asking one structure after another (a
//! large scene does not fit in memory several times), noticing when they
//! disagree, and writing the answers down.

use std::collections::BTreeMap;
use std::io::{self, BufWriter, Write};

use serde_json::{Map, Value};

use super::shared_args::RowFormat;
use crate::geometry::Aabb;
use crate::index::{BuildError, DynIndex, StructureSpec};
use crate::measure::{Answer, Verdict, guarded, input_of};
use crate::query::{ItemId, QueryCost};
use crate::scene::Scene;
use crate::shown::shown_field;
use crate::threads::share;

/// One structure's answer to one question.
pub struct Row {
    pub question: usize,
    pub structure: String,
    pub ids: Option<Vec<ItemId>>,
    pub answer: Answer,
    pub id_sum: u64,
    pub cost: QueryCost,
}

/// Asks every structure every question; answers in the order of questions,
/// then of structures. Ids (ascending) are kept only if wanted.
pub fn ask_all(
    structures: &[StructureSpec],
    scene: &Scene,
    boxes: &[Aabb],
    questions: usize,
    keep_ids: bool,
    ask: impl Fn(&dyn DynIndex, usize, &mut Vec<ItemId>, &mut QueryCost) + Sync,
) -> anyhow::Result<Vec<Row>> {
    let mut answers: Vec<Vec<Row>> = (0..questions).map(|_| Vec::new()).collect();
    for spec in structures {
        let failed = |why: String| anyhow::anyhow!("structure '{}': {why}", spec.label);
        let panicked = |verdict: Verdict| failed(verdict.reason.unwrap_or_default());
        let index = match spec.build(input_of(scene, boxes)) {
            Ok(index) => index,
            // One of many: the others' answers are worth having.
            Err(error @ BuildError::Refused { .. }) if structures.len() > 1 => {
                super::tell(&format!("left out: {error}"));
                continue;
            }
            Err(error) => return Err(failed(error.to_string())),
        };
        let asked = guarded(|| {
            share(
                spec.execution.threads,
                answers.iter_mut().enumerate(),
                |(question, row)| {
                    let (mut out, mut cost) = (Vec::new(), QueryCost::default());
                    ask(index.as_ref(), question, &mut out, &mut cost);
                    if keep_ids {
                        out.sort_unstable();
                    }
                    row.push(Row {
                        question,
                        structure: spec.label.clone(),
                        answer: Answer::of(&out),
                        id_sum: crate::measure::id_sum(&out),
                        ids: keep_ids.then_some(out),
                        cost,
                    });
                },
            );
        });
        asked.map_err(panicked)?;
    }
    Ok(answers.into_iter().flatten().collect())
}

/// Says which questions were answered differently; true if none was.
pub fn all_agree(rows: &[Row], what: &str) -> bool {
    let mut first: BTreeMap<usize, &Row> = BTreeMap::new();
    let mut agree = true;
    for row in rows {
        let base = first.entry(row.question).or_insert(row);
        if base.answer != row.answer {
            agree = false;
            let told = |row: &Row| {
                let ids = super::text::counted(row.answer.count as usize, "id");
                format!("{} finds {ids} with sum {}", row.structure, row.id_sum)
            };
            super::tell(&format!(
                "error: {what} {}: {}, {}{}",
                row.question,
                told(base),
                told(row),
                match (base.answer.count, base.id_sum) == (row.answer.count, row.id_sum) {
                    true => ", but other ids",
                    false => "",
                }
            ));
        }
    }
    agree
}

/// The answers as CSV or JSON, with a value for each column.
pub fn write(
    format: RowFormat,
    columns: &[&str],
    answers: &[Row],
    row: impl Fn(&Row) -> Vec<Value>,
) -> io::Result<()> {
    let mut out = BufWriter::new(io::stdout().lock());
    let rows = answers.iter().map(row);
    match format {
        RowFormat::Csv => {
            let mut csv = csv::Writer::from_writer(&mut out);
            csv.write_record(columns)?;
            for row in rows {
                csv.write_record(row.iter().map(cell))?;
            }
            csv.flush()?;
        }
        RowFormat::Json => {
            let names = || columns.iter().map(|&name| name.to_owned());
            let rows: Vec<Map<String, Value>> =
                rows.map(|row| names().zip(row).collect()).collect();
            serde_json::to_writer_pretty(&mut out, &rows)?;
            writeln!(out)?;
        }
    }
    out.flush()
}

/// A value as CSV holds it: ids separated by spaces.
fn cell(value: &Value) -> String {
    match value {
        Value::String(text) => shown_field(text),
        Value::Array(ids) => ids.iter().map(cell).collect::<Vec<_>>().join(" "),
        other => other.to_string(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::index::{self, LinearScalar, RegionIndex};

    const PANICS: index::Row = index::Row {
        info: LinearScalar::INFO.named("panics"),
        build: |_, _, _| panic!("deep in a peer's code"),
        params: |_| Ok(Value::Null),
    };
    const REFUSES: index::Row = index::Row {
        info: LinearScalar::INFO.named("refuses"),
        build: |_, _, _| {
            Err(BuildError::Refused {
                structure: "refuses",
                reason: "too many alike".to_owned(),
            })
        },
        params: |_| Ok(Value::Null),
    };

    fn of(row: index::Row) -> StructureSpec {
        StructureSpec {
            label: row.info.name.to_owned(),
            row,
            params: Value::Null,
            execution: Default::default(),
        }
    }

    fn asked(structures: &[StructureSpec], panics: bool) -> Result<Vec<Row>, String> {
        let scene = crate::scene::load("uniform:n=10", &Default::default()).expect("uniform");
        let ask = |_: &dyn DynIndex, _, out: &mut Vec<ItemId>, _: &mut QueryCost| {
            assert!(!panics, "deep in a peer's query");
            out.push(7);
        };
        ask_all(structures, &scene, &scene.items, 2, true, ask).map_err(|error| error.to_string())
    }

    #[test]
    fn other_ids_of_the_same_sum_are_noticed() {
        let row = |ids: &[ItemId]| Row {
            question: 0,
            structure: "any".to_owned(),
            ids: None,
            answer: Answer::of(ids),
            id_sum: crate::measure::id_sum(ids),
            cost: QueryCost::default(),
        };
        assert!(all_agree(&[row(&[1, 4]), row(&[4, 1])], "camera"));
        assert!(!all_agree(&[row(&[1, 4]), row(&[2, 3])], "camera"));
    }

    #[test]
    fn a_panic_is_one_line_and_a_refusal_leaves_the_others() {
        let linear = StructureSpec::parse("linear").expect("linear");
        let error = asked(&[linear.clone(), of(PANICS)], false).err();
        let wanted = "structure 'panics': panicked: deep in a peer's code";
        assert_eq!(error.as_deref(), Some(wanted));
        let error = asked(std::slice::from_ref(&linear), true).err();
        let wanted = "structure 'linear': panicked: deep in a peer's query";
        assert_eq!(error.as_deref(), Some(wanted));
        let answers = asked(&[of(REFUSES), linear], false).expect("linear answers");
        assert!(answers.len() == 2 && answers.iter().all(|a| a.structure == "linear"));
        let error = asked(&[of(REFUSES)], false).err().unwrap_or_default();
        assert!(error.contains("too many alike"), "{error}");
    }
}
