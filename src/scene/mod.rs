//! A scene: boxes in local f32 coordinates relative to an f64 origin.
//!
//! Also the triangles of a mesh, the regions for region search, and the scene's own camera places.
//!
//! Generators and readers have a file each; this file defines their common output and the choice of
//! the origin.

mod boxes_csv;
mod bsp;
mod disputes;
mod face;
mod families;
mod generate;
mod gltf;
mod ibsp;
mod labels;
mod lumps;
pub(crate) mod memory;
mod meshes;
mod obj;
mod options;
mod records;
mod rng;
mod rooms;
mod samples;
mod source;
mod surface;
mod wad;
mod written;
mod zip;

use std::fmt;
use std::sync::Arc;

use glam::{DVec3, Vec3};

use crate::arithmetic::two_sum;

use crate::geometry::{Aabb, PlaneTree};
use crate::input::Result;
use crate::query::ItemId;

pub use crate::input::InputError;
pub(crate) use crate::shown::hex;
pub use boxes_csv::{read_boxes_csv, read_search_boxes_csv, write_boxes_csv};
pub use bsp::BspChild;
pub(crate) use bsp::clipped;
pub use disputes::{Dispute, Linedef};
pub(crate) use families::CityGrid;
pub(crate) use generate::{COUNT, GENERATOR_NAME, SCENE_PARAMS};
pub use generate::{FAMILIES, Family, MESHES};
pub use gltf::CameraAnimation;
pub use ibsp::{LeafNode, LeafTree, QuakeMap, read_ibsp};
pub use labels::Labels;
pub(crate) use memory::available_bytes;
pub(crate) use meshes::ground::Shape;
pub use obj::read_obj;
pub use options::{CameraPlace, ITEM_KINDS, ItemKind, LoadOptions, PlaceView, UP_AXES, UpAxis};
pub use rng::SeededRng;
pub(crate) use rng::{mix64, on_sphere};
pub use rooms::{Portal, Tiling};
pub(crate) use samples::{FETCHED, FETCHED_FOLDER, Fetched};
pub use samples::{NOTICE, SAMPLES, Sample};
pub(crate) use source::{check_fits, every_part, split_part};
pub use source::{load, part_names, read_bytes};
pub(crate) use surface::volume_within;
pub use surface::{ItemShape, SurfaceKind, Surfaces};
pub use wad::{WadMap, map_names};
pub use written::{SearchBox, SearchPoint, WrittenBoxes};
#[cfg(test)]
pub(crate) use zip::tests::packed;

/// A box in world coordinates, as stated by a file or a generator.
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct WorldBox {
    /// Lower corner; bounds are closed.
    pub min: DVec3,
    /// Upper corner; bounds are closed.
    pub max: DVec3,
}

impl WorldBox {
    /// A NaN box: the item's written box is the stored one.
    pub(crate) const AS_STORED: WorldBox = WorldBox {
        min: DVec3::NAN,
        max: DVec3::NAN,
    };

    /// The box between two corners; empty where `min` is above `max`.
    pub fn new(min: DVec3, max: DVec3) -> Self {
        WorldBox { min, max }
    }

    /// Tests whether a box stored relative to `origin` equals this one exactly.
    pub(crate) fn is_stored_as(&self, stored: &Aabb, origin: DVec3) -> bool {
        let corners = [(self.min, stored.min), (self.max, stored.max)];
        corners.into_iter().all(|(written, stored)| {
            (0..3).all(|k| two_sum(origin[k], f64::from(stored[k])) == (written[k], 0.0))
        })
    }

    /// The smallest box that contains all of `boxes`; inverted for none.
    pub fn union_of(boxes: impl IntoIterator<Item = WorldBox>) -> Self {
        let none = WorldBox::new(DVec3::INFINITY, DVec3::NEG_INFINITY);
        boxes.into_iter().fold(none, |all, b| {
            WorldBox::new(all.min.min(b.min), all.max.max(b.max))
        })
    }

    /// The box of a point.
    pub fn at(point: DVec3) -> Self {
        WorldBox::new(point, point)
    }

    /// Tests whether two closed boxes have a point in common.
    pub fn meets(&self, other: &WorldBox) -> bool {
        self.min.cmple(other.max).all() && other.min.cmple(self.max).all()
    }

