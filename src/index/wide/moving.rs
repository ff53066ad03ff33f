//! The structure `moving`: a tree of resting items beside a tree of moving ones.
//!
//! The still tree is a [`Wide`]. An item that moves now and then is overwritten in its leaf there
//! or goes to a vacant lane of the nearest leaf. Leaves keep the cells of space that they had at
//! the build (their homes) and outgrow them by a bounded margin. Items that move in every update,
//! and those that find no lane, are in a second [`Wide`], whose leaves belong to regions: groups of
//! neighbouring homes, smaller where there are more movers. So bounds stay small over any number of
//! updates.

use std::collections::BTreeSet;
use std::iter::repeat_n;
use std::ops::ControlFlow;

use glam::Vec3;

use super::{Wide, WideParams};
use crate::geometry::{Aabb, BallBlocks, BoxBlock, LANES};
use crate::index::items::{ABSENT, Dirty, Positions};
use crate::index::{BuildError, Info, Input, Kind, MemoryUsage, RegionIndex};
use crate::kernel::prefetch;
use crate::query::{Context, ItemId, QueryVolume};

/// Most items, so that positions leave a bit free.
const MOST_ITEMS: usize = 1 << 28;

/// Mark of a position among the movers.
const MOVER: usize = 1 << 31;

/// Updates without a move after which an item rests.
const SETTLED: u8 = 8;

/// Updates over which the movers of a leaf leave it, so that no update is slow.
const LEAVE_EVERY: u8 = 32;

/// Most growth of a leaf of the still tree per side, in longest edges of its home.
const GROWTH: f32 = 0.25;

/// Most growth of a region for the centres of its movers, likewise.
const REGION_GROWTH: f32 = 0.125;

/// Leaves of movers / leaves added when all are in use: few, so no update is slow.
const MORE: usize = 16;

/// Leaves of movers from which on a region is crowded.
const CROWDED: usize = 32;

/// Most moved items per region before regions are divided again.
const COARSE: usize = 256;

/// Number of the first update, so that all items count as resting before it.
const FIRST: u8 = 2 * SETTLED;

/// A tree of resting items and a tree of moving ones; items may come and go.
#[derive(Default)]
pub struct Moving {
    pub(super) still: Wide,
    pub(super) movers: Wide,
    /// The blocks above the leaves of `still` as they were built.
    homes: Vec<BoxBlock>,
    regions: Vec<Region>,
    /// Region of each leaf of `still`; at least one.
    region_of: Vec<u32>,
    /// Smallest span of a region, in leaves.
    finest: usize,
    /// Leaves of `movers`.
    leaves: Vec<MoverLeaf>,
    free_leaves: BTreeSet<u32>,
    /// Position in `still`, or in `movers` and marked [`MOVER`].
    positions: Positions,
    /// Number of the last update that moved each item.
    moved: Vec<u8>,
    /// Total of leaves of movers beyond [`CROWDED`] per region.
    crowded: usize,
    /// Number of the current update.
    now: u8,
    /// The leaf of movers that is checked next.
    next: usize,
    changed: Dirty,
    /// Leaves of `still` that items have left.
    left: Dirty,
}

/// A range of neighbouring leaves of the still tree.
///
/// Its movers fill leaf after leaf; just one leaf unless its span is the finest.
#[derive(Clone, Copy)]
struct Region {
    /// Bounds of the centres of movers that stay in the region.
    cell: Aabb,
    /// Its first leaf in the still tree, a multiple of `span`.
    first: usize,
    /// Number of its leaves in the still tree, a power of two.
    span: usize,
    movers: usize,
    /// Leaf of the last mover.
    last: usize,
}

/// A leaf of movers.
#[derive(Clone, Copy, Default)]
struct MoverLeaf {
    region: u32,
    /// The leaf of this region that was filled before this one.
    before: u32,
}

/// A box enlarged on each side by a multiple of its longest edge.
#[inline(always)]
fn grown(b: Aabb, by: f32) -> Aabb {
    let margin = Vec3::splat(b.extent().max_element() * by);
    Aabb::new(b.min - margin, b.max + margin)
}

impl Moving {
    /// Builds the still tree alone; the first update prepares the rest.
    pub(super) fn resting(input: &Input<'_>, params: &WideParams) -> Result<Self, BuildError> {
        let count = input.items.len();
        if count > MOST_ITEMS {
            let most = MOST_ITEMS;
            return Err(BuildError::TooManyItems { count, most });
        }
        Ok(Moving {
            still: Wide::build(input, params)?,
            ..Moving::default()
        })
    }

