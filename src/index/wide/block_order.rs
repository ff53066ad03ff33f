//! Order of items for an implicit tree of blocks.
//!
//! Every run of 16^k items that starts at a multiple of 16^k is a compact group. The order
//! comes from medians on block boundaries, or from Morton codes, which build faster and
//! query slower.

use std::cmp::Ordering;

use glam::{Vec3, Vec4};
use serde::{Deserialize, Serialize};

use crate::geometry::{Aabb, LANES};
use crate::query::ItemId;
use crate::threads::{map, share};

/// Order of the items of an implicit tree.
#[derive(Clone, Copy, Default, PartialEq, Eq, Debug, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum BlockOrder {
    /// Recursive halving at the median of the widest axis.
    ///
    /// Always at a multiple of the halves' block size.
    #[default]
    Median,
    /// Sorted along the Morton curve of the centres.
    Morton,
}

/// A centre, with its id in the bits of the fourth component.
///
/// Sixteen bytes: one register.
#[derive(Clone, Copy)]
struct Point(Vec4);

impl Point {
    fn new(centre: Vec3, id: ItemId) -> Point {
        Point(centre.extend(f32::from_bits(id)))
    }

    /// The centre on one of the three axes.
    #[inline(always)]
    fn on(&self, axis: usize) -> f32 {
        self.0.to_array()[axis & 3]
    }

    fn id(&self) -> ItemId {
        self.0.w.to_bits()
    }
}

/// Ids in block order, which do not depend on the number of threads.
///
/// O(n log n). Morton codes are sorted on one thread.
pub fn block_ordered(
    items: &[Aabb],
    mut ids: Vec<ItemId>,
    order: BlockOrder,
    threads: usize,
) -> Vec<ItemId> {
    match order {
        BlockOrder::Median => by_medians(items, &mut ids, threads),
        BlockOrder::Morton => by_morton(items, &mut ids),
    }
    ids
}

/// Points to be halved until they are single units of a power of sixteen.
struct Group<'a> {
    points: &'a mut [Point],
    unit: usize,
}

impl<'a> Group<'a> {
    /// Splits into two halves at a unit boundary; `None` for a single block.
    ///
    /// On the widest axis no point of the lower half lies above one of the higher half.
    #[inline(always)]
    fn halved(mut self) -> Option<[Group<'a>; 2]> {
        while self.points.len() <= self.unit && self.unit > LANES {
            self.unit /= LANES;
        }
        let Group { points, unit } = self;
        let units = points.len().div_ceil(unit);
        if units <= 1 {
            return None;
        }
        let middle = (units / 2) * unit;
        let axis = widest_axis(points);
        points.select_nth_unstable_by(middle, |a, b| order(a.on(axis), b.on(axis)));
        let (low, high) = points.split_at_mut(middle);
        Some([low, high].map(|points| Group { points, unit }))
    }

    /// Halves it down to single blocks, depth first.
    fn put_in_order(self) {
        let mut open = vec![self];
        while let Some(group) = open.pop() {
            open.extend(group.halved().into_iter().flatten());
        }
    }
}

/// Fewer points than this are not worth a thread.
pub const SHARED_POINTS: usize = 1 << 14;

fn by_medians(items: &[Aabb], ids: &mut [ItemId], threads: usize) {
    let point = |&id: &ItemId| Point::new(items[id as usize].centre(), id);
    let mut points: Vec<Point> = ids.iter().map(point).collect();
    // The largest power of sixteen below the number of points.
    let mut unit = LANES;
    while unit * LANES < points.len() {
        unit *= LANES;
    }
    let mut open = vec![Group {
        points: &mut points,
        unit,
    }];
    // The order within a group depends on that group alone, not on the thread that halves it.
    // Rounds of halving come first, until there are enough groups to keep all threads busy.
    while threads > 1 && open.len() < 4 * threads {
        if open.iter().all(|g| g.points.len() < SHARED_POINTS) {
            break;
        }
        let halves = map(threads.min(open.len()), open.into_iter(), Group::halved);
        open = halves.into_iter().flatten().flatten().collect();
    }
    share(threads, open.into_iter(), Group::put_in_order);
    for (id, point) in ids.iter_mut().zip(&points) {
        *id = point.id();
    }
}

/// The order of finite numbers; one comparison if the caller only uses "less".
#[inline(always)]
fn order(a: f32, b: f32) -> Ordering {
    if a < b {
        Ordering::Less
    } else if b < a {
        Ordering::Greater
    } else {
        Ordering::Equal
    }
}

fn widest_axis(points: &[Point]) -> usize {
    // Four independent chains: a single one would wait for the last minimum at every point.
    let (fours, rest) = points.as_chunks::<4>();
    let (mut low, mut high) = ([Vec4::INFINITY; 4], [Vec4::NEG_INFINITY; 4]);
    for four in fours {
        for i in 0..4 {
            low[i] = low[i].min(four[i].0);
            high[i] = high[i].max(four[i].0);
        }
    }
    for p in rest {
        low[0] = low[0].min(p.0);
        high[0] = high[0].max(p.0);
    }
    let low = low[0].min(low[1]).min(low[2].min(low[3]));
    let high = high[0].max(high[1]).max(high[2].max(high[3]));
    let width = high - low;
    let wider = |a: usize, b: usize| if width[b] > width[a] { b } else { a };
    wider(wider(0, 1), 2)
}

/// Bits per axis of a Morton code.
const BITS: u32 = 16;

