//! The occlusion stage's back ends as rows: which buffer, in which coupling.

use super::stage::{BackEnd, StageKind};
use crate::kernel::Kernel;
use crate::query::ItemId;
use crate::visibility::SampleGrid;
use crate::visibility::occlusion::{
    HierarchicalZ, Interleaved, MaskedCentre, MaskedInner, OccluderChoice, OccluderScene,
    OcclusionBuffer, TwoPass, View, ZBuffer,
};

/// Something that removes what is hidden, with memory of its own.
pub trait Hide {
    /// Appends what is not hidden of `items`; a coupling that walks its own tree looks
    /// for all items of the view.
    fn hide(&mut self, scene: &OccluderScene, view: &View, items: &[ItemId], out: &mut Vec<ItemId>);
}

impl<B: OcclusionBuffer> Hide for TwoPass<B> {
    fn hide(
        &mut self,
        scene: &OccluderScene,
        view: &View,
        items: &[ItemId],
        out: &mut Vec<ItemId>,
    ) {
        self.cull(scene, view, items, out);
    }
}

impl<B: OcclusionBuffer> Hide for Interleaved<B> {
    fn hide(&mut self, scene: &OccluderScene, view: &View, _: &[ItemId], out: &mut Vec<ItemId>) {
        self.cull(scene, view, out);
    }
}

/// A row of the occlusion stage.
pub struct HidingRow {
    /// What it declares.
    pub back_end: BackEnd,
    /// With a buffer of so many pixels, on an instruction set. Two passes draw the occluders
    /// that are chosen; a walk of a tree draws what it comes upon.
    pub make: fn(SampleGrid, Kernel, OccluderChoice) -> Box<dyn Hide>,
}

impl HidingRow {
    const fn interleaved<B: OcclusionBuffer + 'static>(name: &'static str) -> HidingRow {
        HidingRow {
            back_end: BackEnd {
                does_object_stage: true,
                ..BackEnd::of(StageKind::Occlusion, [name, B::SUMMARY], B::GUARANTEE)
            },
            make: |grid, kernel, _| Box::new(Interleaved::new(B::new(grid), kernel)),
        }
    }

    const fn two_pass<B: OcclusionBuffer + 'static>(name: &'static str) -> HidingRow {
        HidingRow {
            back_end: BackEnd::of(StageKind::Occlusion, [name, B::SUMMARY], B::GUARANTEE),
            make: |grid, kernel, choice| Box::new(TwoPass::new(B::new(grid), choice, kernel)),
        }
    }
}

/// All of them; the first is what a chain takes.
pub static HIDING: &[HidingRow] = &[
    HidingRow::interleaved::<MaskedInner>("masked-inner"),
    HidingRow::interleaved::<MaskedCentre>("masked"),
    HidingRow::interleaved::<ZBuffer>("z-buffer"),
    HidingRow::two_pass::<HierarchicalZ>("hierarchical-z"),
];
