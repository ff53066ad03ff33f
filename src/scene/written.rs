//! Boxes and points as written, in f64, in addition to the f32 of indexes.
//!
//! They make region search exact: an index's candidates are tested exactly.

use std::sync::Arc;

use glam::{DVec3, Vec3};

use super::{Regions, Scene, WorldBox, bad_item};
use crate::arithmetic::two_sum;
use crate::geometry::{Aabb, ConvexVolume};
use crate::input::Result;
use crate::query::ItemId;

/// The boxes as written, kept only if f32 changes one of them.
///
/// A NaN box stands for the stored one, as for an item that a generated motion moves.
#[derive(Clone, Default, Debug)]
pub struct WrittenBoxes {
    boxes: Arc<[WorldBox]>,
}

impl WrittenBoxes {
    /// Keeps `written` if `stored`, the same boxes about `origin`, differs.
    pub(super) fn of(written: &[WorldBox], stored: &[Aabb], origin: DVec3) -> WrittenBoxes {
        let mut both = written.iter().zip(stored);
        let exact = both.all(|(written, stored)| written.is_stored_as(stored, origin));
        WrittenBoxes::listed(if exact { &[] } else { written })
    }

    /// The boxes by id; none if all equal the stored ones.
    pub(crate) fn listed(boxes: &[WorldBox]) -> WrittenBoxes {
        let all_stored = boxes.iter().all(|b| b.min.is_nan());
        WrittenBoxes {
            boxes: if all_stored { &[] } else { boxes }.into(),
        }
    }

    /// The box of an item if it differs from the stored one.
    pub fn of_item(&self, id: usize) -> Option<&WorldBox> {
        self.boxes.get(id).filter(|b| !b.min.is_nan())
    }

    /// The boxes; `count` NaN boxes if none are kept.
    pub(crate) fn or_stored(&self, count: usize) -> Vec<WorldBox> {
        let all_stored = || vec![WorldBox::AS_STORED; count];
        self.boxes().map_or_else(all_stored, <[_]>::to_vec)
    }

    /// The boxes in world coordinates; `None` if they equal the stored ones.
    pub fn boxes(&self) -> Option<&[WorldBox]> {
        (!self.boxes.is_empty()).then_some(&self.boxes)
    }
}

/// A point to search for: as written, and rounded for indexes.
///
/// Rounding to nearest loses no box: a bound is an f32 number, and a coordinate beyond it is
/// rounded beyond it or onto it. It can only add candidates.
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct SearchPoint {
    /// World coordinates, in f64.
    pub world: DVec3,
    /// Scene coordinates, rounded to the nearest f32.
    pub local: Vec3,
}

/// A box to search by: as written, and rounded for indexes.
#[derive(Clone, Debug)]
pub struct SearchBox {
    /// World coordinates, in f64.
    pub world: WorldBox,
    /// The planes of the smallest f32 box that contains it.
    ///
    /// They may admit too many items, never too few.
    pub volume: ConvexVolume,
}

impl Scene {
    /// A world point in the form that this scene's indexes take.
    ///
    /// A planar BSP ignores the height.
    #[inline]
    pub fn search_point(&self, world: DVec3) -> SearchPoint {
        let mut local = (world - self.origin).as_vec3();
        if let Regions::Bsp(_) = self.regions {
            local.z = 0.0;
        }
        SearchPoint { world, local }
    }

    /// A world box in the form that this scene's indexes take.
    pub fn search_box(&self, world: WorldBox) -> SearchBox {
        let local = Aabb::rounded_outward(world.min, world.max, self.origin);
        let volume = ConvexVolume::of_box(&local);
        SearchBox { world, volume }
    }

    /// Region search: the regions that contain the point exactly.
    ///
    /// `ask` appends the candidates of an index; false candidates are dropped.
    #[inline]
    pub fn search(
        &self,
        p: &SearchPoint,
        out: &mut Vec<ItemId>,
        ask: impl FnOnce(Vec3, &mut Vec<ItemId>),
    ) {
        let first = out.len();
        ask(p.local, out);
        self.refine(p, out, first);
    }