    /// A scene-local box in world coordinates, rounded outward.
    pub fn of(b: &Aabb, origin: DVec3) -> Self {
        let (min, max) = b.in_world(origin);
        WorldBox::new(min, max)
    }

    /// The largest box within a scene-local one; empty if there is none.
    pub fn within(b: &Aabb, origin: DVec3) -> Self {
        // Rounded outward with corners swapped: inward.
        let (max, min) = Aabb::new(b.max, b.min).in_world(origin);
        WorldBox::new(min, max)
    }

    /// The box standing on `base` (centre of its bottom face).
    pub fn standing(base: DVec3, size: DVec3) -> Self {
        let half = DVec3::new(size.x / 2.0, size.y / 2.0, 0.0);
        WorldBox::new(base - half, base + half + DVec3::Z * size.z)
    }

    /// The box about `centre` with the given edge lengths.
    pub fn around(centre: DVec3, size: DVec3) -> Self {
        WorldBox::new(centre - size / 2.0, centre + size / 2.0)
    }
}

/// The regions of a scene, numbered from zero: the targets of region search.
#[derive(Clone, Default, Debug)]
pub enum Regions {
    /// The items themselves: closed boxes that may overlap.
    ///
    /// A point belongs to every region that contains it.
    #[default]
    Items,
    /// Boxes that tile a volume, connected by portals.
    ///
    /// Closed as well: a point on a shared wall belongs to both sides.
    Tiling(Tiling),
    /// The leaves of a map's own 2-D BSP tree.
    ///
    /// Every point of the map belongs to exactly one, at any height.
    Bsp(Arc<WadMap>),
    /// The open leaves of a map's own BSP tree.
    ///
    /// A point belongs to one, or to none if it is in the solid.
    Leaves(Arc<QuakeMap>),
}

impl Regions {
    /// The boxes to build an index over.
    ///
    /// Every point of region i lies in box i.
    pub fn boxes<'a>(&'a self, items: &'a [Aabb]) -> &'a [Aabb] {
        match self {
            Regions::Items => items,
            Regions::Tiling(tiling) => &tiling.boxes,
            Regions::Bsp(map) => &map.tree.boxes,
            Regions::Leaves(map) => &map.tree.boxes,
        }
    }

    /// The boxes that contain a local point, found by testing each.
    ///
    /// The answer an index must give. Ascending ids.
    pub fn holding(&self, p: Vec3, items: &[Aabb]) -> Vec<ItemId> {
        let boxes = self.boxes(items).iter().zip(0..);
        let holding = boxes.filter(|(b, _)| b.contains_point(p));
        holding.map(|(_, id)| id).collect()
    }

    /// The leaf of a map that contains a point relative to the scene's origin.
    ///
    /// `None` if the regions are boxes.
    pub fn leaf_at(&self, p: DVec3) -> Option<Option<ItemId>> {
        match self {
            Regions::Bsp(map) => Some(map.tree.descend(p.truncate())),
            Regions::Leaves(map) => Some(map.tree.descend(p)),
            _ => None,
        }
    }

    /// Description for `scene info`.
    pub fn kind(&self) -> &'static str {
        match self {
            Regions::Items => "the items' boxes",
            Regions::Tiling(_) => "a tiling of boxes",
            Regions::Bsp(_) => "the leaves of the map's BSP tree",
            Regions::Leaves(_) => "the open leaves of the map's BSP tree",
        }
    }
}

/// Input of every structure.
#[derive(Clone, Default, Debug)]
pub struct Scene {
    /// Its source: a file or a spec such as `city:n=100000,seed=7`.
    pub name: String,
    /// Axis that points up.
    pub up: UpAxis,
    /// Unit of coordinates; `None` if the file does not state it.
    pub unit: Option<&'static str>,
    /// Origin of the local coordinates, in world coordinates.
    pub origin: DVec3,
    /// Item bounds, rounded outward relative to the origin; the id is the index.
    pub items: Vec<Aabb>,
    /// The items as written, if f32 changes any of them.
    pub originals: WrittenBoxes,
    /// Union of the items, local.
    pub bounds: Aabb,
    /// The triangles of the items, if the scene is a mesh.
    pub surfaces: Option<Arc<Surfaces>>,
    /// Targets of region search.
    pub regions: Regions,
    /// Columns of the file beyond the bounds.
    pub labels: Vec<Labels>,
    /// Camera places that the scene offers, for the path `places`.
    pub places: Vec<CameraPlace>,
    /// The camera that the file's animation moves, or why it cannot be read.
    pub animation: Option<Arc<Result<CameraAnimation>>>,
    /// The partition in the scene's file, local coordinates.
    pub own_tree: Option<PlaneTree>,
    /// Items left out on request (`--skip-bad-items`).
    pub skipped_items: usize,
    /// Data row of each item, ascending; empty if none were left out.
    pub rows: Vec<ItemId>,
}

