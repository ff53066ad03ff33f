//! The rules of omission, one file each.

mod cones;
mod f64_kernel;
mod flat;
mod frame_correction;
mod needless_planes;
mod no_index;
mod occlusion;
mod plane_masks;
mod rebasing;
mod rebuild;
mod regions;
mod removal;
mod six_planes;
mod sorting;

use super::rule::Rule;

pub(super) const RULES: &[Rule] = &[
    needless_planes::RULE,
    plane_masks::RULE,
    no_index::RULE,
    six_planes::RULE,
    regions::RULE,
    occlusion::RULE,
    occlusion::BUFFER_RULE,
    cones::RULE,
    sorting::RULE,
    flat::RULE,
    rebasing::RULE,
    rebuild::RULE,
    f64_kernel::RULE,
    frame_correction::RULE,
];
