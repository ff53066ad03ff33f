//! Back ends of every stage, and the default chain of a scene.

use super::error::LeftOutRow;
use super::stage::{BackEnd, Chain, NONE, StageKind};
use crate::kernel::Kernel;
use crate::query::ItemId;
use crate::scene::{Regions, Scene};
use crate::visibility::occlusion::{
    Interleaved, MaskedCentre, MaskedInner, OccluderScene, OcclusionBuffer, View, ZBuffer,
};
use crate::visibility::region;
use crate::visibility::triangle::TRIANGLE_ROWS;
use crate::visibility::{Guarantee, SampleGrid};

pub const PORTAL_CLIP: &str = "portal-clip";
pub const MASKED_INNER: &str = "masked-inner";
/// The test that takes every item for solid.
pub const Z: &str = "z-test";
const ALPHA: &str = "alpha-test";
/// The test that is restricted to the samples of portals.
pub const STENCIL: &str = "stencil-test";

/// The region stage as left out, if the sectors of a map do not divide the plane.
pub fn left_out_of(scene: &Scene) -> Option<LeftOutRow> {
    let Regions::Bsp(map) = &scene.regions else {
        return None;
    };
    let dispute = map.disputes().first();
    dispute.map(|dispute| LeftOutRow::new("stages", "region", dispute))
}

/// Back ends of a stage that a scene can have, without structures.
///
/// With `has_cut_outs` some items have holes.
pub fn back_ends(stage: StageKind, scene: &Scene, has_cut_outs: bool) -> Vec<BackEnd> {
    let declared = [NONE, "the stage is left out"];
    let mut rows = vec![BackEnd::new(stage, declared, Guarantee::Conservative)];
    match stage {
        StageKind::Region => {
            let known = region::BACK_ENDS.iter().filter(|row| row.is_for(scene));
            rows.extend(
                known.map(|row| BackEnd::new(stage, [row.name, row.summary], row.guarantee)),
            );
        }
        StageKind::Object => {}
        StageKind::Occlusion => rows.extend(OCCLUSION_ROWS.iter().map(|row| row.back_end)),
        StageKind::Triangle => {
            let culls = TRIANGLE_ROWS.iter().filter(|row| row.name != NONE);
            rows.extend(
                culls.map(|row| BackEnd::new(stage, [row.name, row.summary], row.guarantee)),
            );
        }
        StageKind::Fragment => rows.extend(fragment_tests(scene, has_cut_outs)),
    }
    rows
}

fn fragment_tests(scene: &Scene, has_cut_outs: bool) -> impl Iterator<Item = BackEnd> {
    let exact = Guarantee::SampleExact;
    let z = match has_cut_outs {
        true => (
            [Z, "the nearest fragment, holes or not"],
            Guarantee::Unproven,
        ),
        false => ([Z, "the nearest fragment of each sample, exactly"], exact),
    };
    let alpha = ([ALPHA, "the nearest opaque fragment"], exact);
    let beyond = "the same, but beyond the eye's room only at samples that see its portals";
    let has_rooms = matches!(&scene.regions, Regions::Tiling(rooms) if !rooms.portals.is_empty());
    let rows = [
        (true, z),
        (has_cut_outs, alpha),
        (has_rooms, ([STENCIL, beyond], exact)),
    ];
    let there = rows.into_iter().filter(|(is_there, _)| *is_there);
    there.map(|(_, (declared, guarantee))| BackEnd::new(StageKind::Fragment, declared, guarantee))
}

/// Default test of the fragment stage.
pub fn default_test(has_cut_outs: bool) -> &'static str {
    if has_cut_outs { ALPHA } else { Z }
}

impl Chain {
    /// Default chain of a scene, without an object stage.
    ///
    /// It has the safe back end of every stage that removes the most.
    pub fn for_scene(scene: &Scene, has_cut_outs: bool) -> Chain {
        let wanted = [
            (StageKind::Region, PORTAL_CLIP),
            (StageKind::Occlusion, MASKED_INNER),
            (StageKind::Triangle, "per-triangle"),
            (StageKind::Fragment, default_test(has_cut_outs)),
        ];
        let is_there = |(stage, name): &(StageKind, &str)| {
            let mut rows = back_ends(*stage, scene, has_cut_outs).into_iter();
            rows.any(|row| row.name == *name)
        };
        let known = wanted.into_iter().filter(is_there);
        known.fold(Chain::empty(), |chain, (stage, name)| {
            chain.with(stage, name)
        })
    }
}

/// Appends the items of a view that are not hidden.
pub type Occlude = Box<dyn FnMut(&OccluderScene, &View, &mut Vec<ItemId>)>;

/// A row of the occlusion stage.
pub struct OcclusionRow {
    pub back_end: BackEnd,
    /// Allocates a buffer of the given size.
    pub new: fn(SampleGrid, Kernel) -> Occlude,
}

impl OcclusionRow {
    const fn of<B: OcclusionBuffer + 'static>(name: &'static str) -> OcclusionRow {
        OcclusionRow {
            back_end: BackEnd {
                does_object_stage: true,
                ..BackEnd::new(StageKind::Occlusion, [name, B::SUMMARY], B::GUARANTEE)
            },
            new: |grid, kernel| {
                let mut state = Interleaved::new(B::new(grid), kernel);
                Box::new(move |scene, view, out| {
                    state.cull(scene, view, out);
                })
            },
        }
    }
}

/// Rows of the occlusion stage.
pub static OCCLUSION_ROWS: [OcclusionRow; 3] = [
    OcclusionRow::of::<MaskedInner>(MASKED_INNER),
    OcclusionRow::of::<MaskedCentre>("masked"),
    OcclusionRow::of::<ZBuffer>("z-buffer"),
];