    /// Prepares homes and regions, once, and positions for `items` items.
    fn prepare(&mut self, items: usize) {
        self.positions.prepare(self.still.ids.iter(), items);
        self.moved.resize(items.max(self.moved.len()), SETTLED);
        if self.regions.is_empty() {
            let leaves = self.still.occupied.len();
            self.homes = self.still.blocks[leaves..].to_vec();
            self.region_of = vec![0; leaves.max(1)];
            self.now = FIRST;
            self.divide(items / 100);
        }
    }

    /// Divides the still tree into regions of six to eleven movers, `movers` in all.
    ///
    /// The leaves of movers are in spatial order, with room for 8 or 32 times as many regions.
    fn divide(&mut self, movers: usize) {
        let leaves = self.region_of.len();
        let span = (6 * leaves / movers.max(1)).max(1).next_power_of_two();
        // In small trees empty leaves cost more than spatial order gains.
        let parts = if leaves < 1024 { 8 } else { 32 };
        self.finest = (span / parts).max(1);
        let first_free = leaves.div_ceil(self.finest);
        // Leaves added later are in spatial order only among themselves.
        let count = 2 * first_free + 1;
        let mut new = Wide::unfilled(&vec![ABSENT; count * LANES]);
        let balls = || BallBlocks::of(repeat_n(Aabb::EMPTY, count * LANES));
        new.balls = self.still.balls.is_some().then(balls);
        let before = std::mem::replace(&mut self.movers, new);
        self.changed = self.movers.untouched();
        self.regions.clear();
        self.leaves = vec![MoverLeaf::default(); count];
        self.free_leaves = (first_free as u32..count as u32).collect();
        (self.crowded, self.next) = (0, 0);
        for first in (0..leaves).step_by(span) {
            self.add_region(first, span);
        }
        for (at, &id) in before.ids.iter().enumerate() {
            if id != ABSENT {
                let bounds = before.blocks[at / LANES].get(at % LANES);
                self.add(self.leaf_for(&bounds), id, &bounds);
            }
        }
    }

    /// Adds a region without movers; returns its index.
    fn add_region(&mut self, first: usize, span: usize) -> usize {
        let (region, last) = (self.regions.len(), first / self.finest);
        let end = self.region_of.len().min(first + span);
        self.region_of[first..end].fill(region as u32);
        self.leaves[last].region = region as u32;
        self.regions.push(Region {
            cell: grown(self.home(first, span), REGION_GROWTH),
            first,
            span,
            movers: 0,
            last,
        });
        region
    }

    /// Bounds of `span` leaves of the still tree at the build.
    ///
    /// `span` is a power of two. All of space for the whole tree.
    #[inline(always)]
    fn home(&self, first: usize, span: usize) -> Aabb {
        if span >= self.region_of.len() {
            return Aabb::new(Aabb::EMPTY.max, Aabb::EMPTY.min);
        }
        let level = (span.ilog2() / LANES.ilog2()) as usize;
        let below = LANES.pow(level as u32);
        let (lane, lanes) = (first / below, span / below);
        let block = &self.homes[self.first_home(level + 1) + lane / LANES];
        let lanes = (lane..lane + lanes).map(|lane| block.get(lane % LANES));
        lanes.fold(Aabb::EMPTY, |all, b| all.union(&b))
    }

    /// Index of the first of the [homes](Self::homes) on a level.
    #[inline(always)]
    fn first_home(&self, level: usize) -> usize {
        self.still.levels[level].first - self.still.levels[0].blocks
    }

    /// The leaf of the still tree whose home is nearest to the centre of a box.
    fn leaf_for(&self, bounds: &Aabb) -> usize {
        let centre = bounds.centre();
        let mut at = 0;
        for level in (1..self.still.levels.len()).rev() {
            at = at * LANES + self.homes[self.first_home(level) + at].nearest(centre);
        }
        at.min(self.region_of.len() - 1)
    }

    /// Takes over the new bounds of an item.
    fn update(&mut self, id: ItemId, bounds: &Aabb) {
        let moved = std::mem::replace(&mut self.moved[id as usize], self.now);
        let rested = self.now.wrapping_sub(moved) >= SETTLED;
        let mut near = None;
        match self.positions.of(id) {
            Some(at) if at & MOVER != 0 => {
                let (at, leaf) = (at & !MOVER, (at & !MOVER) / LANES);
                let region = self.leaves[leaf].region;
                let cell = &self.regions[region as usize].cell;
                near = (!cell.contains_point(bounds.centre())).then(|| self.leaf_for(bounds));
                let stays = near.is_none_or(|near| self.region_of[near] == region);
                if stays && !bounds.is_empty() {
                    self.movers.set(at, bounds);
                    self.changed.mark(leaf);
                    return;
                }
                self.remove(at);
            }
            Some(at) => {
                let leaf = at / LANES;
                let turn = (id as u8).wrapping_add(self.now);
                let leaves = !rested && turn.is_multiple_of(LEAVE_EVERY);
                if !leaves && !bounds.is_empty() && self.fits(leaf, bounds) {
                    self.still.set(at, bounds);
                    self.still.grow(leaf, bounds);
                    return;
                }
                self.still.put(at, ABSENT, &Aabb::EMPTY);
                self.left.mark(leaf);
            }
            None => {}
        }
        self.positions.set(id, ABSENT);
        if !bounds.is_empty() {
            let near = near.unwrap_or_else(|| self.leaf_for(bounds));
            if !(rested && self.rest(near, id, bounds)) {
                self.add(near, id, bounds);
            }
        }
    }