    /// Tests whether candidates for a point need [`Scene::refine`].
    pub fn is_refined(&self, p: &SearchPoint) -> bool {
        let is_rounded = |k: usize| side(p.world[k], self.origin[k], p.local[k]) != 0;
        matches!(self.regions, Regions::Bsp(_) | Regions::Leaves(_))
            || self.written_regions().boxes().is_some()
            || (0..3).any(is_rounded)
    }

    /// Keeps the regions that contain the point exactly.
    ///
    /// Drops other candidates from index `first` on.
    #[inline]
    pub fn refine(&self, p: &SearchPoint, found: &mut Vec<ItemId>, first: usize) {
        if found.len() > first && self.is_refined(p) {
            self.keep_holding(p, found, first);
        }
    }

    fn keep_holding(&self, p: &SearchPoint, found: &mut Vec<ItemId>, first: usize) {
        match self.regions.leaf_at(p.world - self.origin) {
            Some(leaf) => retain_from(first, found, |region| Some(region) == leaf),
            None => retain_from(first, found, |id| self.holds(id, p.world)),
        }
    }

    /// Keeps the candidates of an index that overlap the box exactly.
    ///
    /// Closed boxes with a common point.
    pub fn refine_overlapping(&self, sought: &SearchBox, found: &mut Vec<ItemId>) {
        found.retain(|&id| self.overlaps(id, &sought.world));
    }

    /// Reference answer of region search, ascending ids.
    ///
    /// Computed by the map's own descent, or an exact test of every box.
    pub fn holding(&self, p: &SearchPoint) -> Vec<ItemId> {
        if let Some(leaf) = self.regions.leaf_at(p.world - self.origin) {
            return leaf.into_iter().collect();
        }
        let count = self.regions.boxes(&self.items).len() as ItemId;
        (0..count).filter(|&id| self.holds(id, p.world)).collect()
    }

    /// Tests whether a region that is a box contains a world point.
    fn holds(&self, id: ItemId, p: DVec3) -> bool {
        let boxes = self.regions.boxes(&self.items);
        self.meets(boxes, self.written_regions(), id, &WorldBox::at(p))
    }

    /// Tests whether an item, as written, has a point in common with a box.
    pub fn overlaps(&self, id: ItemId, by: &WorldBox) -> bool {
        self.meets(&self.items, &self.originals, id, by)
    }

    /// Tests whether a listed box, as written, has a point in common with another.
    fn meets(&self, boxes: &[Aabb], originals: &WrittenBoxes, id: ItemId, by: &WorldBox) -> bool {
        if let Some(written) = originals.boxes() {
            return written[id as usize].meets(by);
        }
        let b = &boxes[id as usize];
        (0..3).all(|k| {
            let origin = self.origin[k];
            side(by.max[k], origin, b.min[k]) >= 0 && side(by.min[k], origin, b.max[k]) <= 0
        })
    }

    /// The regions as written.
    pub(crate) fn written_regions(&self) -> &WrittenBoxes {
        match &self.regions {
            Regions::Tiling(tiling) => &tiling.originals,
            _ => &self.originals,
        }
    }

    /// The items as written, in world coordinates.
    ///
    /// Exact: without a kept original, origin and stored box add up without rounding.
    pub fn written(&self) -> impl Iterator<Item = WorldBox> {
        (0..self.items.len()).map(|id| self.written_box(id))
    }

    /// An item as written, in world coordinates.
    pub fn written_box(&self, id: usize) -> WorldBox {
        match self.originals.boxes() {
            Some(boxes) => boxes[id],
            None => WorldBox::of(&self.items[id], self.origin),
        }
    }

    /// The scene as it is read back from a boxes file.
    ///
    /// The same boxes, as written, and labels; no triangles, regions, camera places or own tree.
    ///
    /// Almost always the stored items are identical too. If the reader chooses another origin (a
    /// map whose origin is far away), they are rounded relative to that.
    ///
    /// # Errors
    /// An item beyond the range of the reader: f32 in world coordinates.
    pub fn settled(self) -> Result<Scene> {
        let most = f64::from(f32::MAX);
        let within = |v: DVec3| v.abs().cmple(DVec3::splat(most)).all();
        let boxes: Vec<WorldBox> = self.written().collect();
        let outside = boxes.iter().position(|b| !within(b.min) || !within(b.max));
        if let Some(item) = outside {
            let found = format_args!("in world coordinates beyond +-{most:e}");
            return Err(bad_item(&self.name, item, found, "less in a file"));
        }
        Ok(Scene {
            labels: self.labels,
            skipped_items: self.skipped_items,
            up: self.up,
            unit: self.unit,
            ..Scene::from_boxes(self.name, &boxes)?
        })
    }
}

