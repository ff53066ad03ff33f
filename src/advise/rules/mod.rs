//! The rules of omission, a function each, which enters both sides of a rule.

mod planes;
pub(super) mod stages;
mod structures;

use super::omission::By::{Rule as Statistic, Time};
use super::rule::Rule;
use crate::funnel::StageKind::{Fragment, Occlusion, Region, Triangle};

/// All rules: name, work to leave out; statistic; decision.
pub(super) const RULES: &[Rule] = rows! {
    Rule { name, left_out, statistic_name, by, enter }
    "needless-planes", "every plane",
        "share of all planes that the n-vertex of the scene's bounds is not inside of",
        Time, planes::needless_planes;
    "plane-masks", "inherited planes", "share of the plane tests that masks do not save",
        Time, planes::plane_masks;
    "no-index", "index", "items", Time, structures::no_index;
    "six-planes", "axes beyond planes", "cost of drawing what six planes let through, ns a query",
        Statistic, planes::six_planes;
    "regions", "portals",
        "share of the items left by the other stages that lie in no region that is seen",
        Statistic, |_| stages::reads(Region);
    "occlusion", "occlusion culling",
        "share of the items left by the other stages that others hide",
        Statistic, |_| stages::reads(Occlusion);
    "cones", "normal cones", "share of the triangles of the items left whose cluster faces away",
        Statistic, |_| stages::reads(Triangle);
    "sorting", "depth sorting",
        "share of the shaded fragments that an early z-test saves once items are sorted",
        Statistic, |_| stages::reads(Fragment);
    "third-dimension", "third dimension", "height of the scene", Time, structures::third_dimension;
    "rebasing", "rebasing", "margin for rounding in world coordinates / depth of the view",
        Statistic, planes::rebasing;
    "rebuild", "rebuilds", "time of a frame without rebuilds, ns",
        Statistic, |_| structures::rebuild();
    "f64-kernel", "double precision", "margin for rounding to f32 / depth of the view",
        Statistic, planes::f64_kernel;
    "frame-correction", "basis correction", "error of the axes after all steps of the path",
        Statistic, structures::frame_correction;
};
