//! `cullbench locate`: one row per point and structure.

use std::fs::File;
use std::io::{self, BufWriter, Write};

use anyhow::Context;
use serde_json::{Value, json};

use super::args::{LocateArgs, RowFormat};
use super::compare_structures::{Row, all_agree, ask_all, joined};
use super::query::with_ids;
use super::{Ending, load_scene, unread_is_fine};
use crate::index::Registry;
use crate::path::read_points_csv;
use crate::scene::Sought;

pub fn locate(registry: &Registry, args: &LocateArgs) -> anyhow::Result<Ending> {
    let structures = args.kernel.structures(registry, &args.structure)?;
    let scene = load_scene(&args.scene, &args.scene_args, 1)?;
    let name = args.points.display().to_string();
    let file = File::open(&args.points).with_context(|| name.clone())?;
    let points: Vec<Sought> = read_points_csv(file, &name)?
        .into_iter()
        .map(|p| scene.sought(p))
        .collect();
    let boxes = scene.regions.boxes(&scene.items);
    let ask = |index: &dyn crate::index::DynIndex, point: usize, out: &mut Vec<_>, cost: &mut _| {
        index.locate_counted(points[point].local, out, cost);
        scene.refine(&points[point], out);
    };
    let answers = ask_all(&structures, &scene, boxes, points.len(), true, ask)?;
    unread_is_fine(write(args, &answers))?;
    Ok(if all_agree(&answers, "point") {
        Ending::Ok
    } else {
        Ending::WrongAnswer
    })
}

fn write(args: &LocateArgs, answers: &[Row]) -> io::Result<()> {
    let mut out = BufWriter::new(io::stdout().lock());
    match args.format {
        RowFormat::Csv => {
            let mut csv = csv::Writer::from_writer(&mut out);
            csv.write_record([
                "point",
                "structure",
                "region_count",
                "region_id_sum",
                "region_ids",
                "nodes_tested",
            ])?;
            for a in answers {
                csv.write_record([
                    a.question.to_string(),
                    a.structure.clone(),
                    a.answer.count.to_string(),
                    a.id_sum.to_string(),
                    a.ids.as_deref().map(joined).unwrap_or_default(),
                    a.cost.nodes_tested.to_string(),
                ])?;
            }
            csv.flush()?;
        }
        RowFormat::Json => {
            let rows: Vec<Value> = answers
                .iter()
                .map(|a| {
                    let row = json!({
                        "point": a.question,
                        "structure": a.structure,
                        "region_count": a.answer.count,
                        "region_id_sum": a.id_sum,
                        "nodes_tested": a.cost.nodes_tested,
                    });
                    with_ids(row, "region_ids", a)
                })
                .collect();
            serde_json::to_writer_pretty(&mut out, &rows)?;
            writeln!(out)?;
        }
    }
    out.flush()
}
