//! `cullbench locate`: one row per point, or box, and structure.

use std::fs::File;
use std::path::Path;

use anyhow::Context;
use serde_json::json;

use super::args::LocateArgs;
use super::compare_structures::{Row, ask_all, write};
use super::{Ending, load_scene};
use crate::index::{DynIndex, Registry};
use crate::path::read_points_csv;
use crate::scene::{Scene, Sought, SoughtBox, read_sought_boxes_csv};

pub fn locate(registry: &Registry, args: &LocateArgs) -> anyhow::Result<Ending> {
    let structures = args.kernel.structures(registry, &args.structure)?;
    let scene = load_scene(&args.scene, &args.scene_args, 1)?;
    let what = match args.sought.points {
        Some(_) => "point",
        None => "box",
    };
    let columns = [
        what,
        "structure",
        "region_count",
        "region_id_sum",
        "region_ids",
        "nodes_tested",
    ];
    let row = |a: &Row| {
        vec![
            json!(a.question),
            json!(a.structure),
            json!(a.answer.count),
            json!(a.id_sum),
            json!(a.ids),
            json!(a.cost.nodes_tested),
        ]
    };
    let agree = match (&args.sought.points, &args.sought.boxes) {
        (Some(file), _) => {
            let points = points(&scene, file)?;
            let boxes = scene.regions.boxes(&scene.items);
            let ask = |index: &dyn DynIndex, point: usize, out: &mut Vec<_>, cost: &mut _| {
                let p = &points[point];
                scene.search(p, out, |p, out| index.query_counted(p.into(), out, cost));
                out.clear();
                scene.search(p, out, |p, out| index.locate(p, out));
            };
            let questions = (what, points.len());
            write(args.format, &columns, row, |each| {
                ask_all(&structures, &scene, boxes, questions, true, ask, each)
            })?
        }
        (_, Some(file)) => {
            let boxes = boxes(&scene, file)?;
            let ask = |index: &dyn DynIndex, n: usize, out: &mut Vec<_>, cost: &mut _| {
                index.query_counted((&boxes[n].volume).into(), out, cost);
                out.clear();
                index.visible(&boxes[n].volume, out);
                scene.refine_overlapping(&boxes[n], out);
            };
            let questions = (what, boxes.len());
            write(args.format, &columns, row, |each| {
                let items = &scene.items;
                ask_all(&structures, &scene, items, questions, true, ask, each)
            })?
        }
        // The argument parser has refused that.
        (None, None) => true,
    };
    Ok(Ending::of(agree))
}

fn points(scene: &Scene, file: &Path) -> anyhow::Result<Vec<Sought>> {
    let (input, name) = open(file)?;
    let points = read_points_csv(input, &name)?.into_iter();
    Ok(points.map(|p| scene.sought(p)).collect())
}

fn boxes(scene: &Scene, file: &Path) -> anyhow::Result<Vec<SoughtBox>> {
    let (input, name) = open(file)?;
    let boxes = read_sought_boxes_csv(input, &name)?.into_iter();
    Ok(boxes.map(|b| scene.sought_box(b)).collect())
}

fn open(file: &Path) -> anyhow::Result<(File, String)> {
    let name = file.display().to_string();
    let input = File::open(file).with_context(|| name.clone())?;
    Ok((input, name))
}
