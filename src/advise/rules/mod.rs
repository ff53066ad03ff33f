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

use super::omission::By::{Rule as Statistic, Time};
use super::omission::LeftOutIf::{AtLeast, AtMost};
use super::rule::Rule;

/// All rules: name, work to leave out, feature; statistic; decision.
pub(super) const RULES: &[Rule] = rows! {
    Rule { name, left_out, feature, is_saving, statistic_name, left_out_if, by, prepare }
    "needless-planes", "planes that the whole scene is inside of", "every plane", false,
        "share of all planes that the n-vertex of the scene's bounds is inside of",
        AtLeast, Time, needless_planes::prepare;
    "plane-masks", "tests of planes that a node above is inside of (by masks)", "plane masks", true,
        "share of the plane tests that masks save",
        AtLeast, Time, plane_masks::prepare;
    "no-index", "the index itself", "index", false,
        "items",
        AtMost, Time, no_index::prepare;
    "six-planes", "axes beyond the six planes", "axes beyond planes", false,
        "cost of drawing what six planes let through, ns a query",
        AtMost, Statistic, six_planes::prepare;
    "regions", "the region stage (portals)", "portals", false,
        "share of the items in the view that lie in no region that is seen",
        AtMost, Statistic, regions::prepare;
    "occlusion", "occlusion culling", "occlusion culling", false,
        "share of the items in the view that others hide",
        AtMost, Statistic, occlusion::prepare;
    "occlusion-buffer", "half of the occlusion buffer's columns and rows", "320x180 buffer", false,
        "share of the items left by 160x90 that 320x180 removes as well",
        AtMost, Statistic, occlusion::prepare_buffer;
    "cones", "normal cones of clusters of triangles", "normal cones", false,
        "share of the triangles of the items in the view whose cluster faces away",
        AtMost, Statistic, cones::prepare;
    "sorting", "sorting what is left from front to back", "depth sorting", false,
        "share of the shaded fragments that an early z-test saves once items are sorted",
        AtMost, Statistic, sorting::prepare;
    "third-dimension", "the third dimension of cells", "third dimension", false,
        "height of the scene",
        AtMost, Time, flat::prepare;
    "rebasing", "rebasing the scene", "rebasing", false,
        "margin for rounding in world coordinates / depth of the view",
        AtMost, Statistic, rebasing::prepare;
    "rebuild", "a rebuild after items have moved", "rebuilds", false,
        "what queries on the refitted tree cost more until the next update, ns",
        AtMost, Statistic, rebuild::prepare;
    "f64-kernel", "the plane test in f64", "double precision", false,
        "margin for rounding to f32 / depth of the view",
        AtMost, Statistic, f64_kernel::prepare;
    "frame-correction", "correcting an f32 camera frame between steps", "basis correction", false,
        "drift after all steps of the path, radians",
        AtMost, Statistic, frame_correction::prepare;
};
