//! The structure `moving`: a tree of what rests beside a tree of what moves.
//!
//! The still tree is a [`Wide`]. An item that moves leaves its lane there vacant, and no
//! bounds change. Movers are in a second [`Wide`], each leaf of which belongs to one
//! region: the 256 lanes below a block of level 1 of the still tree. A mover is
//! overwritten in place within the bounds that its region had at the build, and goes
//! to a leaf of another region beyond. So bounds do not grow, however many updates come.
//!
//! Movers that rest return: each update rebuilds a few regions of the still tree.

use std::ops::ControlFlow;

use super::block_order::{BlockOrder, block_ordered};
use super::{SCRATCH, Wide, WideParams};
use crate::geometry::{Aabb, LANES};
use crate::index::frontier::{put_back, take};
use crate::index::items::{ABSENT, Dirty, Positions};
use crate::index::{BuildError, Info, Input, Kind, MemoryUsage, Origin, RegionIndex};
use crate::kernel::prefetch;
use crate::query::{Context, ItemId, QueryVolume};

/// Most items, so that positions leave a bit free.
const MOST_ITEMS: usize = 1 << 28;

/// Mark of a position among the movers.
const MOVER: usize = 1 << 31;

/// Lanes of a region of the still tree.
const REGION: usize = LANES * LANES;

/// Updates without a move after which an item rests.
const REST: u8 = 8;

/// Fewest resting movers that a region is rebuilt for, unless all of them rest.
const WORTH_REBUILD: usize = LANES;

/// Leaves of movers from which on a region is crowded: it holds twice its items.
const CROWDED: usize = 2 * REGION / LANES;

/// A tree of resting items and a tree of moving ones; items may come and go.
#[derive(Default)]
pub struct Moving {
    pub(super) still: Wide,
    pub(super) movers: Wide,
    /// Blocks of level 1 of the still tree, at least one after the first update.
    regions: Vec<Region>,
    /// Leaves of `movers`. Leaf `r` is the first one of region `r`.
    leaves: Vec<MoverLeaf>,
    free_leaves: Vec<u32>,
    /// Position in `still`, or in `movers` and marked [`MOVER`].
    positions: Positions,
    /// Leaves of movers beyond [`CROWDED`] of their region.
    crowded: usize,
    /// Number of the update.
    now: u8,
    /// The region that is looked at next.
    next: usize,
    changed_still: Dirty,
    changed_movers: Dirty,
}

/// A region: its movers fill leaf after leaf.
struct Region {
    /// Bounds at the build.
    home: Aabb,
    movers: u32,
    /// Leaf of the last mover.
    last: u32,
}

/// A leaf of movers.
#[derive(Clone, Copy, Default)]
struct MoverLeaf {
    region: u32,
    /// The leaf of this region that was filled before.
    before: u32,
    /// Number of the update that moved each lane.
    moved: [u8; LANES],
}

impl Moving {
    /// Makes regions and positions, at the first update.
    fn prepare(&mut self, items: usize) {
        self.positions.prepare(&self.still.ids, items);
        if self.regions.is_empty() {
            let all = Aabb::new(Aabb::EMPTY.max, Aabb::EMPTY.min);
            let home = |region: usize| match self.still.levels.get(2) {
                Some(level) => self.still.blocks[level.first + region / LANES].get(region % LANES),
                None => all,
            };
            let count = self.still.levels.get(1).map_or(1, |level| level.blocks);
            let regions = (0..count).map(|region| Region {
                home: home(region),
                movers: 0,
                last: region as u32,
            });
            self.regions = regions.collect();
            let leaf = |region: usize| MoverLeaf {
                region: region as u32,
                ..MoverLeaf::default()
            };
            self.leaves = (0..count).map(leaf).collect();
            self.movers = Wide::unfilled(&vec![ABSENT; count * LANES]);
        }
        self.changed_still = self.still.untouched();
        self.changed_movers = self.movers.untouched();
    }

    /// The region that takes a box in: `near` if the centre lies in its home.
    fn region_for(&self, near: usize, bounds: &Aabb) -> usize {
        let centre = bounds.centre();
        if self.regions[near].home.contains_point(centre) {
            return near;
        }
        let mut region = 0;
        for level in self.still.levels.iter().skip(2).rev() {
            let block = &self.still.blocks[level.first + region];
            region = region * LANES + block.nearest(centre);
        }
        region.min(self.regions.len() - 1)
    }

