//! Refit of the wide tree: lanes of moved items, then the blocks above them.

use super::Wide;
use super::levels::Level;
use crate::geometry::{Aabb, BoxBlock, LANES, LaneMask};
use crate::index::items::{ABSENT, Dirty};
use crate::query::ItemId;

impl Wide {
    /// [`RegionIndex::refit`](crate::index::RegionIndex::refit) of the wide tree.
    ///
    /// False with nothing changed if an item has no lane.
    pub(super) fn take_over(&mut self, items: &[Aabb], moved: &[ItemId]) -> bool {
        let changed = self.overwrite(items, moved);
        changed.map(|leaves| self.fit_above(leaves)).is_some()
    }

    /// Overwrites the leaves alone; returns those that have changed.
    pub(super) fn overwrite(&mut self, items: &[Aabb], moved: &[ItemId]) -> Option<Dirty> {
        self.positions.prepare(self.ids.iter(), items.len());
        let enters =
            |&id: &ItemId| self.positions.of(id).is_none() && !items[id as usize].is_empty();
        if items.len() > self.ids.len() && moved.iter().any(enters) {
            return None;
        }
        let mut leaves = self.untouched();
        for (i, &id) in moved.iter().enumerate() {
            if let Some(position) = self.positions.ahead(items, moved, i) {
                self.blocks[position / LANES].prefetch();
            }
            let Some(position) = self.positions.of(id) else {
                continue;
            };
            let bounds = &items[id as usize];
            if bounds.is_empty() {
                self.put(position, ABSENT, &Aabb::EMPTY);
            } else if self.vacant > 0 {
                self.put(position, id, bounds);
            } else {
                self.set(position, bounds);
            }
            leaves.mark(position / LANES);
        }
        Some(leaves)
    }

    /// Recomputes all blocks above the leaves.
    pub(super) fn fit(&mut self) {
        let mut leaves = self.untouched();
        (0..self.occupied.len()).for_each(|leaf| _ = leaves.mark(leaf));
        self.fit_above(leaves);
    }

    /// No changed leaf, for [`Wide::fit_above`].
    pub(super) fn untouched(&self) -> Dirty {
        Dirty::none(self.occupied.len())
    }

    /// Appends vacant leaves, in place if there is room.
    pub(super) fn lengthen(&mut self, leaves: usize) {
        let (held, top) = (self.ids.len(), self.top());
        (held..leaves * LANES).for_each(|_| self.ids.push(ABSENT));
        self.vacant += self.ids.len() - held;
        self.occupied.resize(leaves, 0);
        if let Some(balls) = &mut self.balls {
            balls.set(leaves * LANES - 1, &Aabb::EMPTY);
        }
        let before = std::mem::replace(&mut self.levels, Level::over(self.ids.len()));
        let blocks = self.levels.last().map_or(0, Level::end);
        self.blocks.resize(blocks, BoxBlock::EMPTY);
        // Highest first: each level moves towards the end, over those above it.
        for (k, level) in self.levels.iter().enumerate().rev() {
            let mut end = level.first;
            if let Some(old) = before.get(k) {
                self.blocks.copy_within(old.first..old.end(), end);
                end += old.blocks;
            }
            self.blocks[end..level.end()].fill(BoxBlock::EMPTY);
        }
        if self.levels.len() > before.len() {
            self.blocks[blocks - 1].set(0, &top);
        }
    }

    /// Sets the item of a lane; the id [`ABSENT`] vacates the lane.
    pub(super) fn put(&mut self, position: usize, id: ItemId, bounds: &Aabb) {
        let before = self.ids[position];
        self.vacant = self.vacant + usize::from(id == ABSENT) - usize::from(before == ABSENT);
        self.ids.set(position, id);
        let (leaf, lane) = (position / LANES, position % LANES);
        self.occupied[leaf] =
            self.occupied[leaf] & !(1 << lane) | LaneMask::from(id != ABSENT) << lane;
        self.set(position, bounds);
    }

    /// Sets the bounds of a lane of a leaf, and its sphere.
    #[inline(always)]
    pub(super) fn set(&mut self, position: usize, bounds: &Aabb) {
        self.blocks[position / LANES].set(position % LANES, bounds);
        if let Some(balls) = &mut self.balls {
            balls.set(position, bounds);
        }
    }

    /// Enlarges the bounds above a leaf to hold a box.
    pub(super) fn grow(&mut self, mut at: usize, bounds: &Aabb) {
        for level in self.levels.iter().skip(1) {
            let block = &mut self.blocks[level.first + at / LANES];
            let held = block.get(at % LANES);
            if held.contains(bounds) {
                return;
            }
            block.set(at % LANES, &held.union(bounds));
            at /= LANES;
        }
        self.root = self.root.union(bounds);
    }

