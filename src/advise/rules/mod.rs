//! The rules of omission, a function each, which enters both sides of a rule.

mod planes;
pub(super) mod stages;
mod structures;

use super::omission::By::{Rule as Statistic, Time};
use super::omission::LeftOutIf::{AtLeast, AtMost};
use super::rule::Rule;
use crate::funnel::StageKind::{Fragment, Occlusion, Region, Triangle};

/// All rules: name, work to leave out, feature; statistic; decision.
pub(super) const RULES: &[Rule] = rows! {
    Rule { name, left_out, feature, is_saving, statistic_name, left_out_if, by, prepare }
    "needless-planes", "planes that the whole scene is inside of", "every plane", false,
        "share of all planes that the n-vertex of the scene's bounds is inside of",
        AtLeast, Time, planes::needless_planes;
    "plane-masks", "tests of planes that a node above is inside of (by masks)", "plane masks", true,
        "share of the plane tests that masks save",
        AtLeast, Time, planes::plane_masks;
    "no-index", "the index itself", "index", false,
        "items",
        AtMost, Time, structures::no_index;
    "six-planes", "axes beyond the six planes", "axes beyond planes", false,
        "cost of drawing what six planes let through, ns a query",
        AtMost, Statistic, planes::six_planes;
    "regions", "the region stage (portals)", "portals", false,
        "share of the items left by the other stages that lie in no region that is seen",
        AtMost, Statistic, |trials| stages::reads(trials, Region);
    "occlusion", "occlusion culling", "occlusion culling", false,
        "share of the items left by the other stages that others hide",
        AtMost, Statistic, |trials| stages::reads(trials, Occlusion);
    "cones", "normal cones of clusters of triangles", "normal cones", false,
        "share of the triangles of the items left whose cluster faces away",
        AtMost, Statistic, |trials| stages::reads(trials, Triangle);
    "sorting", "sorting what is left from front to back", "depth sorting", false,
        "share of the shaded fragments that an early z-test saves once items are sorted",
        AtMost, Statistic, |trials| stages::reads(trials, Fragment);
    "third-dimension", "the third dimension of cells", "third dimension", false,
        "height of the scene",
        AtMost, Time, structures::third_dimension;
    "rebasing", "rebasing the scene", "rebasing", false,
        "margin for rounding in world coordinates / depth of the view",
        AtMost, Statistic, planes::rebasing;
    "rebuild", "a rebuild after items have moved", "rebuilds", false,
        "what queries on the refitted tree cost more until the next update, ns",
        AtMost, Statistic, structures::rebuild;
    "f64-kernel", "the plane test in f64", "double precision", false,
        "margin for rounding to f32 / depth of the view",
        AtMost, Statistic, planes::f64_kernel;
    "frame-correction", "correcting an f32 camera frame between steps", "basis correction", false,
        "drift after all steps of the path, radians",
        AtMost, Statistic, structures::frame_correction;
};
