//! Uniform grid over boxes, to find those that meet another box.
//!
//! Locates the regions of an eye and the items of a region.

use glam::DVec3;

use super::graph::{RegionGraph, RegionId};
use crate::index::IdSet;
use crate::query::ItemId;
use crate::scene::{Scene, WorldBox};

/// Uniform grid of buckets over boxes.
#[derive(Clone, Debug)]
pub struct BoxGrid {
    /// Boxes in input order.
    pub boxes: Vec<WorldBox>,
    low: DVec3,
    per_unit: DVec3,
    count: [usize; 3],
    /// Boxes of each bucket.
    buckets: Vec<Vec<u32>>,
}

impl BoxGrid {
    /// Builds a grid with about as many buckets as boxes. O(n + entries).
    pub fn new(boxes: Vec<WorldBox>) -> BoxGrid {
        let WorldBox { min: low, max } = WorldBox::union_of(boxes.iter().copied());
        let size = (max - low).max(DVec3::ZERO);
        // Cubic cells, sized for about one bucket per box.
        let solid = size.max(DVec3::splat(size.max_element() * 1e-3));
        let edge = libm::cbrt(solid.element_product() / boxes.len().max(1) as f64);
        let count = (solid / edge).to_array();
        let count = count.map(|cells| (cells as usize).clamp(1, 1024));
        let mut grid = BoxGrid {
            boxes,
            low,
            // Infinite on an axis of width 0, where all boxes lie in the first cell.
            per_unit: DVec3::from(count.map(|cells| cells as f64)) / size,
            count,
            buckets: Vec::new(),
        };
        let mut lists = vec![Vec::new(); count[0] * count[1] * count[2]];
        for (id, b) in (0..).zip(&grid.boxes) {
            grid.buckets(b, |bucket| lists[bucket].push(id));
        }
        grid.buckets = lists;
        grid
    }

    /// Calls `found` with each box that meets a closed box.
    ///
    /// A box that lies in several buckets may be reported several times.
    pub fn meeting(&self, b: &WorldBox, mut found: impl FnMut(u32)) {
        let meets = |id: u32| b.meets(&self.boxes[id as usize]);
        self.buckets(b, |bucket| {
            let entries = self.buckets[bucket].iter().copied();
            entries.filter(|id| meets(*id)).for_each(&mut found);
        });
    }

    /// Bucket index on an axis.
    ///
    /// Monotone in `x`, so a box's buckets lie between those of its corners, whatever the rounding.
    fn cell(&self, axis: usize, x: f64) -> usize {
        let at = (x - self.low[axis]) * self.per_unit[axis];
        // Negative numbers and NaN become 0.
        (at as usize).min(self.count[axis] - 1)
    }

    fn buckets(&self, b: &WorldBox, mut found: impl FnMut(usize)) {
        let from = [0, 1, 2].map(|k| self.cell(k, b.min[k]));
        let to = [0, 1, 2].map(|k| self.cell(k, b.max[k]));
        for z in from[2]..=to[2] {
            for y in from[1]..=to[1] {
                for x in from[0]..=to[0] {
                    found((z * self.count[1] + y) * self.count[0] + x);
                }
            }
        }
    }
}

/// Tests whether closed boxes cover a box, exactly.
///
/// Subtracts one box and tests each remaining part with the boxes that overlap it; boxes that only
/// touch the part cover nothing of it. Returns false at the first part without such a box. O(n log
/// n) for the rooms of a grid; O(n^4) at worst, as parts are disjoint boxes between planes of
/// faces.
pub fn covers(by: &[WorldBox], b: &WorldBox) -> bool {
    let overlap = |part: &WorldBox, other: &WorldBox| {
        let (low, high) = (part.min.max(other.min), part.max.min(other.max));
        let is_flat = part.min.cmpeq(part.max);
        (low.cmplt(high) | low.cmpeq(high) & is_flat).all()
    };
    let mut open = vec![(*b, Vec::from_iter(by))];
    while let Some((part, mut by)) = open.pop() {
        by.retain(|other| overlap(&part, other));
        if by.is_empty() {
            return false;
        }
        let cut = by.swap_remove(by.len() / 2);
        let parts = without(&part, cut).into_iter();
        open.extend(parts.map(|part| (part, by.clone())));
    }
    true
}

/// Parts of a box outside another box: up to six boxes.
pub fn without(b: &WorldBox, other: &WorldBox) -> Vec<WorldBox> {
    if !b.meets(other) {
        return vec![*b];
    }
    let (mut left, mut parts) = (*b, Vec::new());
    for axis in 0..3 {
        let [low, high] = [left.min[axis], left.max[axis]];
        let [from, to] = [low.max(other.min[axis]), high.min(other.max[axis])];
        for [start, end] in [[low, from], [to, high]] {
            (left.min[axis], left.max[axis]) = (start, end);
            parts.extend((start < end).then_some(left));
        }
        (left.min[axis], left.max[axis]) = (from, to);
    }
    parts
}

/// Items of each region.
#[derive(Clone, Debug)]
pub struct RegionItems {
    lists: Vec<Vec<ItemId>>,
    items: usize,
}

