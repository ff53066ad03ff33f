//! The third dimension of the cells: where a scene is flatter than a quadtree's
//! leaves are wide, an octree's third split parts nothing. Bounds stay
//! three-dimensional either way.

use super::super::omission::Decision;
use super::super::options::default_of;
use super::super::rule::{Draft, Finding, Unfit};
use super::super::trials::{Sides, Trials};

pub(super) fn prepare(trials: &mut Trials) -> Result<Draft, Unfit> {
    let case = trials.case;
    let (scene, by) = (case.scene(), case.spec.execution);
    let (octree, quadtree) = (default_of("octree", by)?, default_of("quadtree", by)?);
    let leaf = quadtree.params["leaf"].as_f64().unwrap_or(f64::NAN);
    let extent = scene.bounds.max.as_dvec3() - scene.bounds.min.as_dvec3();
    let mut extents = extent.to_array();
    extents.sort_by(f64::total_cmp);
    let [height, widths @ ..] = extents;
    let cell = 2.0 * (widths[0] * widths[1]).sqrt() / (scene.items.len() as f64 / leaf).sqrt();
    let reason = format!(
        "height {height:.4} by widths {:.4} and {:.4}; the threshold is two leaves of {leaf} items, \
         2 W / sqrt(N / leaf)",
        widths[0], widths[1]
    );
    let [kept, left_out] = [octree.build(&scene.items)?, quadtree.build(&scene.items)?]
        .map(|index| trials.index(index, case.views()));
    let sides = Sides::same("octree against quadtree", kept, left_out);
    Ok(Draft::concluded(vec![sides], move |facts| {
        let taken = facts.structure.name.as_deref().unwrap_or_default();
        let flat = taken.starts_with("quadtree");
        let is_either = flat || taken.starts_with("octree");
        let is_either = is_either && facts.structure.ties.is_empty();
        Finding {
            saving: facts.saving(),
            decision: is_either.then_some(Decision::of(flat)),
            note: "octree against quadtree".to_owned(),
            ..Finding::new(height, cell, reason)
        }
    }))
}