impl Scene {
    /// The id of an item in files: its zero-based data row. O(1).
    pub fn row_of(&self, item: ItemId) -> ItemId {
        self.rows.get(item as usize).copied().unwrap_or(item)
    }

    /// The ids of items in files, in words: `0 to 9`.
    pub fn ids(&self) -> String {
        let left_out = ["", " without the rows left out"][usize::from(self.skipped_items > 0)];
        match self.items.len().checked_sub(1) {
            Some(last) => format!("0 to {}{left_out}", self.row_of(last as ItemId)),
            None => "which has none".to_owned(),
        }
    }

    /// The item of a data row, if it has one. O(log n).
    pub fn item_of(&self, row: ItemId) -> Option<ItemId> {
        if self.rows.is_empty() {
            return Some(row).filter(|&row| (row as usize) < self.items.len());
        }
        let item = self.rows.binary_search(&row).ok();
        item.map(|item| item as ItemId)
    }

    /// Rounds the boxes outward relative to an origin chosen for them.
    ///
    /// # Errors
    /// The first box that is not finite, inverted or too large for f32.
    pub fn from_boxes(name: impl Into<String>, boxes: &[WorldBox]) -> Result<Scene> {
        let origin = choose_origin(boxes.iter().copied());
        Scene::about(name, boxes, origin)
    }

    /// Rounds the boxes outward relative to a given origin.
    pub fn about(name: impl Into<String>, boxes: &[WorldBox], origin: DVec3) -> Result<Scene> {
        let name = name.into();
        let rounded = |b: &WorldBox| Aabb::rounded_outward(b.min, b.max, origin);
        let items: Vec<Aabb> = boxes.iter().map(rounded).collect();
        let is_bad = |b: &Aabb| !b.is_finite() || b.is_empty();
        if let Some(item) = items.iter().position(is_bad) {
            let [min, max] = [boxes[item].min, boxes[item].max].map(|corner| corner.to_array());
            let found = format_args!("a box from {min:?} to {max:?}");
            let rule = "min <= max within the range of f32";
            return Err(bad_item(&name, item, found, rule));
        }
        Ok(Scene {
            bounds: Aabb::union_of(&items),
            originals: WrittenBoxes::of(boxes, &items, origin),
            name,
            origin,
            items,
            ..Scene::default()
        })
    }

    /// The bounds of all items in world coordinates.
    ///
    /// A unit box about the origin for a scene without items.
    pub fn world_bounds(&self) -> WorldBox {
        if self.bounds.is_empty() {
            return WorldBox::around(self.origin, DVec3::ONE);
        }
        let [min, max] = [self.bounds.min, self.bounds.max].map(|corner| corner.as_dvec3());
        WorldBox::new(self.origin + min, self.origin + max)
    }

    /// SHA-256 over the origin and the bounds of the items. O(n).
    ///
    /// Also over the boxes as written if f32 changes them: two scenes with the same digest pose the
    /// same queries to every structure, and the answers are compared with the same truth.
    pub fn digest(&self) -> String {
        let mut hash = hmac_sha256::Hash::new();
        let le_bytes = |corner: DVec3| corner.to_array().map(f64::to_le_bytes).concat();
        hash.update(le_bytes(self.origin));
        for corner in self.items.iter().flat_map(|b| [b.min, b.max]) {
            hash.update(corner.to_array().map(f32::to_le_bytes).concat());
        }
        if let Some(boxes) = self.originals.boxes() {
            hash.update("as written");
            let corners = boxes.iter().flat_map(|b| [b.min, b.max]);
            corners.for_each(|corner| hash.update(le_bytes(corner)));
        }
        hex(&hash.finalize())
    }
}

