//! The tests of the fragment stage that the funnel compares.

use super::stage::{BackEnd, StageKind};
use crate::scene::{Regions, Scene};
use crate::visibility::Guarantee;

/// Takes every item for solid.
pub const Z: &str = "z-test";
const ALPHA: &str = "alpha-test";
/// Restricted to the samples of portals.
pub const STENCIL: &str = "stencil-test";

/// What a chain takes.
pub fn default(has_cut_outs: bool) -> &'static str {
    if has_cut_outs { ALPHA } else { Z }
}

/// The tests that there are for a scene, of which some items may be cut out.
pub fn back_ends(scene: &Scene, has_cut_outs: bool) -> impl Iterator<Item = BackEnd> {
    let exact = Guarantee::SampleExact;
    let z = match has_cut_outs {
        true => (Z, "the nearest fragment, holes or not", Guarantee::Unproven),
        false => (Z, "the nearest fragment of each sample, exactly", exact),
    };
    let alpha = (ALPHA, "the nearest fragment that is no hole", exact);
    let stencil = (
        STENCIL,
        "the same, beyond the eye's room only where its portals are seen",
        exact,
    );
    let has_rooms = matches!(&scene.regions, Regions::Tiling(rooms) if !rooms.portals.is_empty());
    let rows = [(true, z), (has_cut_outs, alpha), (has_rooms, stencil)];
    let there = rows.into_iter().filter(|(is_there, _)| *is_there);
    there.map(|(_, (name, summary, guarantee))| {
        BackEnd::of(StageKind::Fragment, [name, summary], guarantee)
    })
}
