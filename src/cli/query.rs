//! `cullbench query` and `cullbench locate`: one row per camera, point or box, and
//! structure.

use std::path::Path;

use serde_json::json;

use super::args::{LocateArgs, QueryArgs};
use super::compare_structures::{Column, Row, ask_all, write};
use super::{Ending, load_scene, tell};
use crate::geometry::Aabb;
use crate::index::{DynIndex, Registry};
use crate::input::{is_readable, read_file, tell_warnings};
use crate::measure::Workload;
use crate::motion::Motion;
use crate::path::{self, read_points_csv};
use crate::query::{ItemId, QueryCost};
use crate::scene::{Scene, Sought, SoughtBox, read_sought_boxes_csv};

/// Points that are the camera places of the scene.
const PLACES: &str = "places";

pub fn query(registry: &Registry, args: &QueryArgs) -> anyhow::Result<Ending> {
    let structures = args.culling.kernel.structures(registry, &args.structure)?;
    let (defaults, culling) = (args.lens.defaults()?, args.culling.culling(&args.test)?);
    let mut scene = load_scene(&args.scene, &args.lens.scene_args.options(1))?;
    let cameras = path::load(&args.cameras, &scene, &defaults)?;
    let mut motion = None;
    if let Some(source) = &args.motion {
        let own = Motion::load(source, &scene)?.seen_by(&cameras, 1);
        advance(&mut scene.items, &own, args.frame)?;
        motion = Some(own);
    }
    let workload = Workload::moving(&scene, &cameras, &culling, motion, 1)?;
    tell_warnings();
    if let Some(doubt) = culling.unproven() {
        tell(&format!("note: {doubt}"));
    }
    let ask = frustum(&workload);
    let columns: [Column<Row>; 9] = [
        ("camera", &|row| json!(row.question)),
        ("structure", &|row| json!(row.structure)),
        ("test", &|_| json!(culling.test.name())),
        ("total_count", &|_| json!(scene.items.len())),
        ("visible_count", &|row| json!(row.answer.count)),
        ("visible_id_sum", &|row| json!(row.id_sum)),
        ("nodes_tested", &|row| json!(row.cost.nodes_tested)),
        ("items_tested", &|row| json!(row.cost.items_tested)),
        ("visible_ids", &|row| json!(shown(&scene, row))),
    ];
    let columns = &columns[..if args.ids { 9 } else { 8 }];
    let (items, questions) = (&workload.items, ("camera", workload.views.len()));
    let agree = write(args.format, columns, |each| {
        ask_all(&structures, &scene, items, questions, args.ids, ask, each)
    })?;
    Ok(Ending::of(agree))
}

/// The ids of an answer as files have them.
fn shown(scene: &Scene, row: &Row) -> Option<Vec<ItemId>> {
    let ids = row.ids.as_deref()?;
    Some(ids.iter().map(|&id| scene.row_of(id)).collect())
}

/// Moves items through `frame` frames of a motion, or through all of them.
fn advance(items: &mut [Aabb], motion: &Motion, frame: Option<u32>) -> anyhow::Result<()> {
    let (frames, name) = (motion.frames(), &motion.name);
    let wanted = frame.map_or(frames, |frame| frame as usize);
    anyhow::ensure!(
        wanted <= frames,
        "--frame is {wanted}; expected at most {frames}, the frames of '{name}'"
    );
    let mut replay = motion.replay();
    for _ in 0..wanted {
        replay.advance(items);
    }
    Ok(())
}

/// Counts a query with a camera's view, then returns the ids of the plain query.
pub fn frustum(
    workload: &Workload,
) -> impl Fn(&dyn DynIndex, usize, &mut Vec<ItemId>, &mut QueryCost) + Sync {
    |index, camera, out, cost| {
        let view = workload.views[camera].as_any();
        index.query_counted(view, out, cost);
        out.clear();
        index.query(view, out);
    }
}

pub fn locate(registry: &Registry, args: &LocateArgs) -> anyhow::Result<Ending> {
    let structures = args.kernel.structures(registry, &args.structure)?;
    let scene = load_scene(&args.scene, &args.scene_args.options(1))?;
    let (what, items) = match args.sought.points {
        Some(_) => ("point", scene.regions.boxes(&scene.items)),
        None => ("box", &scene.items[..]),
    };
    let columns: [Column<Row>; 6] = [
        (what, &|row| json!(row.question)),
        ("structure", &|row| json!(row.structure)),
        ("region_count", &|row| json!(row.answer.count)),
        ("region_id_sum", &|row| json!(row.id_sum)),
        ("region_ids", &|row| json!(shown(&scene, row))),
        ("nodes_tested", &|row| json!(row.cost.nodes_tested)),
    ];
    let (file, other) = (args.sought.points.as_ref(), args.sought.boxes.as_ref());
    let points = file.map_or(Ok(Vec::new()), |file| points(&scene, file))?;
    let boxes = other.map_or(Ok(Vec::new()), |file| boxes(&scene, file))?;
    let ask = |index: &dyn DynIndex, n: usize, out: &mut Vec<_>, cost: &mut _| {
        if let Some(p) = points.get(n) {
            scene.search(p, out, |p, out| index.query_counted(p.into(), out, cost));
            out.clear();
            scene.search(p, out, |p, out| index.locate(p, out));
        } else {
            index.query_counted((&boxes[n].volume).into(), out, cost);
            out.clear();
            index.visible(&boxes[n].volume, out);
            scene.refine_overlapping(&boxes[n], out);
        }
    };
    let questions = (what, points.len() + boxes.len());
    let agree = write(args.format, &columns, |each| {
        ask_all(&structures, &scene, items, questions, true, ask, each)
    })?;
    Ok(Ending::of(agree))
}

fn points(scene: &Scene, file: &Path) -> anyhow::Result<Vec<Sought>> {
    if file == Path::new(PLACES) && !is_readable(file) {
        anyhow::ensure!(
            !scene.places.is_empty(),
            "--points {PLACES}: scene '{}' has no camera places; expected a points CSV, or a scene \
             with places, such as a map",
            scene.name
        );
        let eyes = scene.places.iter().map(|place| scene.sought(place.eye));
        return Ok(eyes.collect());
    }
    let points = read_points_csv(&read_file(file)?[..], &file.display().to_string())?.into_iter();
    Ok(points.map(|p| scene.sought(p)).collect())
}

fn boxes(scene: &Scene, file: &Path) -> anyhow::Result<Vec<SoughtBox>> {
    let boxes = read_sought_boxes_csv(&read_file(file)?[..], &file.display().to_string())?;
    Ok(boxes.into_iter().map(|b| scene.sought_box(b)).collect())
}
