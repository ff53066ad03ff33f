//! The z-test: the nearest fragment of each sample, by the exact order of depths.

use super::canvas::{Canvas, Fragment};
use crate::query::ItemId;
use crate::visibility::truth::{Along, NO_ITEM, Probe};

/// What is in front at each sample so far; of a tie the lowest id.
#[derive(Clone, Debug)]
pub struct DepthBuffer<P: Along = Probe> {
    front: Vec<Option<(P::At, ItemId)>>,
    /// Fragments that were as near as the one in front, and lost by their id.
    ties: Vec<Fragment<P::At>>,
}

impl<P: Along> DepthBuffer<P> {
    /// A buffer in which nothing is drawn yet.
    pub fn new(samples: usize) -> DepthBuffer<P> {
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

    /// Whether the fragment is drawn: there is nothing at its sample, or what is
    /// there is deeper, or as deep with a higher id. If so it is there from now on.
    #[inline]
    pub fn test(&mut self, canvas: &Canvas<P>, fragment: &Fragment<P::At>) -> bool {
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
                self.ties.push(Fragment {
                    sample,
                    item: lost,
                    at,
                });
                if lost == item {
                    return false;
                }
            }
        }
        *front = Some((at, item));
        true
    }

    /// What is in front at a sample.
    #[inline]
    pub fn front(&self, sample: usize) -> Option<(P::At, ItemId)> {
        self.front[sample]
    }

    /// The id buffer: the item in front at each sample, [`NO_ITEM`] for none.
    pub fn ids(&self) -> Vec<ItemId> {
        let id = |front: &Option<(P::At, ItemId)>| front.map_or(NO_ITEM, |front| front.1);
        self.front.iter().map(id).collect()
    }

    /// How many samples have been drawn on.
    pub fn covered(&self) -> u64 {
        self.front.iter().filter(|front| front.is_some()).count() as u64
    }

    /// The exact visible set of the samples, ascending: all that is in front
    /// anywhere, every item of a tie.
    pub fn visible(&self, canvas: &Canvas<P>) -> Vec<ItemId> {
        let in_front = |tie: &&Fragment<P::At>| {
            let front = self.front[tie.sample];
            let order = |front: (P::At, _)| canvas.probe(tie.sample).order(&tie.at, &front.0);
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