    /// Takes over the new bounds of an item.
    fn update(&mut self, id: ItemId, bounds: &Aabb) {
        let at = self.positions.of(id);
        let near = match at {
            Some(at) if at & MOVER != 0 => self.leaves[(at & !MOVER) / LANES].region as usize,
            Some(at) => at / REGION,
            None => 0,
        };
        let region = (!bounds.is_empty()).then(|| self.region_for(near, bounds));
        match at {
            Some(at) if at & MOVER != 0 => {
                let (leaf, lane) = ((at & !MOVER) / LANES, at % LANES);
                if region == Some(near) {
                    self.movers.blocks[leaf].set(lane, bounds);
                    self.leaves[leaf].moved[lane] = self.now;
                    self.changed_movers.mark(leaf);
                    return;
                }
                self.remove(at & !MOVER);
            }
            // The box may stay: nothing reads a vacant lane.
            Some(at) => {
                self.still.ids.set(at, ABSENT);
                self.still.occupied[at / LANES] &= !(1 << (at % LANES));
                self.still.vacant += 1;
            }
            None => {}
        }
        self.positions.set(id, ABSENT);
        if let Some(region) = region {
            self.add(region, id, bounds);
        }
    }

    /// Adds a mover to a region.
    fn add(&mut self, region: usize, id: ItemId, bounds: &Aabb) {
        let movers = self.regions[region].movers as usize;
        let lane = movers % LANES;
        if lane == 0 && movers > 0 {
            let leaf = self.free_leaf();
            let before = std::mem::replace(&mut self.regions[region].last, leaf as u32);
            let region = region as u32;
            self.leaves[leaf] = MoverLeaf {
                region,
                before,
                ..MoverLeaf::default()
            };
            self.crowded += usize::from(movers / LANES >= CROWDED);
        }
        self.regions[region].movers += 1;
        let leaf = self.regions[region].last as usize;
        self.put(leaf * LANES + lane, id, bounds, self.now);
    }

    /// Removes the mover at a position; the last one of its region takes its place.
    fn remove(&mut self, position: usize) {
        let region = &mut self.regions[self.leaves[position / LANES].region as usize];
        region.movers -= 1;
        let (left, leaf) = (region.movers as usize, region.last as usize);
        let last = leaf * LANES + left % LANES;
        if left > 0 && left.is_multiple_of(LANES) {
            region.last = self.leaves[leaf].before;
            self.free_leaves.push(leaf as u32);
            self.crowded -= usize::from(left / LANES >= CROWDED);
        }
        if last != position {
            let bounds = self.movers.blocks[leaf].get(last % LANES);
            let moved = self.leaves[leaf].moved[last % LANES];
            self.put(position, self.movers.ids[last], &bounds, moved);
        }
        self.movers.put(last, ABSENT, &Aabb::EMPTY);
        self.changed_movers.mark(leaf);
    }

    /// Sets the mover at a position, last moved by an update.
    fn put(&mut self, position: usize, id: ItemId, bounds: &Aabb, moved: u8) {
        let (leaf, lane) = (position / LANES, position % LANES);
        self.movers.put(position, id, bounds);
        self.positions.set(id, (MOVER | position) as u32);
        self.leaves[leaf].moved[lane] = moved;
        self.changed_movers.mark(leaf);
    }

    /// A leaf of movers that no region uses; twice as many leaves if there is none.
    fn free_leaf(&mut self) -> usize {
        if self.free_leaves.is_empty() {
            let count = self.leaves.len();
            let mut ids = self.movers.ids.to_vec();
            ids.resize(2 * ids.len(), ABSENT);
            let smaller = std::mem::replace(&mut self.movers, Wide::unfilled(&ids));
            self.movers.blocks[..count].copy_from_slice(&smaller.blocks[..count]);
            self.leaves.resize(2 * count, MoverLeaf::default());
            self.free_leaves
                .extend((count as u32..2 * count as u32).rev());
            self.changed_movers = self.movers.untouched();
            (0..count).for_each(|leaf| _ = self.changed_movers.mark(leaf));
        }
        self.free_leaves.pop().map_or(0, |leaf| leaf as usize)
    }

    /// Returns resting movers to the still tree, in a few regions: a rebuilt one for
    /// every 512 moved items, so that it costs less than they do.
    fn settle(&mut self, items: &[Aabb], moved: usize) {
        let mut rebuilds = moved / 512 + 1;
        for _ in 0..(moved / 64 + 16).min(self.regions.len()) {
            let region = self.next;
            self.next = (region + 1) % self.regions.len();
            rebuilds -= usize::from(self.rebuild(region, items));
            if rebuilds == 0 {
                return;
            }
        }
    }

