//! `cullbench query`: one row per camera and structure.

use serde_json::json;

use super::args::QueryArgs;
use super::compare_structures::{Row, ask_all, write};
use super::{Ending, load_scene, tell};
use crate::index::Registry;
use crate::measure::Workload;
use crate::path;

pub fn query(registry: &Registry, args: &QueryArgs) -> anyhow::Result<Ending> {
    let structures = args.kernel.structures(registry, &args.structure)?;
    let (defaults, culling) = (args.lens.defaults()?, args.culling.culling(&args.test)?);
    let scene = load_scene(&args.scene, &args.scene_args, 1)?;
    let cameras = path::load(&args.cameras, &scene, &defaults)?;
    let workload = Workload::new(&scene, &cameras, &culling)?;
    if let Some(doubt) = culling.unproven() {
        tell(&format!("note: {doubt}"));
    }
    let ask = |index: &dyn crate::index::DynIndex, camera: usize, out: &mut _, cost: &mut _| {
        let view = workload.views[camera].as_any();
        index.query_counted(view, out, cost);
        out.clear();
        index.query(view, out);
    };
    let mut columns = vec![
        "camera",
        "structure",
        "test",
        "total_count",
        "visible_count",
        "visible_id_sum",
        "nodes_tested",
        "items_tested",
    ];
    columns.extend(args.ids.then_some("visible_ids"));
    let (test, total) = (culling.test.name(), scene.items.len());
    let row = |a: &Row| {
        let mut row = vec![
            json!(a.question),
            json!(a.structure),
            json!(test),
            json!(total),
            json!(a.answer.count),
            json!(a.id_sum),
            json!(a.cost.nodes_tested),
            json!(a.cost.items_tested),
        ];
        row.extend(a.ids.as_ref().map(|ids| json!(ids)));
        row
    };
    let (items, questions) = (&workload.items, ("camera", workload.views.len()));
    let agree = write(args.format, &columns, row, |each| {
        ask_all(&structures, &scene, items, questions, args.ids, ask, each)
    })?;
    Ok(Ending::of(agree))
}