/// The sign of `(p - origin) - bound`, exactly: -1, 0 or 1.
fn side(p: f64, origin: f64, bound: f32) -> i32 {
    let (difference, lost) = two_sum(p, -origin);
    let bound = f64::from(bound);
    // The rounded difference and the exact one are on the same side of any double.
    if difference != bound {
        return if difference > bound { 1 } else { -1 };
    }
    i32::from(lost > 0.0) - i32::from(lost < 0.0)
}

/// `Vec::retain` for the ids from index `first` on.
fn retain_from(first: usize, ids: &mut Vec<ItemId>, keep: impl Fn(ItemId) -> bool) {
    ids.extract_if(first.., |id| !keep(*id)).for_each(drop);
}

#[cfg(test)]
mod tests {
    use super::super::{LoadOptions, load, read_boxes_csv, write_boxes_csv};
    use super::*;
    use crate::scene::{Scene, WorldBox};
    use dashu_int::IBig;
    use glam::DVec3;
    use proptest::prelude::*;

    #[test]
    fn what_f32_holds_exactly_needs_no_second_look() {
        let boxes = [WorldBox::new(DVec3::ZERO, DVec3::ONE)];
        let scene = Scene::about("exact", &boxes, DVec3::ZERO).expect("a scene");
        assert!(scene.originals.boxes().is_none());
        let p = scene.search_point(DVec3::splat(0.5));
        assert!(!scene.is_refined(&p));
        let p = scene.search_point(DVec3::new(1.0 + 1e-12, 0.5, 0.5));
        let mut found = vec![0];
        assert!(scene.is_refined(&p) && p.local.x == 1.0);
        scene.refine(&p, &mut found, 0);
        assert!(found.is_empty());
    }

    #[test]
    fn boxes_beyond_f32_are_searched_by_what_lies_within() {
        let unit = WorldBox::new(DVec3::ZERO, DVec3::ONE);
        let scene = Scene::from_boxes("one", &[unit]).expect("a box");
        let found = |min: f64, max: f64| {
            let by = WorldBox::new(DVec3::splat(min), DVec3::splat(max));
            let sought = scene.search_box(by);
            let mut found = vec![0];
            scene.refine_overlapping(&sought, &mut found);
            let found = found.len();
            // The planes may admit too many items, never too few.
            assert!(scene.items.iter().filter(|b| sought.volume.sees(b)).count() >= found);
            found
        };
        assert_eq!(found(-1e300, 1e300), 1);
        // Touching, from either side, and just not touching.
        assert_eq!(found(1.0, 1e300), 1);
        assert_eq!(found(-1e300, 0.0), 1);
        assert_eq!(found(1.0f64.next_up(), 1e300), 0);
        assert_eq!(found(1e299, 1e300), 0);
        assert_eq!(found(-1e300, -1e299), 0);
    }

    /// A double as a multiple of 2^-1074.
    fn units(x: f64) -> IBig {
        let bits = x.abs().to_bits();
        let exponent = (bits >> 52) as usize;
        let mantissa = bits & ((1 << 52) - 1) | u64::from(exponent > 0) << 52;
        let size = IBig::from(mantissa) << exponent.saturating_sub(1);
        if x < 0.0 { -size } else { size }
    }

    #[test]
    fn sides_are_those_of_whole_numbers() {
        let mut state = 7u64;
        let mut next = || {
            state = state.wrapping_mul(0x5851_F42D_4C95_7F2D).wrapping_add(1);
            state >> 33
        };
        let mut ties = 0;
        for _ in 0..20_000 {
            let origin = (next() % 4096) as f64 * libm::exp2((next() % 60) as f64 - 20.0);
            let bound = (next() % 4096) as f32 * 0.1;
            let mut p = origin + f64::from(bound);
            for _ in 0..next() % 3 {
                p = if next() % 2 == 0 {
                    p.next_up()
                } else {
                    p.next_down()
                };
            }
            let exact = units(p) - units(origin) - units(f64::from(bound));
            let wanted = i32::from(exact > IBig::ZERO) - i32::from(exact < IBig::ZERO);
            assert_eq!(side(p, origin, bound), wanted, "{p:e} {origin:e} {bound:e}");
            ties += u32::from(wanted == 0);
        }
        assert!(ties > 1000, "{ties}");
    }

