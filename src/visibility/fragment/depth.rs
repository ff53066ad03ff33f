//! The z-test: the nearest fragment of each sample, by the exact order of depths.

use super::canvas::{Canvas, Fragment};
use super::stencil::Stencil;
use crate::query::ItemId;
use crate::scene::WorldBox;
use crate::visibility::truth::{Along, Body, NO_ITEM, SolidBox};

/// The front item of each sample so far; of a tie the lowest id.
#[derive(Clone, Debug)]
pub struct DepthBuffer<B: Body = SolidBox> {
    front: Vec<Option<(B::At, ItemId)>>,
    /// Fragments that were as near as the one in front, and lost by their id.
    ties: Vec<Fragment<B::At>>,
}

impl<B: Body> DepthBuffer<B> {
    /// A buffer in which nothing is drawn yet.
    pub fn new(samples: usize) -> DepthBuffer<B> {
        DepthBuffer {
            front: vec![None; samples],
            ties: Vec::new(),
        }
    }

    /// Forgets what was drawn.
    pub fn clear(&mut self) {
        self.front.fill(None);
        self.ties.clear();
    }

    /// Draws the fragment, if it passes: its sample is empty, or holds an item that is
    /// deeper, or as deep with a higher id. Returns whether it passed.
    #[inline]
    pub fn test(&mut self, canvas: &Canvas<B>, fragment: &Fragment<B::At>) -> bool {
        let Fragment { sample, item, at } = *fragment;
        let front = &mut self.front[sample];
        if let Some((other, other_item)) = *front {
            let order = canvas.probe(sample).order(&at, &other);
            if order.is_gt() {
                return false;
            }
            if order.is_eq() {
                // The same item may come in several pieces.
                if item == other_item {
                    return false;
                }
                let lost = item.max(other_item);
                let tie = Fragment {
                    item: lost,
                    ..*fragment
                };
                self.ties.push(tie);
                if lost == item {
                    return false;
                }
            }
        }
        *front = Some((at, item));
        true
    }

    /// The front item of a sample, and where its ray meets it.
    #[inline]
    pub fn front(&self, sample: usize) -> Option<(B::At, ItemId)> {
        self.front[sample]
    }

    /// The id buffer: the item in front at each sample, [`NO_ITEM`] for none.
    pub fn ids(&self) -> Vec<ItemId> {
        let id = |front: &Option<(B::At, ItemId)>| front.map_or(NO_ITEM, |front| front.1);
        self.front.iter().map(id).collect()
    }

    /// Number of samples that have been drawn on.
    pub fn covered(&self) -> u64 {
        self.front.iter().filter(|front| front.is_some()).count() as u64
    }

    /// The exact visible set of the samples, ascending: all that is in front
    /// anywhere, every item of a tie.
    pub fn visible(&self, canvas: &Canvas<B>) -> Vec<ItemId> {
        let in_front = |tie: &&Fragment<B::At>| {
            let front = self.front[tie.sample];
            let order = |front: (B::At, _)| canvas.probe(tie.sample).order(&tie.at, &front.0);
            front.is_some_and(|front| order(front).is_eq())
        };
        let ties = self.ties.iter().filter(in_front).map(|tie| tie.item);
        let mut visible: Vec<ItemId> = self.front.iter().flatten().map(|front| front.1).collect();
        visible.extend(ties);
        visible.sort_unstable();
        visible.dedup();
        visible
    }
}

impl DepthBuffer {
    /// Marks the samples at which a rectangle is no farther than the depth buffer.
    ///
    /// A rectangle is a box without thickness along one axis.
    pub fn stencil(&self, canvas: &Canvas, rectangles: &[WorldBox]) -> Stencil {
        let mut stencil = Stencil::new(canvas.grid().samples());
        for rectangle in rectangles {
            let visited = canvas.meet(rectangle, None, |sample, at| {
                let before = |(front, _): (_, _)| canvas.probe(sample).compare(&at, &front).is_le();
                if self.front(sample).is_none_or(before) {
                    stencil.mark(sample);
                }
            });
            stencil.tested += visited.tested;
        }
        stencil
    }
}
