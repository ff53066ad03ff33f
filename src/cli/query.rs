//! `cullbench query`: one row per camera and structure.

use std::io::{self, BufWriter, Write};

use serde_json::{Map, Value, json};

use super::args::{QueryArgs, RowFormat};
use super::compare_structures::{Row, all_agree, ask_all, joined};
use super::{Ending, load_scene, unread_is_fine};
use crate::index::Registry;
use crate::measure::Workload;
use crate::path;

pub fn query(registry: &Registry, args: &QueryArgs) -> anyhow::Result<Ending> {
    let structures = args.kernel.structures(registry, &args.structure)?;
    let (defaults, culling) = (args.lens.defaults()?, args.culling.culling(&args.test)?);
    let scene = load_scene(&args.scene, &args.scene_args, 1)?;
    let cameras = path::load(&args.cameras, &scene, &defaults)?;
    let workload = Workload::new(&scene, &cameras, &culling)?;
    let ask = |index: &dyn crate::index::DynIndex, camera: usize, out: &mut _, cost: &mut _| {
        let view = workload.views[camera].as_any();
        index.see_counted(view, out, cost);
        out.clear();
        index.see(view, out);
    };
    let answers = ask_all(
        &structures,
        &scene,
        &workload.items,
        workload.views.len(),
        args.ids,
        ask,
    )?;
    unread_is_fine(write(
        args,
        culling.test.name(),
        scene.items.len(),
        &answers,
    ))?;
    Ok(if all_agree(&answers, "camera") {
        Ending::Ok
    } else {
        Ending::WrongAnswer
    })
}

fn write(args: &QueryArgs, test: &str, total: usize, answers: &[Row]) -> io::Result<()> {
    let mut out = BufWriter::new(io::stdout().lock());
    match args.format {
        RowFormat::Csv => {
            let mut csv = csv::Writer::from_writer(&mut out);
            let mut header = vec![
                "camera",
                "structure",
                "test",
                "total_count",
                "visible_count",
                "visible_id_sum",
                "nodes_tested",
                "items_tested",
            ];
            header.extend(args.ids.then_some("visible_ids"));
            csv.write_record(header)?;
            for a in answers {
                let mut row = vec![
                    a.question.to_string(),
                    a.structure.clone(),
                    test.to_owned(),
                    total.to_string(),
                    a.answer.count.to_string(),
                    a.id_sum.to_string(),
                    a.cost.nodes_tested.to_string(),
                    a.cost.items_tested.to_string(),
                ];
                row.extend(a.ids.as_deref().map(joined));
                csv.write_record(&row)?;
            }
            csv.flush()?;
        }
        RowFormat::Json => {
            let rows: Vec<Value> = answers
                .iter()
                .map(|a| {
                    let row = json!({
                        "camera": a.question,
                        "structure": a.structure,
                        "test": test,
                        "total_count": total,
                        "visible_count": a.answer.count,
                        "visible_id_sum": a.id_sum,
                        "nodes_tested": a.cost.nodes_tested,
                        "items_tested": a.cost.items_tested,
                    });
                    with_ids(row, "visible_ids", a)
                })
                .collect();
            serde_json::to_writer_pretty(&mut out, &rows)?;
            writeln!(out)?;
        }
    }
    out.flush()
}

/// The row with the answer's ids as an array, if they were kept.
pub fn with_ids(row: Value, name: &str, answer: &Row) -> Value {
    let mut row: Map<String, Value> = row.as_object().cloned().unwrap_or_default();
    if let Some(ids) = &answer.ids {
        row.insert(name.to_owned(), json!(ids));
    }
    Value::Object(row)
}