/// Orders ids by the Morton codes of their centres, 16 bits per axis.
///
/// Morton 1966, "A computer oriented geodetic data base". Codes are relative to the bounds of the
/// centres.
fn by_morton(items: &[Aabb], ids: &mut [ItemId]) {
    let centre = |id: ItemId| items[id as usize].centre();
    let bounds = Aabb::of_points(ids.iter().map(|&id| centre(id)));
    let cells = (1u32 << BITS) as f32;
    // Halved first, so that the width of a scene spanning all of f32 stays finite.
    let half = bounds.half_extent();
    let code = |id: ItemId| {
        let from = (centre(id) * 0.5 - bounds.min * 0.5) / half * cells;
        // A width of zero gives NaN, which becomes zero, as do negative values.
        let cell = from.to_array().map(|x| (x as u64).min((1 << BITS) - 1));
        spread(cell[0]) | spread(cell[1]) << 1 | spread(cell[2]) << 2
    };
    let keyed = ids.iter().map(|&id| ((code(id) >> LOW) as u32, id));
    let mut sorted = sorted_by_radix(keyed.collect());
    // Cells of the upper bits with more than a block of items: crowded parts of a scene, usually
    // none.
    for cell in sorted.chunk_by_mut(|a, b| a.0 == b.0) {
        if cell.len() > LANES {
            cell.sort_by_cached_key(|&(_, id)| code(id));
        }
    }
    for (id, (_, sorted)) in ids.iter_mut().zip(sorted) {
        *id = sorted;
    }
}

/// Lower bits of a code that the radix sort ignores, so that an entry is 8 bytes.
const LOW: u32 = 3 * BITS - u32::BITS;

/// Sorts by code, stably. O(n).
///
/// Least significant digit first (Knuth, TAOCP 3, 5.2.5), eight bits per digit: with more, the
/// write positions exceed the first-level cache and TLB.
fn sorted_by_radix(mut from: Vec<(u32, ItemId)>) -> Vec<(u32, ItemId)> {
    let mut starts = [[0; 256]; size_of::<u32>()];
    for (code, _) in &from {
        for (starts, digit) in starts.iter_mut().zip(code.to_le_bytes()) {
            starts[usize::from(digit)] += 1;
        }
    }
    let mut to = vec![(0, 0); from.len()];
    for (digit, starts) in starts.iter_mut().enumerate() {
        if starts.contains(&from.len()) {
            continue;
        }
        let mut next = 0;
        for start in starts.iter_mut() {
            next += std::mem::replace(start, next);
        }
        for &entry in &from {
            let place = &mut starts[usize::from(entry.0.to_le_bytes()[digit])];
            to[*place] = entry;
            *place += 1;
        }
        std::mem::swap(&mut from, &mut to);
    }
    from
}

/// Inserts two zero bits after each of the low 16 bits.
fn spread(x: u64) -> u64 {
    let x = (x | x << 16) & 0x0000_0000_ff00_00ff;
    let x = (x | x << 8) & 0x0000_00f0_0f00_f00f;
    let x = (x | x << 4) & 0x0000_0c30_c30c_30c3;
    (x | x << 2) & 0x0000_2492_4924_9249
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn codes_interleave_the_bits() {
        for x in 0..1 << BITS {
            let bits = (0..BITS).map(|i| (x >> i & 1) << (3 * i));
            assert_eq!(spread(x), bits.sum::<u64>());
        }
    }

    /// A shuffled grid, and scenes that no order improves.
    fn scenes() -> [Vec<Aabb>; 4] {
        let at = |x: u32, y: u32, z: u32| {
            Aabb::around(Vec3::new(x as f32, y as f32, z as f32), Vec3::splat(0.4))
        };
        let grid: Vec<Aabb> = (0..4096u32)
            .map(|i| i.wrapping_mul(2_654_435_761) % 4096)
            .map(|i| at(i % 16, i / 16 % 16, i / 256))
            .collect();
        let huge = [-3e38, 3e38].map(|x| Aabb::around(Vec3::splat(x), Vec3::ZERO));
        let same = vec![at(1, 1, 1); 300];
        [grid, same, huge.repeat(20), Vec::new()]
    }

    #[test]
    fn every_order_holds_each_item_once() {
        for order in [BlockOrder::Median, BlockOrder::Morton] {
            for items in scenes() {
                let ids: Vec<ItemId> = (0..items.len() as ItemId).collect();
                let mut ordered = block_ordered(&items, ids.clone(), order, 1);
                ordered.sort_unstable();
                assert_eq!(ordered, ids);
            }
        }
    }

    #[test]
    fn blocks_of_a_grid_are_compact() {
        let items = &scenes()[0];
        let size = |ids: &[ItemId]| {
            let union = ids
                .iter()
                .fold(Aabb::EMPTY, |all, &id| all.union(&items[id as usize]));
            union.extent().element_product()
        };
        for order in [BlockOrder::Median, BlockOrder::Morton] {
            let ids = block_ordered(items, (0..4096).collect(), order, 1);
            for block in [16, 256] {
                // A perfect block of the grid spans as many cells as it has items.
                let worst = ids.chunks(block).map(size).fold(0.0, f32::max);
                assert!(worst <= 1.01 * block as f32, "{order:?}: {worst}");
            }
        }
    }

    #[test]
    fn a_crowd_in_one_corner_is_ordered_by_the_lower_bits() {
        // A far item makes the cells of the upper bits as large as the grid.
        let mut items = scenes()[0].clone();
        let far = Vec3::splat(f32::from(1u16 << 15));
        items.push(Aabb::around(far, Vec3::splat(0.4)));
        let ids = block_ordered(&items, (0..4097).collect(), BlockOrder::Morton, 1);
        for block in ids[..4096].chunks(LANES) {
            let boxes = block.iter().map(|&id| &items[id as usize]);
            let size = Aabb::union_of(boxes).extent().element_product();
            assert!(size <= 1.01 * LANES as f32, "{size}");
        }
    }
}