    fn written(scene: &Scene) -> Vec<u8> {
        let mut bytes = Vec::new();
        write_boxes_csv(scene, &mut bytes).unwrap();
        bytes
    }

    /// Writes, reads and writes again; returns the scene read.
    fn there_and_back(scene: &Scene) -> Scene {
        let kept = scene.clone().settled().unwrap();
        let bytes = written(&kept);
        let read = read_boxes_csv(&bytes[..], "b.csv", false).unwrap();
        // Zero may lose its sign on the way; nothing else may change.
        assert_eq!((kept.origin, &kept.items), (read.origin, &read.items));
        assert_eq!(kept.bounds, read.bounds);
        assert_eq!(kept.originals.boxes(), read.originals.boxes());
        assert!(scene.written().eq(read.written()), "{}", scene.name);
        assert!(written(&read.clone().settled().unwrap()) == bytes);
        read
    }

    #[test]
    fn every_kind_of_scene_is_read_back_with_the_same_items() {
        for source in [
            "uniform:n=0",
            "uniform:n=200",
            "uniform:n=200,offset=1e7",
            "city:n=200,offset=-123456.789",
            "forest:n=200,offset=1e9",
            "rooms:n=200,seed=3",
            "clustered:n=200,offset=3e15",
            "freedm-map12",
            "helsinki",
            "us-counties",
            "mesh:terrain:n=5000",
            "mesh:forest:n=5000",
        ] {
            let scene = load(source, &LoadOptions::default()).unwrap();
            let read = there_and_back(&scene);
            let is_same = (scene.origin, &scene.items) == (read.origin, &read.items);
            // A reader does not choose a map's own origin.
            assert!(is_same || source.starts_with("freedm"), "{source}");
        }
    }

    #[test]
    fn another_origin_is_taken_once() {
        let b = |low: f64, high: f64| WorldBox::new(DVec3::splat(low), DVec3::splat(high));
        // A map's own origin, far away.
        let far = [b(1e7 + 0.1, 1e7 + 1.7), b(1e7 + 3.3, 1e7 + 3.3)];
        let map = Scene::about("map", &far, DVec3::ZERO).unwrap();
        let read = there_and_back(&map);
        // Stored relative to the map's origin they were one f32 step larger.
        assert!(read.origin.x > 9e6 && read.world_bounds().min.x > map.world_bounds().min.x);
        // Rounded outward, these have a width of a power of two.
        for shift in 0..64 {
            let low = 1e7 + 0.3 + 16.0 * f64::from(shift);
            let wide = [b(low, low + 1.0), b(low + 5.0, low + 1_023.999_99)];
            let scene = Scene::from_boxes("wide", &wide).unwrap();
            there_and_back(&scene);
        }
    }

    #[test]
    fn what_the_reader_does_not_take_is_refused() {
        let scene = load("uniform:n=3,offset=1e39", &LoadOptions::default()).unwrap();
        let error = scene.settled().unwrap_err().to_string();
        assert!(error.contains("item 0") && error.contains("3.4"), "{error}");
    }

    proptest! {
        /// Any boxes about any origin: read back and written again, they are identical.
        #[test]
        fn nothing_is_lost_and_the_second_time_is_the_first(
            centre in prop::num::f64::NORMAL.prop_map(|v| v % 1e12),
            edges in prop::collection::vec((-1e3f64..1e3, 0.0f64..50.0), 1..12),
            origin in prop_oneof![Just(0.0), -1e9f64..1e9],
        ) {
            let boxes: Vec<WorldBox> = edges
                .iter()
                .map(|(at, edge)| {
                    let min = DVec3::new(centre + at, *at, centre - at);
                    WorldBox::new(min, min + *edge)
                })
                .collect();
            for scene in [
                Scene::from_boxes("chosen", &boxes),
                Scene::about("given", &boxes, DVec3::splat(origin)),
            ] {
                let scene = scene.unwrap();
                prop_assert!(scene.written().eq(boxes.iter().copied()));
                there_and_back(&scene);
            }
        }
    }
}