    /// Returns whether a leaf of the still tree may hold a box.
    #[inline(always)]
    fn fits(&self, leaf: usize, bounds: &Aabb) -> bool {
        grown(self.home(leaf, 1), GROWTH).contains(bounds)
    }

    /// Puts an item into the nearest leaf of the still tree, or one beside it.
    ///
    /// False if no leaf that may hold the item has a vacant lane.
    fn rest(&mut self, near: usize, id: ItemId, bounds: &Aabb) -> bool {
        let first = near - near % LANES;
        let beside = first..self.region_of.len().min(first + LANES);
        for leaf in std::iter::once(near).chain(beside) {
            if !self.fits(leaf, bounds) {
                continue;
            }
            let lanes = self.still.occupied.get(leaf).copied();
            let lane = lanes.map_or(LANES, |lanes| lanes.trailing_ones() as usize);
            let at = leaf * LANES + lane;
            if lane < LANES && at < self.still.ids.len() {
                self.still.put(at, id, bounds);
                self.still.grow(leaf, bounds);
                self.positions.set(id, at as u32);
                return true;
            }
        }
        false
    }

    /// Adds a mover to the region of a leaf of the still tree.
    fn add(&mut self, near: usize, id: ItemId, bounds: &Aabb) {
        let mut region = self.region_of[near] as usize;
        while self.regions[region].movers == LANES && self.regions[region].span > self.finest {
            self.split(region);
            region = self.region_of[near] as usize;
        }
        self.append(region, id, bounds);
    }

    /// Adds a mover after the last one of a region.
    fn append(&mut self, region: usize, id: ItemId, bounds: &Aabb) {
        let movers = self.regions[region].movers;
        if movers > 0 && movers.is_multiple_of(LANES) {
            let leaf = self.free_leaf(region);
            let before = std::mem::replace(&mut self.regions[region].last, leaf) as u32;
            let region = region as u32;
            self.leaves[leaf] = MoverLeaf { region, before };
            self.crowded += usize::from(movers / LANES >= CROWDED);
        }
        self.regions[region].movers += 1;
        let at = self.regions[region].last * LANES + movers % LANES;
        self.put(at, id, bounds);
    }

    /// Halves a region that has a single leaf of movers.
    fn split(&mut self, region: usize) {
        let own = self.regions[region];
        let (first, last, half) = (own.first, own.last, own.span / 2);
        self.regions[region].span = half;
        self.regions[region].cell = grown(self.home(first, half), REGION_GROWTH);
        if first + half >= self.region_of.len() {
            return;
        }
        let upper = self.add_region(first + half, half);
        // Backwards, because the last mover takes the place of a removed one.
        for at in (last * LANES..(last + 1) * LANES).rev() {
            let bounds = self.movers.blocks[last].get(at % LANES);
            if self.region_of[self.leaf_for(&bounds)] as usize == upper {
                let id = self.movers.ids[at];
                self.remove(at);
                self.append(upper, id, &bounds);
            }
        }
    }

    /// Removes the mover at a position; the last one of its region takes its place.
    fn remove(&mut self, position: usize) {
        let region = &mut self.regions[self.leaves[position / LANES].region as usize];
        region.movers -= 1;
        let (left, leaf) = (region.movers, region.last);
        let last = leaf * LANES + left % LANES;
        if left > 0 && left.is_multiple_of(LANES) {
            region.last = self.leaves[leaf].before as usize;
            self.free_leaves.insert(leaf as u32);
            self.crowded -= usize::from(left / LANES >= CROWDED);
        }
        if last != position {
            let bounds = self.movers.blocks[leaf].get(last % LANES);
            self.put(position, self.movers.ids[last], &bounds);
        }
        self.movers.put(last, ABSENT, &Aabb::EMPTY);
        self.changed.mark(leaf);
    }

    /// Sets the mover at a position.
    fn put(&mut self, position: usize, id: ItemId, bounds: &Aabb) {
        self.movers.put(position, id, bounds);
        self.positions.set(id, (MOVER | position) as u32);
        self.changed.mark(position / LANES);
    }

