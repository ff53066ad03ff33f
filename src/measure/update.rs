//! Items that move: what an update costs, and what many of them do to queries.

use super::clock::Stopwatch;
use super::{Answer, Protocol, TimedTask, Workload, guarded, timed_rounds};
use crate::geometry::Aabb;
use crate::index::{BuildError, DynIndex, StructureSpec};
use crate::query::ItemId;
use crate::scene::Scene;

/// Shares of the items that move in the updates that are measured.
pub const UPDATE_SHARES: [f64; 4] = [0.001, 0.01, 0.1, 1.0];
/// The share that moves in the update before them, and in each of the many.
const USUAL_SHARE: f64 = 0.01;
/// Updates after which queries are timed again.
const MANY: usize = 32;
/// Largest scene whose updates are measured: they need a second copy of it.
pub(super) const MOST_UPDATED: usize = 2_000_000;
/// Cameras and rounds of a query after many updates.
const CAMERAS: usize = 24;
const ROUNDS: usize = 7;

/// Moves a share of the items by their own size and times bringing the index
/// up to date, CPU ms; once for each share, on an index that is then thrown
/// away. The first update, which touches memory for the first time, is not timed.
pub(super) fn measure_updates(
    spec: &StructureSpec,
    scene: &Scene,
    items: &[Aabb],
    mut index: Box<dyn DynIndex>,
) -> Result<Vec<f64>, BuildError> {
    if items.is_empty() || items.len() > MOST_UPDATED {
        return Ok(Vec::new());
    }
    let mut items = items.to_vec();
    let mut times = Vec::with_capacity(UPDATE_SHARES.len());
    let first = move_share(&mut items, USUAL_SHARE);
    spec.update(&mut index, &items, scene.own_tree.as_ref(), &first)?;
    for share in UPDATE_SHARES {
        let moved = move_share(&mut items, share);
        let watch = Stopwatch::start();
        spec.update(&mut index, &items, scene.own_tree.as_ref(), &moved)?;
        times.push(watch.lap().cpu_ns / 1e6);
    }
    Ok(times)
}

/// ln of (query time after many refits / query time on a fresh build of the same
/// boxes), frustum queries side by side in one process. `None` for a structure
/// that does not refit, a scene too large, or answers that differ.
pub(super) fn refitted_ln(
    spec: &StructureSpec,
    workload: &Workload,
    protocol: &Protocol,
) -> Option<f64> {
    let scene = workload.scene;
    let refits = spec.row.info.capabilities.refits;
    if !refits || protocol.cold || workload.items.is_empty() || scene.items.len() > MOST_UPDATED {
        return None;
    }
    let mut items = workload.items.to_vec();
    let own_tree = scene.own_tree.as_ref();
    let mut refitted = spec.build_with(&items, own_tree).ok()?;
    for _ in 0..MANY {
        let moved = move_share(&mut items, USUAL_SHARE);
        spec.update(&mut refitted, &items, own_tree, &moved).ok()?;
    }
    let rebuilt = spec.build_with(&items, own_tree).ok()?;
    let answers = |index: &dyn DynIndex| -> Option<Vec<Answer>> {
        let mut out = Vec::new();
        let of_view = |view: &crate::culling::CameraView| {
            out.clear();
            guarded(|| index.see(view.as_any(), &mut out)).ok()?;
            Some(Answer::of(&out))
        };
        workload.views.iter().map(of_view).collect()
    };
    let expected = answers(rebuilt.as_ref())?;
    if answers(refitted.as_ref())? != expected {
        return None;
    }
    let tasks = [&refitted, &rebuilt].map(|index| TimedTask {
        ask: Box::new(|camera, out| index.see(workload.views[camera].as_any(), out)),
        ask_many: None,
        expected: expected.iter().map(|answer| answer.count).collect(),
        least_ns: None,
    });
    let few = Protocol {
        rounds: [ROUNDS, ROUNDS],
        cameras: protocol.cameras.min(CAMERAS),
        ..*protocol
    };
    let timed = timed_rounds(workload.views.len(), &tasks, &few, &|| false)?;
    match &timed[..] {
        [Ok(refitted), Ok(rebuilt)] => refitted.over(rebuilt).map(f64::ln),
        _ => None,
    }
}

/// Moves evenly spread items by their own extent; which ones.
pub fn move_share(items: &mut [Aabb], share: f64) -> Vec<ItemId> {
    let count = ((items.len() as f64 * share).round() as usize).clamp(1, items.len());
    let moved: Vec<ItemId> = (0..count)
        .map(|i| (i * items.len() / count) as ItemId)
        .collect();
    for &id in &moved {
        let b = &mut items[id as usize];
        let step = b.extent();
        *b = Aabb::new(b.min + step, b.max + step);
    }
    moved
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::culling::Culling;
    use crate::path::{self, LensDefaults};
    use crate::scene;

    #[test]
    fn a_structure_that_refits_is_timed_again_and_no_other() {
        let scene = scene::load("uniform:n=2000", &Default::default()).unwrap();
        let way = path::load("orbit:frames=8", &scene, &LensDefaults::default()).unwrap();
        let workload = Workload::new(&scene, &way, &Culling::default()).unwrap();
        let protocol = Protocol {
            rounds: [3, 3],
            task_ns: 1e5,
            cameras: 8,
            cold: false,
            seed: 1,
            cache_bytes: 0,
        };
        for name in ["bvh", "wide", "linear", "bsp"] {
            let spec = StructureSpec::parse(name).unwrap();
            let found = refitted_ln(&spec, &workload, &protocol);
            assert_eq!(
                found.is_some_and(f64::is_finite),
                spec.row.info.capabilities.refits,
                "{name}: {found:?}"
            );
        }
    }
}
