//! Query time of a structure after many refits, against a fresh build.

use super::input_of;
use super::update::{MOST_UPDATED, USUAL_SHARE, move_share};
use super::{Answer, Protocol, TimedTask, Workload, guarded, timed_rounds};
use crate::geometry::Aabb;
use crate::index::{DynIndex, StructureSpec};

/// Number of updates before queries are timed.
const MANY: usize = 32;
/// Most timed cameras.
const CAMERAS: usize = 24;
/// Number of rounds.
const ROUNDS: usize = 7;

/// ln of (query time after many refits / query time on a fresh build).
///
/// Frustum queries over the same boxes, timed side by side in one process. `None` for a
/// structure that does not refit, a scene too large, or answers that differ.
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
    let mut refitted = spec.build(input_of(scene, &items)).ok()?;
    for _ in 0..MANY {
        let moved = move_share(&mut items, USUAL_SHARE);
        spec.update(&mut refitted, input_of(scene, &items), &moved)
            .ok()?;
    }
    over_fresh(refitted.as_ref(), spec, workload, &items, protocol)
}

/// ln of (query time / query time on a fresh build of the same boxes).
///
/// All views of the path, timed side by side; `None` if answers differ.
pub(super) fn over_fresh(
    aged: &dyn DynIndex,
    spec: &StructureSpec,
    workload: &Workload,
    items: &[Aabb],
    protocol: &Protocol,
) -> Option<f64> {
    let rebuilt = spec.build(input_of(workload.scene, items)).ok()?;
    let answers = |index: &dyn DynIndex| -> Option<Vec<Answer>> {
        let mut out = Vec::new();
        let of_view = |view: &crate::culling::CameraView| {
            out.clear();
            guarded(|| index.query(view.as_any(), &mut out)).ok()?;
            Some(Answer::of(&out))
        };
        workload.views.iter().map(of_view).collect()
    };
    let expected = answers(rebuilt.as_ref())?;
    if answers(aged)? != expected {
        return None;
    }
    let tasks = [aged, rebuilt.as_ref()].map(|index| {
        let counts = expected.iter().map(|answer| answer.count).collect();
        TimedTask::new(counts, |camera, out| {
            index.query(workload.views[camera].as_any(), out);
        })
    });
    let few = Protocol {
        rounds: [ROUNDS, ROUNDS],
        cameras: protocol.cameras.min(CAMERAS),
        ..*protocol
    };
    let timed = timed_rounds(workload.views.len(), &tasks, &few);
    match &timed[..] {
        [Ok(refitted), Ok(rebuilt)] => refitted.over(rebuilt).map(f64::ln),
        _ => None,
    }
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
        for name in ["bvh", "wide", "linear-scalar", "bsp"] {
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
