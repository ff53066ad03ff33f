//! Two passes: draws all occluders, hidden ones too, then tests items.
//!
//! Harder for a buffer than drawing visible occluders front to back.

use super::super::buffer::{OcclusionBuffer, draw};
use super::super::rect::{Candidate, Rects};
use super::super::scene::OccluderTree;
use super::super::view::View;
use crate::geometry::BoxBlock;
use crate::kernel::{Isa, Kernel, LANES, Work};
use crate::query::ItemId;

/// Two passes over the items in a view.
pub struct TwoPass<'a, B> {
    /// Buffer to draw into.
    pub buffer: B,
    /// The occluders.
    pub scene: &'a OccluderTree,
    /// The view.
    pub view: &'a View<'a>,
    /// Items in the view, ascending.
    pub items: &'a [ItemId],
}

impl<B: OcclusionBuffer> TwoPass<'_, B> {
    /// Items that are not hidden, in tree order.
    pub fn kept(self, kernel: Kernel) -> Vec<ItemId> {
        kernel.run(self)
    }
}

impl<B: OcclusionBuffer> Work for TwoPass<'_, B> {
    type Output = Vec<ItemId>;

    #[inline(always)]
    fn run<I: Isa>(mut self, isa: I) -> Vec<ItemId> {
        let (scene, view) = (self.scene, self.view);
        let is_given = |&position: &usize| {
            let item = scene.item(position);
            item.is_none_or(|item| self.items.binary_search(&item).is_ok())
        };
        let positions: Vec<usize> = (0..scene.len()).filter(is_given).collect();
        let mut candidates: Vec<(f32, Candidate)> = Vec::new();
        let mut rects = Rects::default();
        for chunk in positions.chunks(LANES) {
            let mut block = BoxBlock::EMPTY;
            for (lane, &position) in chunk.iter().enumerate() {
                block.set(lane, &scene.outer(position));
            }
            rects.project(isa, &block, view);
            let lanes = chunk.iter().enumerate();
            let seen = lanes.filter(|(lane, _)| rects.seen >> lane & 1 == 1);
            candidates.extend(
                seen.map(|(lane, &position)| (rects.depth[lane], rects.candidate(lane, position))),
            );
        }
        candidates.sort_by(|(a, _), (b, _)| a.total_cmp(b));
        self.buffer.clear();
        for (_, candidate) in &candidates {
            draw(isa, &mut self.buffer, scene, view, candidate);
        }
        let is_kept = |c: &&Candidate| c.near || !self.buffer.hides(isa, &c.rect);
        let kept = candidates.iter().map(|(_, c)| c).filter(is_kept);
        kept.filter_map(|c| scene.item(c.position as usize))
            .collect()
    }
}
