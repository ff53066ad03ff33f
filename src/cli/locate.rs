//! `cullbench locate`: one row per point, or box, and structure.

use std::fs::File;
use std::path::Path;

use anyhow::Context;
use serde_json::json;

use super::args::LocateArgs;
use super::compare_structures::{Row, all_agree, ask_all, write};
use super::{Ending, load_scene, unread_is_fine};
use crate::index::{DynIndex, Registry, StructureSpec};
use crate::path::read_points_csv;
use crate::scene::{Scene, Sought, SoughtBox, read_sought_boxes_csv};

pub fn locate(registry: &Registry, args: &LocateArgs) -> anyhow::Result<Ending> {
    let structures = args.kernel.structures(registry, &args.structure)?;
    let scene = load_scene(&args.scene, &args.scene_args, 1)?;
    let (what, answers) = match (&args.sought.points, &args.sought.boxes) {
        (Some(file), _) => ("point", by_points(&scene, &structures, file)?),
        (_, Some(file)) => ("box", by_boxes(&scene, &structures, file)?),
        // The argument parser has refused that.
        (None, None) => ("point", Vec::new()),
    };
    let columns = [
        what,
        "structure",
        "region_count",
        "region_id_sum",
        "region_ids",
        "nodes_tested",
    ];
    unread_is_fine(write(args.format, &columns, &answers, |a| {
        vec![
            json!(a.question),
            json!(a.structure),
            json!(a.answer.count),
            json!(a.id_sum),
            json!(a.ids),
            json!(a.cost.nodes_tested),
        ]
    }))?;
    Ok(Ending::of(all_agree(&answers, what)))
}

/// The regions that hold each point.
fn by_points(scene: &Scene, structures: &[StructureSpec], file: &Path) -> anyhow::Result<Vec<Row>> {
    let (input, name) = open(file)?;
    let points = read_points_csv(input, &name)?.into_iter();
    let points: Vec<Sought> = points.map(|p| scene.sought(p)).collect();
    let boxes = scene.regions.boxes(&scene.items);
    let ask = |index: &dyn DynIndex, point: usize, out: &mut Vec<_>, cost: &mut _| {
        let p = &points[point];
        scene.search(p, out, |p, out| index.query_counted(p.into(), out, cost));
        out.clear();
        scene.search(p, out, |p, out| index.locate(p, out));
    };
    ask_all(structures, scene, boxes, points.len(), true, ask)
}

/// The items that overlap each box.
fn by_boxes(scene: &Scene, structures: &[StructureSpec], file: &Path) -> anyhow::Result<Vec<Row>> {
    let (input, name) = open(file)?;
    let boxes = read_sought_boxes_csv(input, &name)?.into_iter();
    let boxes: Vec<SoughtBox> = boxes.map(|b| scene.sought_box(b)).collect();
    let ask = |index: &dyn DynIndex, n: usize, out: &mut Vec<_>, cost: &mut _| {
        index.query_counted((&boxes[n].volume).into(), out, cost);
        out.clear();
        index.visible(&boxes[n].volume, out);
        scene.refine_overlapping(&boxes[n], out);
    };
    ask_all(structures, scene, &scene.items, boxes.len(), true, ask)
}

fn open(file: &Path) -> anyhow::Result<(File, String)> {
    let name = file.display().to_string();
    let input = File::open(file).with_context(|| name.clone())?;
    Ok((input, name))
}