    /// Recomputes the blocks above the changed leaves.
    pub(super) fn fit_above(&mut self, mut changed: Dirty) {
        for pair in self.levels.windows(2) {
            let (here, above) = (pair[0], pair[1]);
            let (below, parents) = self.blocks.split_at_mut(above.first);
            let blocks = &below[here.first..];
            let mut changed_above = Dirty::none(above.blocks);
            for word in 0..changed.words() {
                for block in changed.of_word(word + 1) {
                    blocks[block].prefetch();
                }
                for block in changed.of_word(word) {
                    let bounds = blocks[block].union();
                    parents[block / LANES].set(block % LANES, &bounds);
                    changed_above.mark(block / LANES);
                }
            }
            changed = changed_above;
        }
        self.root = self.top();
        if let Some(balls) = &mut self.balls {
            balls.reach = self.root.reach().max_element();
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::index::{Input, RegionIndex, indexable};
    use glam::Vec3;
    use rand::{Rng, SeedableRng};

    fn cube(rng: &mut impl Rng) -> Aabb {
        let mut near = || (rng.next_u32() % 997) as f32;
        let low = Vec3::new(near(), near(), near());
        Aabb::new(low, low + Vec3::splat(near() / 50.0))
    }

    #[test]
    fn a_longer_tree_has_the_blocks_of_one_that_was_built_longer() {
        let mut rng = rand_pcg::Pcg64::seed_from_u64(4);
        for (count, leaves) in [(32_usize, 4), (250, 16), (250, 17), (5000, 400)] {
            let items: Vec<Aabb> = (0..count).map(|_| cube(&mut rng)).collect();
            let mut ids: Vec<ItemId> = (0..count as u32).collect();
            ids.resize(count.next_multiple_of(LANES), ABSENT);
            let place = |tree: &mut Wide| {
                let mut changed = tree.untouched();
                for (at, item) in items.iter().enumerate() {
                    tree.put(at, at as u32, item);
                    changed.mark(at / LANES);
                }
                tree.fit_above(changed);
            };
            let mut longer = Wide::unfilled(&vec![ABSENT; ids.len()]);
            place(&mut longer);
            longer.lengthen(leaves);
            let mut whole = Wide::unfilled(&vec![ABSENT; leaves * LANES]);
            place(&mut whole);
            assert!(longer.same_as(&whole), "{count} items, {leaves} leaves");
            assert_eq!(longer.vacant, whole.vacant);
            assert_eq!(longer.occupied, whole.occupied);
        }
    }

    #[test]
    fn blocks_are_those_of_a_fresh_build_in_the_same_order() {
        let empty = Aabb::new(Vec3::ONE, Vec3::ZERO);
        let mut rng = rand_pcg::Pcg64::seed_from_u64(3);
        for count in [1, 16, 17, 300, 5000] {
            let mut items: Vec<Aabb> = (0..count).map(|_| cube(&mut rng)).collect();
            let mut tree = Wide::build(&Input::new(&items), &Default::default()).unwrap();
            let input = Input::new(&items).spheres(true);
            let mut spheres = Wide::build(&input, &Default::default()).unwrap();
            let order = tree.ids.to_vec();
            for round in 0..12 {
                let some = |_| rng.next_u32() % count as u32;
                let moved: Vec<ItemId> = (0..1 + count / (1 + round)).map(some).collect();
                for &id in &moved {
                    let gone = round % 3 == 1 && rng.next_u32().is_multiple_of(2);
                    let moved = cube(&mut rng);
                    items[id as usize] = if gone { empty } else { moved };
                }
                assert!(tree.refit(&items, &moved));
                assert!(spheres.refit(&items, &moved));
                // Spheres that were far once no longer count.
                let reach = tree.root.reach().max_element();
                assert_eq!(spheres.balls.as_ref().unwrap().reach, reach);
                let held = indexable(&items).unwrap();
                let sound = |b: &Aabb| if b.is_empty() { Aabb::EMPTY } else { *b };
                let sound: Vec<Aabb> = items.iter().map(sound).collect();
                let fresh = Wide::over(&sound, &order, 1);
                assert!(tree.blocks == fresh.blocks, "{count} items, round {round}");
                assert_eq!(tree.root, fresh.root);
                assert_eq!(tree.ids.len() - tree.vacant, held.len());
            }
            // An item that the build did not see.
            items.push(cube(&mut rng));
            assert!(!tree.refit(&items, &[count as ItemId]));
        }
    }
}