    /// A free leaf of movers; adds leaves if all are in use.
    ///
    /// Leaves that are added are in spatial order too, so that those of a region are neighbours.
    fn free_leaf(&mut self, region: usize) -> usize {
        if self.free_leaves.is_empty() {
            let count = self.leaves.len();
            let more = count + count.div_ceil(MORE);
            self.movers.lengthen(more);
            self.changed.lengthen(more);
            self.leaves.resize(more, MoverLeaf::default());
            self.free_leaves.extend(count as u32..more as u32);
        }
        let regular = self.region_of.len().div_ceil(self.finest);
        let own = self.regions[region].first / self.finest;
        let wanted = (regular + own * (self.leaves.len() - regular) / regular) as u32;
        let behind = self.free_leaves.range(wanted..).next();
        let nearest = behind.or_else(|| self.free_leaves.last()).copied();
        let leaf = nearest.unwrap_or_default();
        self.free_leaves.remove(&leaf);
        leaf as usize
    }

    /// Returns resting movers of a few leaves to the still tree.
    fn settle_movers(&mut self, moved: usize) {
        for _ in 0..(moved / 256 + 1).min(self.leaves.len()) {
            let leaf = self.next;
            self.next = (leaf + 1) % self.leaves.len();
            for at in (leaf * LANES..(leaf + 1) * LANES).rev() {
                let id = self.movers.ids[at];
                if id != ABSENT && self.now.wrapping_sub(self.moved[id as usize]) >= SETTLED {
                    let bounds = self.movers.blocks[leaf].get(at % LANES);
                    if self.rest(self.leaf_for(&bounds), id, &bounds) {
                        self.remove(at);
                    }
                }
            }
        }
    }
}

impl RegionIndex for Moving {
    const INFO: Info = Info::ours(
        "moving",
        "two wide trees: of what rests, and of what moves by regions of the first",
        Kind::Tree,
    )
    .refits()
    .threaded_build()
    .for_motion();
    type Params = WideParams;

    /// O(n log n), that of [`Wide`].
    fn build(input: &Input<'_>, params: &WideParams) -> Result<Self, BuildError> {
        // No reserved lanes: items that appear go to vacant lanes or to the second tree.
        let mut trees = Moving::resting(&input.come_and_go(false), params)?;
        trees.prepare(input.items.len());
        Ok(trees)
    }

    fn memory(&self) -> MemoryUsage {
        let [still, movers] = [&self.still, &self.movers].map(Wide::memory);
        MemoryUsage {
            node_bytes: still.node_bytes
                + movers.node_bytes
                + size_of_val(&self.homes[..])
                + size_of_val(&self.regions[..])
                + size_of_val(&self.region_of[..])
                + size_of_val(&self.leaves[..])
                + self.free_leaves.len() * size_of::<u32>(),
            item_bytes: still.item_bytes
                + movers.item_bytes
                + self.positions.bytes()
                + self.moved.len(),
        }
    }

    #[inline(always)]
    fn query<Q: QueryVolume, C: Context>(&self, volume: &Q, cx: &mut C) -> ControlFlow<()> {
        for tree in [&self.still, &self.movers] {
            if Q::IS_POINT || tree.vacant < tree.ids.len() {
                tree.query(volume, cx)?;
            }
        }
        ControlFlow::Continue(())
    }

    /// O(moved). Items may become or cease to be empty.
    ///
    /// A rebuild is needed if most items have gathered in a few places.
    fn refit(&mut self, items: &[Aabb], moved: &[ItemId]) -> bool {
        if self.crowded * LANES > items.len() / 8 || items.len() > MOST_ITEMS {
            return false;
        }
        self.prepare(items.len());
        (self.changed, self.left) = (self.movers.untouched(), self.still.untouched());
        let regions = self.regions.len();
        if moved.len() > COARSE * regions && regions < self.region_of.len() {
            self.divide(moved.len());
        }
        self.now = self.now.wrapping_add(1);
        for (i, &id) in moved.iter().enumerate() {
            match self.positions.ahead(items, moved, i) {
                Some(at) if at & MOVER != 0 => {
                    self.movers.blocks[(at & !MOVER) / LANES].prefetch();
                    prefetch(&self.leaves[(at & !MOVER) / LANES]);
                }
                Some(at) => {
                    self.still.blocks[at / LANES].prefetch();
                    let parent = at / LANES / LANES;
                    let above = self.still.blocks.get(self.still.occupied.len() + parent);
                    let blocks = [self.homes.get(parent), above];
                    blocks.into_iter().flatten().for_each(BoxBlock::prefetch);
                }
                None => {}
            }
            self.update(id, &items[id as usize]);
        }
        self.settle_movers(moved.len());
        self.still.fit_above(std::mem::take(&mut self.left));
        self.movers.fit_above(std::mem::take(&mut self.changed));
        true
    }
}

#[cfg(test)]
mod tests;
