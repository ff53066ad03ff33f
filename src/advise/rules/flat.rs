//! The third dimension of the cells: where a scene is flatter than a quadtree's
//! leaves are wide, an octree's third split parts nothing. Bounds stay
//! three-dimensional either way.

use super::super::case::{Case, asked};
use super::super::choice::named;
use super::super::omission::{By, Draft, Forced, LeftOutIf, Omission, Way};
use super::super::rule::{Rule, Unfit};
use crate::geometry::Aabb;

pub(super) const RULE: Rule = Rule {
    name: "third-dimension",
    left_out: "the third dimension of cells",
    advice: [
        "two-dimensional cells are enough",
        "use three-dimensional cells",
    ],
    statistic_name: "height of the scene",
    left_out_if: LeftOutIf::AtMost,
    by: By::Time,
    prepare,
};

fn prepare<'c>(case: &'c Case<'c>, omission: Omission) -> Result<Draft<'c>, Unfit> {
    let by = case.spec.execution;
    let (octree, quadtree) = (named("octree", by)?, named("quadtree", by)?);
    let leaf = quadtree.params["leaf"].as_f64().unwrap_or(f64::NAN);
    let scene = case.scene();
    let [height, widths @ ..] = sorted_extents(&scene.bounds);
    let cell = 2.0 * (widths[0] * widths[1]).sqrt() / (scene.items.len() as f64 / leaf).sqrt();
    let omission = omission.compares(height, cell).because(format!(
        "height {height:.4} by widths {:.4} and {:.4}; the threshold is two leaves of {leaf} items, \
         2 W / sqrt(N / leaf)",
        widths[0], widths[1]
    ));
    let views = || case.workload.views.clone();
    let forced = Forced {
        on: "octree against quadtree".to_owned(),
        kept: Way::Other(asked(octree.build(&scene.items)?, views())),
        left_out: Way::Other(asked(quadtree.build(&scene.items)?, views())),
        same: true,
        judged: true,
    };
    Ok(omission.draft(vec![forced]))
}

/// Ascending.
fn sorted_extents(bounds: &Aabb) -> [f64; 3] {
    let extent = bounds.max.as_dvec3() - bounds.min.as_dvec3();
    let mut extents = extent.to_array();
    extents.sort_by(f64::total_cmp);
    extents
}
