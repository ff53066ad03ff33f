//! What `query` and `locate` share: asking one structure after another (a
//! large scene does not fit in memory several times), and noticing when they
//! disagree.

use std::collections::BTreeMap;

use crate::geometry::Aabb;
use crate::index::{BuildError, DynIndex, StructureSpec};
use crate::measure::{Verdict, guarded};
use crate::query::{ItemId, QueryCost};
use crate::scene::Scene;
use crate::threads::share;

/// One structure's answer to one question.
pub struct Answer {
    pub question: usize,
    pub structure: String,
    pub ids: Option<Vec<ItemId>>,
    pub count: usize,
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
) -> anyhow::Result<Vec<Answer>> {
    let mut answers: Vec<Vec<Answer>> = (0..questions).map(|_| Vec::new()).collect();
    for spec in structures {
        let failed = |why: String| anyhow::anyhow!("structure '{}': {why}", spec.label);
        let panicked = |verdict: Verdict| failed(verdict.reason.unwrap_or_default());
        let index = match spec.build_with(boxes, scene.own_tree.as_ref()) {
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
                    row.push(Answer {
                        question,
                        structure: spec.label.clone(),
                        count: out.len(),
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
pub fn all_agree(answers: &[Answer], what: &str) -> bool {
    let mut first: BTreeMap<usize, &Answer> = BTreeMap::new();
    let mut agree = true;
    for answer in answers {
        let base = first.entry(answer.question).or_insert(answer);
        if (base.count, base.id_sum) != (answer.count, answer.id_sum) {
            agree = false;
            super::tell(&format!(
                "error: {what} {}: {} finds {} with sum {}, {} finds {} with sum {}",
                answer.question,
                base.structure,
                super::text::counted(base.count, "id"),
                base.id_sum,
                answer.structure,
                super::text::counted(answer.count, "id"),
                answer.id_sum
            ));
        }
    }
    agree
}

/// Ids as the CSV columns hold them: ascending, separated by spaces.
pub fn joined(ids: &[ItemId]) -> String {
    let texts: Vec<String> = ids.iter().map(ItemId::to_string).collect();
    texts.join(" ")
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::index::{LinearScalar, RegionIndex, Row};
    use serde_json::Value;

    const PANICS: Row = Row {
        info: LinearScalar::INFO.named("panics"),
        build: |_, _, _, _| panic!("deep in a peer's code"),
        params: |_| Ok(Value::Null),
    };
    const REFUSES: Row = Row {
        info: LinearScalar::INFO.named("refuses"),
        build: |_, _, _, _| {
            Err(BuildError::Refused {
                structure: "refuses",
                reason: "too many alike".to_owned(),
            })
        },
        params: |_| Ok(Value::Null),
    };

    fn of(row: Row) -> StructureSpec {
        StructureSpec {
            label: row.info.name.to_owned(),
            row,
            params: Value::Null,
            execution: Default::default(),
        }
    }

    fn asked(structures: &[StructureSpec], panics: bool) -> Result<Vec<Answer>, String> {
        let scene = crate::scene::load("uniform:n=10", &Default::default()).expect("uniform");
        let ask = |_: &dyn DynIndex, _, out: &mut Vec<ItemId>, _: &mut QueryCost| {
            assert!(!panics, "deep in a peer's query");
            out.push(7);
        };
        ask_all(structures, &scene, &scene.items, 2, true, ask).map_err(|error| error.to_string())
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
