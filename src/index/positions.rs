//! Positions of items in tree order, for structures that refit.

use crate::geometry::Aabb;
use crate::query::ItemId;

/// Tree position of each item, computed at the first refit.
#[derive(Default)]
pub struct Positions(Vec<u32>);

/// Position of an item that is not in the tree.
const ABSENT: u32 = u32::MAX;

impl Positions {
    /// Moved items with their positions in `order`; empty items have none. `None` if
    /// an item becomes or ceases to be empty. O(moved), the first time O(items).
    pub fn of_moved(
        &mut self,
        order: &[ItemId],
        items: &[Aabb],
        moved: &[ItemId],
    ) -> Option<Vec<(usize, Aabb)>> {
        if self.0.len() != items.len() {
            self.0 = vec![ABSENT; items.len()];
            for (&id, position) in order.iter().zip(0..) {
                self.0[id as usize] = position;
            }
        }
        let stays = |&id: &ItemId| (self.0[id as usize] == ABSENT) == items[id as usize].is_empty();
        if !moved.iter().all(stays) {
            return None;
        }
        let of = |&id: &ItemId| (self.0[id as usize] as usize, items[id as usize]);
        let present = |(_, b): &(usize, Aabb)| !b.is_empty();
        Some(moved.iter().map(of).filter(present).collect())
    }

    /// Heap bytes.
    pub fn bytes(&self) -> usize {
        size_of_val(&self.0[..])
    }
}