    /// Rebuilds a region with its movers that rest; false if it is not worth it.
    fn rebuild(&mut self, region: usize, items: &[Aabb]) -> bool {
        let places = region * REGION..self.still.ids.len().min((region + 1) * REGION);
        let movers = self.regions[region].movers as usize;
        let mut resting = Vec::new();
        let mut leaf = self.regions[region].last as usize;
        for first in (0..movers).step_by(LANES).rev() {
            for lane in 0..LANES.min(movers - first) {
                if self.now.wrapping_sub(self.leaves[leaf].moved[lane]) >= REST {
                    resting.push(self.movers.ids[leaf * LANES + lane]);
                }
            }
            leaf = self.leaves[leaf].before as usize;
        }
        let is_worth = |resting: usize| resting > 0 && resting >= movers.min(WORTH_REBUILD);
        if !is_worth(resting.len()) {
            return false;
        }
        let here = self.still.ids.get(places.clone()).unwrap_or_default();
        let mut ids: Vec<ItemId> = here.iter().copied().filter(|&id| id != ABSENT).collect();
        resting.truncate(here.len() - ids.len());
        if !is_worth(resting.len()) {
            return false;
        }
        for &id in &resting {
            if let Some(at) = self.positions.of(id) {
                self.remove(at & !MOVER);
            }
        }
        ids.append(&mut resting);
        let ids = block_ordered(items, ids, BlockOrder::Median, 1);
        for (i, position) in places.enumerate() {
            match ids.get(i) {
                Some(&id) => {
                    self.still.put(position, id, &items[id as usize]);
                    self.positions.set(id, position as u32);
                }
                None => self.still.put(position, ABSENT, &Aabb::EMPTY),
            }
            self.changed_still.mark(position / LANES);
        }
        true
    }
}

impl RegionIndex for Moving {
    const INFO: Info = Info::new(
        "moving",
        "two wide trees: of what rests, and of what moves by regions of the first",
        Kind::Tree,
        Origin::Ours,
    )
    .refits()
    .threaded_build();
    type Params = WideParams;