impl RegionItems {
    /// Items that touch or meet each region; both are closed.
    ///
    /// Contains the items that touch a box of the region and those that
    /// [meet](super::RegionLocator::more_at) the region elsewhere. If regions have no height of
    /// their own (those of a map), their boxes extend without end up and down. O(n log n) for items
    /// much smaller than regions.
    pub fn of(graph: &RegionGraph, scene: &Scene) -> RegionItems {
        let owned = (0..).zip(&graph.parts);
        let owners = owned.flat_map(|(region, parts)| parts.iter().map(move |_| region));
        let owners: Vec<RegionId> = owners.collect();
        let grid = BoxGrid::new(graph.parts.concat());
        let mut lists = vec![Vec::new(); graph.len()];
        let mut met = Vec::new();
        for (id, item) in (0..).zip(&scene.items) {
            let b = WorldBox::of(item, scene.origin);
            met.clear();
            grid.meeting(&b, |part| met.push(owners[part as usize]));
            graph.locator.more_at(&b, &mut met);
            met.sort_unstable();
            met.dedup();
            met.iter().for_each(|&owner| lists[owner as usize].push(id));
        }
        RegionItems {
            lists,
            items: scene.items.len(),
        }
    }

    /// Items that meet a region, ascending.
    pub fn of_region(&self, region: RegionId) -> &[ItemId] {
        &self.lists[region as usize]
    }

    /// Replaces `out` by the items of the regions, ascending.
    ///
    /// If all regions are given, the result is all items. O(items of the regions + n / 64).
    pub fn of_regions(&self, regions: &[RegionId], marks: &mut IdSet, out: &mut Vec<ItemId>) {
        if regions.len() == self.lists.len() {
            out.clear();
            out.extend(0..self.items as u32);
            return;
        }
        marks.clear(self.items);
        for &region in regions {
            marks.insert_all(self.of_region(region));
        }
        marks.list(out);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::SeededRng;

    fn random(rng: &mut SeededRng, edge: f64) -> WorldBox {
        let at = DVec3::new(rng.unit(), rng.unit(), rng.unit() * 0.1) * 100.0;
        WorldBox::new(
            at,
            at + DVec3::new(rng.unit(), rng.unit(), rng.unit()) * edge,
        )
    }

    #[test]
    fn the_grid_finds_what_a_look_at_each_box_finds() {
        let mut rng = SeededRng::new(5);
        let boxes: Vec<WorldBox> = (0..300).map(|_| random(&mut rng, 20.0)).collect();
        let grid = BoxGrid::new(boxes.clone());
        for _ in 0..300 {
            let b = random(&mut rng, 5.0);
            let mut found = Vec::new();
            grid.meeting(&b, |id| found.push(id));
            found.sort_unstable();
            found.dedup();
            let meets = |o: &WorldBox| b.min.cmple(o.max).all() && o.min.cmple(b.max).all();
            let wanted = (0..).zip(&boxes).filter(|(_, o)| meets(o));
            assert_eq!(found, wanted.map(|(id, _)| id).collect::<Vec<u32>>());
        }
        assert!(BoxGrid::new(Vec::new()).boxes.is_empty());
    }

    #[test]
    fn covering_is_exact() {
        let part =
            |a: f64, b: f64| WorldBox::new(DVec3::splat(0.0).with_x(a), DVec3::ONE.with_x(b));
        assert!(covers(&[part(0.0, 0.5), part(0.5, 1.0)], &part(0.1, 0.9)));
        let gap = 0.5f64.next_up().next_up();
        assert!(!covers(&[part(0.0, 0.5), part(gap, 1.0)], &part(0.1, 0.9)));
        assert!(!covers(&[part(0.0, 0.5)], &part(0.1, 0.9)));
        assert!(!covers(&[], &part(0.1, 0.9)));
    }

    /// Boxes of a grid touch each other; boxes are also cut where they only touch.
    #[test]
    fn covering_by_thousands_of_small_boxes_ends_at_once() {
        let (mut cells, one) = (Vec::new(), DVec3::ONE);
        for i in 0..20 * 20 * 20 {
            let at = DVec3::new((i % 20) as f64, (i / 20 % 20) as f64, (i / 400) as f64);
            cells.push(WorldBox::new(at, at + one));
        }
        let inner = WorldBox::new(one * 0.5, one * 19.5);
        assert!(covers(&cells, &inner));
        assert!(!covers(&cells, &WorldBox::new(one * 0.5, one * 20.5)));
        for flat in [5.0, 5.5] {
            let flat = |b: DVec3| b.with_z(flat);
            assert!(covers(
                &cells,
                &WorldBox::new(flat(inner.min), flat(inner.max))
            ));
        }
        cells.remove(2345);
        assert!(!covers(&cells, &inner));
    }

    /// The reference subtracts one box after another, for flat boxes too.
    #[test]
    fn covering_is_what_is_left_after_every_cut() {
        let (mut rng, mut covered) = (SeededRng::new(8), 0);
        for _ in 0..4000 {
            let mut random = |most: usize| {
                let mut pick = |below: usize| rng.below(below) as f64;
                let low = DVec3::new(pick(3), pick(3), pick(3));
                let size = DVec3::new(pick(most), pick(most), pick(most));
                WorldBox::new(low, low + size)
            };
            let b = random(3);
            let by: Vec<WorldBox> = (0..12).map(|_| random(4)).collect();
            let mut left = vec![b];
            for other in &by {
                left = left.iter().flat_map(|b| without(b, other)).collect();
            }
            assert_eq!(covers(&by, &b), left.is_empty(), "{b:?} {by:?}");
            covered += usize::from(left.is_empty());
        }
        assert!((400..3600).contains(&covered), "the premise: {covered}");
    }
}