/// The origin for boxes, chosen by the finite ones.
///
/// Zero on every axis where translation would gain no more than about three bits: coordinates then
/// stay as written and exact ties stay ties. Otherwise the centre, rounded to a power of two near
/// the width, so that round coordinates stay round.
fn choose_origin(boxes: impl Iterator<Item = WorldBox>) -> DVec3 {
    let finite = boxes.filter(|b| b.min.is_finite() && b.max.is_finite());
    let bounds = WorldBox::union_of(finite);
    let (low, high) = (bounds.min, bounds.max);
    let axis = |k: usize| {
        let (width, centre) = (high[k] - low[k], low[k] / 2.0 + high[k] / 2.0);
        // An empty scene's width is -inf and its centre NaN.
        if centre.is_nan() || centre.abs() <= 4.0 * width {
            return 0.0;
        }
        let floor = centre.abs() * f64::EPSILON;
        let grid = libm::exp2(libm::floor(libm::log2(width.max(floor))));
        match grid {
            // Too close to zero for f64 to divide by.
            0.0 => 0.0,
            grid => (centre / grid).round() * grid,
        }
    };
    [0, 1, 2].map(axis).into()
}

/// The error of an item of a scene that was not read from a file.
fn bad_item(scene: &str, item: usize, found: fmt::Arguments, expected: &str) -> InputError {
    let place = format!("scene '{scene}', item {item}");
    InputError::new(format_args!("{place}: {found}; expected {expected}"))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn scene(min: f64, max: f64) -> Scene {
        let b = WorldBox::new(DVec3::splat(min), DVec3::splat(max));
        Scene::from_boxes("test", &[b]).unwrap()
    }

    #[test]
    fn a_scene_near_zero_keeps_its_coordinates() {
        let near = scene(-10.0, 1000.0);
        assert_eq!(near.origin, DVec3::ZERO);
        assert_eq!(near.items[0].max.x, 1000.0);
    }

    #[test]
    fn a_scene_far_from_zero_is_moved_and_loses_nothing() {
        let far = scene(1e9 + 0.25, 1e9 + 100.5);
        assert!((far.origin.x - 1e9).abs() < 200.0);
        assert_eq!(far.origin.x.fract(), 0.0);
        let world = far.world_bounds();
        assert_eq!((world.min.x, world.max.x), (1e9 + 0.25, 1e9 + 100.5));
        // One far point: width zero.
        assert!(scene(1e7, 1e7).items[0].min.x.abs() < 1.0);
    }

    #[test]
    fn a_flat_scene_next_to_zero_stays_there() {
        for power in [-1074, -1040, -1030, -1023, -1022, -1021, -1000, -300] {
            let at = -libm::exp2(f64::from(power));
            let scene = scene(at, at);
            assert!(scene.origin.is_finite(), "2^{power}: {}", scene.origin);
            assert_eq!(scene.written().next().unwrap().min.x, at, "2^{power}");
        }
    }

    #[test]
    fn boxes_that_f32_cannot_hold_are_named() {
        let ok = WorldBox::around(DVec3::ZERO, DVec3::ONE);
        let huge = WorldBox::around(DVec3::ZERO, DVec3::splat(1e40));
        let error = Scene::from_boxes("test", &[ok, huge]).unwrap_err();
        let wanted = "scene 'test', item 1: a box from";
        assert!(error.to_string().starts_with(wanted), "{error}");
    }

    #[test]
    fn the_digest_tells_scenes_apart() {
        assert_eq!(scene(0.0, 1.0).digest(), scene(0.0, 1.0).digest());
        assert_ne!(scene(0.0, 1.0).digest(), scene(0.0, 2.0).digest());
    }

    #[test]
    fn boxes_that_f32_holds_alike_are_other_questions_if_they_were_written_otherwise() {
        let (low, high) = (scene(0.0, 0.1), scene(0.0, 0.1f64.next_up()));
        assert_eq!((low.origin, &low.items), (high.origin, &high.items));
        assert_ne!(low.digest(), high.digest());
        // A third one: the box that f32 holds.
        let held = scene(0.0, low.items[0].max.x.into());
        assert_eq!(low.items, held.items);
        assert!(![low.digest(), high.digest()].contains(&held.digest()));
        // Its digest covers only origin and bounds.
        let mut bytes = vec![0; 24];
        for corner in [held.items[0].min, held.items[0].max] {
            bytes.extend(corner.to_array().map(f32::to_le_bytes).concat());
        }
        assert_eq!(held.digest(), hex(&hmac_sha256::Hash::hash(&bytes)));
    }
}