    /// O(n log n), that of [`Wide`].
    fn build(input: &Input<'_>, params: &WideParams) -> Result<Self, BuildError> {
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

    fn memory(&self) -> MemoryUsage {
        let [still, movers] = [&self.still, &self.movers].map(Wide::memory);
        MemoryUsage {
            node_bytes: still.node_bytes
                + movers.node_bytes
                + size_of_val(&self.regions[..])
                + size_of_val(&self.leaves[..])
                + size_of_val(&self.free_leaves[..]),
            item_bytes: still.item_bytes + movers.item_bytes + self.positions.bytes(),
        }
    }

    #[inline(always)]
    fn query<Q: QueryVolume, C: Context>(&self, volume: &Q, cx: &mut C) -> ControlFlow<()> {
        if Q::IS_POINT {
            self.still.query(volume, cx)?;
            return self.movers.query(volume, cx);
        }
        let mut scratch = take(&SCRATCH);
        let mut flow = ControlFlow::Continue(());
        for tree in [&self.still, &self.movers] {
            if flow.is_continue() && tree.vacant < tree.ids.len() {
                flow = tree.search(volume, cx, &mut scratch);
            }
        }
        put_back(&SCRATCH, scratch);
        flow
    }

    /// O(moved). Items may become or cease to be empty. A rebuild is needed where most
    /// items have gathered in a few regions.
    fn refit(&mut self, items: &[Aabb], moved: &[ItemId]) -> bool {
        if self.crowded * LANES > items.len() / 8 || items.len() > MOST_ITEMS {
            return false;
        }
        self.prepare(items.len());
        self.still.balls = None;
        self.now = self.now.wrapping_add(1);
        for (i, &id) in moved.iter().enumerate() {
            match self.positions.ahead(items, moved, i) {
                Some(at) if at & MOVER != 0 => {
                    self.movers.blocks[(at & !MOVER) / LANES].prefetch();
                    prefetch(&self.leaves[(at & !MOVER) / LANES]);
                }
                Some(at) => prefetch(&self.still.ids[at]),
                None => {}
            }
            self.update(id, &items[id as usize]);
        }
        self.settle(items, moved.len());
        self.still
            .fit_above(std::mem::take(&mut self.changed_still));
        self.movers
            .fit_above(std::mem::take(&mut self.changed_movers));
        true
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::{ConvexVolume, Plane};
    use crate::index::Query;
    use crate::kernel::Kernel;
    use crate::query::NoRecorder;
    use glam::Vec3;
    use rand::{Rng, SeedableRng};
    use rand_pcg::Pcg64;

    const WORLD: u32 = 64;

    /// An empty item; its bounds are finite, as those of all items.
    const GONE: Aabb = Aabb::new(Vec3::ONE, Vec3::ZERO);

    fn point(rng: &mut Pcg64) -> Vec3 {
        let mut x = || (rng.next_u32() % (16 * WORLD)) as f32 / 16.0;
        Vec3::new(x(), x(), x())
    }

    fn cubes(rng: &mut Pcg64, count: usize) -> Vec<Aabb> {
        let cube = |_| Aabb::around(point(rng), Vec3::splat(0.7));
        (0..count).map(cube).collect()
    }

    /// Compares the answers of all kernels with a scan, and the lanes with the items.
    fn assert_right(index: &Moving, items: &[Aabb], rng: &mut Pcg64) {
        fn ask(index: &Moving, volume: &impl QueryVolume, kernel: Kernel) -> Vec<ItemId> {
            let (sink, recorder) = (&mut Vec::new(), &mut NoRecorder);
            let _ = kernel.run(Query {
                index,
                volume,
                sink,
                recorder,
            });
            sink.sort_unstable();
            std::mem::take(sink)
        }
        fn seen(items: &[Aabb], sees: impl Fn(&Aabb) -> bool) -> Vec<ItemId> {
            let seen = items.iter().zip(0..).filter(|(b, _)| sees(b));
            seen.map(|(_, id)| id).collect()
        }
        let corner = point(rng);
        let wedge = [
            Plane::new(Vec3::new(0.8, 0.1, -0.3), 0.0),
            Plane::new(Vec3::new(-0.2, 0.9, 0.4), 0.0),
            Plane::new(-Vec3::Z, corner.z),
        ];
        let wedge = wedge.map(|p| Plane::new(p.normal, p.d - p.normal.dot(corner)));
        let volumes = [&wedge[..], &wedge[..1], &[]].map(ConvexVolume::from_planes);
        for kernel in Kernel::available() {
            for volume in volumes.iter().flatten() {
                let scan = seen(items, |b| !b.is_empty() && volume.sees(b));
                assert_eq!(ask(index, volume, kernel), scan, "{kernel}");
            }
            let p = items[rng.next_u32() as usize % items.len()].min;
            let scan = seen(items, |b| b.contains_point(p));
            assert_eq!(ask(index, &p, kernel), scan, "{kernel} at {p}");
        }
        for tree in [&index.still, &index.movers] {
            let held = tree.ids.iter().filter(|&&id| id != ABSENT).count();
            assert_eq!(tree.ids.len() - tree.vacant, held);
        }
        let movers: u32 = index.regions.iter().map(|r| r.movers).sum();
        let held = index.movers.ids.len() - index.movers.vacant;
        assert_eq!(movers as usize, held);
    }

    #[test]
    fn answers_are_those_of_a_scan_whatever_moves_comes_and_goes() {
        let mut rng = Pcg64::seed_from_u64(7);
        for count in [0, 1, 20, 300, 3000] {
            let mut items = cubes(&mut rng, count + 40);
            // Some are there only later.
            items[count..].fill(GONE);
            let mut index = Moving::build(&Input::new(&items), &Default::default()).unwrap();
            for round in 0..60u32 {
                let share = [3, 40, 1, 300][round as usize / 15];
                let some = |_| rng.next_u32() % items.len() as u32;
                let moved: Vec<ItemId> = (0..items.len() / share).map(some).collect();
                for &id in &moved {
                    let b = &mut items[id as usize];
                    *b = match rng.next_u32() % 8 {
                        0 => GONE,
                        1 | 2 => Aabb::around(point(&mut rng), Vec3::splat(0.7)),
                        _ if b.is_empty() => Aabb::around(Vec3::splat(9.0), Vec3::ONE),
                        _ => Aabb::new(b.min + 0.5, b.max + 0.5),
                    };
                }
                if !index.refit(&items, &moved) {
                    index = Moving::build(&Input::new(&items), &Default::default()).unwrap();
                }
                assert_right(&index, &items, &mut rng);
            }
        }
    }

    #[test]
    fn movers_that_rest_return_to_the_still_tree() {
        let mut rng = Pcg64::seed_from_u64(8);
        let mut items = cubes(&mut rng, 5000);
        let mut index = Moving::build(&Input::new(&items), &Default::default()).unwrap();
        let all: Vec<ItemId> = (0..5000).collect();
        for b in &mut items {
            *b = Aabb::new(b.min + 0.1, b.max + 0.1);
        }
        assert!(index.refit(&items, &all));
        assert_eq!(index.still.vacant, index.still.ids.len());
        for _ in 0..64 {
            assert!(index.refit(&items, &[17]));
        }
        let movers = index.movers.ids.len() - index.movers.vacant;
        assert!(movers < 500, "{movers} movers");
        assert_right(&index, &items, &mut rng);
    }

    #[test]
    fn a_crowd_in_one_place_needs_a_rebuild() {
        let mut rng = Pcg64::seed_from_u64(9);
        let mut items = cubes(&mut rng, 5000);
        let mut index = Moving::build(&Input::new(&items), &Default::default()).unwrap();
        let all: Vec<ItemId> = (0..5000).collect();
        items.fill(Aabb::around(Vec3::splat(9.0), Vec3::ONE));
        assert!(index.refit(&items, &all));
        assert_right(&index, &items, &mut rng);
        assert!(!index.refit(&items, &all));
        assert_right(&index, &items, &mut rng);
    }
}
