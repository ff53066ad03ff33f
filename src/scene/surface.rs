//! Surfaces in addition to boxes: the triangles of items, their kinds and sides.
//!
//! Defines the form and its checks; generated triangles are in `meshes`.

use std::collections::HashMap;
use std::ops::Range;
use std::sync::Arc;

use glam::{DVec3, Vec3};

use super::{LoadOptions, Regions, Scene, WorldBox};
use crate::geometry::Aabb;
use crate::input::Result;
use crate::spec::SpecError;

named! {
    /// Effect of a surface on a ray.
    #[derive(Clone, Copy, PartialEq, Eq, Hash, Debug)]
    pub enum SurfaceKind {
        /// A ray ends there.
        Opaque = "opaque",
        /// A ray ends there or passes, decided by a mask of holes: leaves, fences.
        ///
        /// Assumed to hide nothing.
        CutOut = "cut-out",
        /// A ray passes, altered: glass, water.
        ///
        /// Assumed to hide nothing.
        Clear = "clear",
    }
}

/// Triangles, item by item.
///
/// Coordinates are f32 relative to an f64 origin; corners are counter-clockwise as seen from the
/// outside.
#[derive(Clone, Debug, Default)]
pub struct Surfaces {
    /// Origin of `points`, in world coordinates.
    pub origin: DVec3,
    /// Corners, scene-local. No two items share a point.
    pub points: Vec<Vec3>,
    /// Three indices into `points` each.
    pub triangles: Vec<[u32; 3]>,
    /// The triangles of each item: consecutive ranges without gaps.
    pub of_item: Vec<Range<u32>>,
    /// Kind of each triangle.
    pub kinds: Vec<SurfaceKind>,
    /// `true` for each triangle that is seen from both sides.
    pub two_sided: Vec<bool>,
    /// The points as written, in world coordinates; empty if `points` are exact.
    written: Vec<DVec3>,
}

/// The six faces of a box, two triangles each, by the corners of [`Aabb::corner`].
pub(super) const BOX: [[u32; 3]; 12] = {
    let mut triangles = [[0; 3]; 12];
    let mut axis = 0;
    while axis < 3 {
        // (axis, u, v) is right-handed, so u then v is counter-clockwise about +axis.
        let (k, u, v) = (1 << axis, 1 << ((axis + 1) % 3), 1 << ((axis + 2) % 3));
        triangles[4 * axis] = [k, k | u, k | u | v];
        triangles[4 * axis + 1] = [k, k | u | v, k | v];
        triangles[4 * axis + 2] = [0, u | v, u];
        triangles[4 * axis + 3] = [0, v, u | v];
        axis += 1;
    }
    triangles
};

impl Surfaces {
    /// No items yet.
    pub fn about(origin: DVec3) -> Surfaces {
        Surfaces {
            origin,
            ..Surfaces::default()
        }
    }

    /// Boxes as written, each as twelve opaque one-sided triangles. O(n).
    ///
    /// Rounded outward relative to an origin, and as flat as written. No face moves to the other
    /// side of the origin.
    pub fn of_boxes_about<'b>(
        origin: DVec3,
        boxes: impl Iterator<Item = &'b WorldBox>,
    ) -> Surfaces {
        let mut all = Surfaces::about(origin);
        for b in boxes {
            let mut rounded = Aabb::rounded_outward(b.min, b.max, origin);
            for axis in (0..3).filter(|&axis| b.min[axis] == b.max[axis]) {
                rounded.max[axis] = rounded.min[axis];
            }
            all.push_box(SurfaceKind::Opaque, &rounded);
        }
        all
    }

    /// The opaque triangles of an item, as the only item.
    ///
    /// Only the one-sided ones if all together are not closed. Points at one position are merged:
    /// files have several, one for each normal.
    ///
    /// # Panics
    /// If there is no such item.
    pub fn solid_part(&self, item: usize) -> Surfaces {
        let opaque = self.range(item);
        let opaque = opaque.filter(|&at| self.kinds[at] == SurfaceKind::Opaque);
        let opaque: Vec<usize> = opaque.collect();
        let part = |sides: [bool; 2]| {
            let (mut places, mut points) = (HashMap::new(), Vec::new());
            let is_own = |at: &&usize| sides.contains(&self.two_sided[**at]);
            let own = opaque.iter().filter(is_own);
            let triangles = own.map(|&at| {
                self.corners(at as u32).map(|p| {
                    // Adding 0.0 removes negative zeros.
                    let place = places.entry((p + 0.0).to_array().map(f32::to_bits));
                    *place.or_insert_with(|| {
                        points.push(p);
                        points.len() as u32 - 1
                    })
                })
            });
            let triangles: Vec<[u32; 3]> = triangles.collect();
            let mut part = Surfaces::about(self.origin);
            part.push(SurfaceKind::Opaque, false, &points, &triangles);
            part
        };
        let all = part([false, true]);
        match all.open_edges(0) {
            0 => all,
            _ => part([false, false]),
        }
    }

    /// Appends the twelve one-sided triangles of a scene-local box as an item.
    pub fn push_box(&mut self, kind: SurfaceKind, item: &Aabb) {
        let corners: [Vec3; 8] = std::array::from_fn(|i| item.corner(i));
        self.push(kind, false, &corners, &BOX);
    }

    /// Appends an item of one kind; `triangles` are indices into its own `points`.
    ///
    /// # Panics
    /// If an index is beyond `points`, or the sums do not fit u32.
    pub fn push(
        &mut self,
        kind: SurfaceKind,
        two_sided: bool,
        points: &[Vec3],
        triangles: &[[u32; 3]],
    ) {
        let first = u32::try_from(self.points.len()).expect("points are counted in u32");
        let start = self.triangles.len() as u32;
        u32::try_from(self.points.len() + points.len()).expect("points are counted in u32");
        self.points.extend_from_slice(points);
        self.triangles.extend(triangles.iter().map(|corners| {
            corners.map(|corner| {
                assert!((corner as usize) < points.len(), "a corner without a point");
                first + corner
            })
        }));
        let end = u32::try_from(self.triangles.len()).expect("triangles are counted in u32");
        self.of_item.push(start..end);
        self.kinds.resize(end as usize, kind);
        self.two_sided.resize(end as usize, two_sided);
    }

    /// Sets the kind and sides of each of the last triangles.
    pub(super) fn set_last(&mut self, kinds: &[SurfaceKind], two_sided: &[bool]) {
        let first = self.kinds.len() - kinds.len();
        self.kinds[first..].copy_from_slice(kinds);
        self.two_sided[first..].copy_from_slice(two_sided);
    }

    /// Appends an opaque item by its points in world coordinates.
    ///
    /// For all items of a surface or for none.
    pub(super) fn push_written(&mut self, points: &[DVec3], triangles: &[[u32; 3]]) {
        let local = points.iter().map(|p| (p - self.origin).as_vec3());
        let local: Vec<Vec3> = local.collect();
        self.push(SurfaceKind::Opaque, false, &local, triangles);
        self.written.extend_from_slice(points);
    }

    /// Number of items.
    pub fn items(&self) -> usize {
        self.of_item.len()
    }

    /// The corners of a triangle, scene-local.
    #[inline(always)]
    pub fn corners(&self, triangle: u32) -> [Vec3; 3] {
        let [a, b, c] = self.triangles[triangle as usize];
        let point = |at: u32| self.points[at as usize];
        [point(a), point(b), point(c)]
    }

    /// The triangles of an item, as corners.
    pub fn of(&self, item: usize) -> impl Iterator<Item = [Vec3; 3]> {
        self.of_item[item].clone().map(|t| self.corners(t))
    }

    /// The triangles of an item, split where kind or sides change.
    pub fn runs(&self, item: usize) -> impl Iterator<Item = Range<u32>> {
        let mut rest = self.of_item[item].clone();
        let fact = |t: u32| (self.kinds[t as usize], self.two_sided[t as usize]);
        std::iter::from_fn(move || {
            let first = rest.start;
            let end = rest.clone().find(|&t| fact(t) != fact(first));
            rest.start = end.unwrap_or(rest.end);
            (first < rest.start).then_some(first..rest.start)
        })
    }

    /// The item that a triangle belongs to. O(log items).
    pub fn item_of(&self, triangle: u32) -> usize {
        self.of_item.partition_point(|range| range.end <= triangle)
    }

    /// The smallest box that holds an item; empty for an item without triangles.
    pub fn bounds(&self, item: usize) -> Aabb {
        Aabb::of_points(self.of(item).flatten())
    }

    /// Smallest box in world coordinates that contains triangles as written.
    fn world_box(&self, triangles: &Range<u32>) -> WorldBox {
        let corners = self.triangles[triangles.start as usize..triangles.end as usize].iter();
        let corner = |&at: &u32| match self.written.get(at as usize) {
            Some(point) => WorldBox::at(*point),
            None => {
                let point = self.points[at as usize];
                WorldBox::of(&Aabb::new(point, point), self.origin)
            }
        };
        WorldBox::union_of(corners.flatten().map(corner))
    }

    /// The scene of these triangles.
    ///
    /// Its items are the smallest f32 boxes that contain the triangles of each item as written.
    ///
    /// # Errors
    /// An item without triangles, which has no box.
    pub fn into_scene(self, name: impl Into<String>) -> Result<Scene> {
        let boxes: Vec<_> = self.of_item.iter().map(|t| self.world_box(t)).collect();
        let scene = Scene::about(name, &boxes, self.origin)?;
        Ok(Scene {
            surfaces: Some(Arc::new(self)),
            ..scene
        })
    }

    /// Number of open edges of an item.
    ///
    /// Open: not traversed equally often in both directions. Zero for closed, consistently wound
    /// surfaces. Edges are identified by their indices. O(t log t).
    pub fn open_edges(&self, item: usize) -> usize {
        let triangles = self.triangles[self.range(item)].iter();
        let edges = triangles.flat_map(|&[a, b, c]| [(a, b), (b, c), (c, a)]);
        let edges = edges.filter(|(a, b)| a != b);
        let edges = edges.map(|(a, b)| ([a.min(b), a.max(b)], a < b));
        let mut edges: Vec<([u32; 2], bool)> = edges.collect();
        edges.sort_unstable();
        let is_open = |run: &&[([u32; 2], bool)]| {
            2 * run.iter().filter(|(_, upward)| *upward).count() != run.len()
        };
        edges.chunk_by(|a, b| a.0 == b.0).filter(is_open).count()
    }

    /// The triangles of an item as a range of indices.
    pub(crate) fn range(&self, item: usize) -> Range<usize> {
        let range = &self.of_item[item];
        range.start as usize..range.end as usize
    }
}

impl Scene {
    /// Shape of the items.
    pub fn item_shape(&self) -> ItemShape {
        match (&self.surfaces, &self.regions) {
            (Some(_), _) => ItemShape::Mesh,
            (None, Regions::Bsp(_)) => ItemShape::Wall,
            (None, _) => ItemShape::Box,
        }
    }

    /// The same triangles, one item each, with the labels of their items.
    ///
    /// # Errors
    /// A scene without triangles, or one that does not fit into memory.
    pub fn by_triangle(self, options: &LoadOptions) -> Result<Scene> {
        let Some(surfaces) = &self.surfaces else {
            return Err(SpecError::new(format_args!(
                "{}: no triangles; expected a scene with them for --items triangles",
                self.name
            ))
            .into());
        };
        let count = surfaces.triangles.len() as u64;
        options.check_fits(&self.name, Some(count), count)?;
        let mut single = Surfaces::about(surfaces.origin);
        let mut boxes = Vec::with_capacity(surfaces.triangles.len());
        let mut items = Vec::with_capacity(surfaces.triangles.len());
        for item in 0..surfaces.items() {
            for triangle in surfaces.of_item[item].clone() {
                let at = triangle as usize;
                let (kind, two_sided) = (surfaces.kinds[at], surfaces.two_sided[at]);
                single.push(kind, two_sided, &surfaces.corners(triangle), &[[0, 1, 2]]);
                boxes.push(surfaces.world_box(&(triangle..triangle + 1)));
                items.push(item as u32);
            }
        }
        let labels = self.labels.iter().map(|labels| labels.of(&items));
        Ok(Scene {
            up: self.up,
            unit: self.unit,
            labels: labels.collect(),
            places: self.places,
            animation: self.animation,
            surfaces: Some(Arc::new(single)),
            ..Scene::about(self.name, &boxes, surfaces.origin)?
        })
    }
}

/// The points of triangles, each once, in the order of occurrence.
///
/// The triangles become indices into them. `places` may hold anything that another call left.
pub(super) fn own_points(
    points: &[DVec3],
    triangles: &mut [[u32; 3]],
    places: &mut Vec<u32>,
) -> Vec<DVec3> {
    const NONE: u32 = u32::MAX;
    places.resize(points.len(), NONE);
    let mut own = Vec::new();
    for corner in triangles.as_flattened_mut() {
        let place = &mut places[*corner as usize];
        if *place == NONE {
            *place = own.len() as u32;
            own.push(*corner);
        }
        *corner = *place;
    }
    let point = |at: u32| {
        places[at as usize] = NONE;
        points[at as usize]
    };
    own.into_iter().map(point).collect()
}

/// Volume within a closed surface, cubic world units, rounded.
///
/// Positive if it is wound outward.
pub fn volume_within(triangles: impl Iterator<Item = [Vec3; 3]>) -> f64 {
    let mut triangles = triangles.peekable();
    let Some(&[zero, ..]) = triangles.peek() else {
        return 0.0;
    };
    let six = triangles.map(|corners| {
        let [a, b, c] = corners.map(|p| p.as_dvec3() - zero.as_dvec3());
        a.dot(b.cross(c))
    });
    six.sum::<f64>() / 6.0
}

named! {
    /// Content of the box of an item.
    #[derive(Clone, Copy, PartialEq, Eq, Hash, Debug)]
    pub enum ItemShape {
        /// The box itself, solid.
        Box = "solid boxes",
        /// Walls of a linedef, or the sprite of a thing.
        Wall = "walls",
        /// Triangles: [`Scene::surfaces`].
        Mesh = "triangles",
    }
}

#[cfg(test)]
mod tests {
    use super::super::load;
    use super::*;

    impl Surfaces {
        /// The box surfaces of a scene's items, in their smallest f32 boxes.
        pub fn from_boxes(scene: &Scene) -> Surfaces {
            let mut all = Surfaces::about(scene.origin);
            let push = |b| all.push_box(SurfaceKind::Opaque, b);
            scene.items.iter().for_each(push);
            all
        }

        /// Volume of an item, from [`volume_within`] its surface.
        pub fn volume(&self, item: usize) -> f64 {
            volume_within(self.of(item))
        }
    }

    #[test]
    fn the_solid_part_of_a_solid_item_has_all_of_its_triangles() {
        let scene = load("mesh:spheres:n=5k", &Default::default()).unwrap();
        let mesh = scene.surfaces.as_ref().unwrap();
        for item in [2, 0] {
            let part = mesh.solid_part(item);
            assert_eq!(part.items(), 1);
            assert!(part.of(0).eq(mesh.of(item)));
            assert_eq!(part.open_edges(0), 0);
        }
    }

    /// A cube as exporters write it: corners per face, and a degenerate triangle.
    #[test]
    fn a_body_of_several_points_per_place_is_closed() {
        let unit = Aabb::new(Vec3::ZERO, Vec3::ONE);
        // Zero and negative zero are one position.
        let sign = [Vec3::ONE, Vec3::NEG_ONE];
        let split = BOX.as_flattened().iter().zip(sign.iter().cycle());
        let split = split.map(|(&i, sign)| {
            let p = unit.corner(i as usize);
            Vec3::select(p.cmpeq(Vec3::ZERO), p * *sign, p)
        });
        let mut points: Vec<Vec3> = split.collect();
        points.extend([points[0], points[0], points[1]]);
        let triangles: Vec<[u32; 3]> = (0..13).map(|t| [3 * t, 3 * t + 1, 3 * t + 2]).collect();
        let mut surfaces = Surfaces::about(DVec3::ZERO);
        surfaces.push(SurfaceKind::Opaque, true, &points, &triangles);
        surfaces.push(SurfaceKind::Opaque, true, &points, &triangles[1..]);
        assert_eq!(
            (
                surfaces.solid_part(0).open_edges(0),
                surfaces.solid_part(0).points.len()
            ),
            (0, 8)
        );
        // Two-sided open triangles do not count.
        assert!(surfaces.solid_part(1).triangles.is_empty());
    }

    #[test]
    fn boxes_are_closed_and_wound_outward() {
        let scene = load("city:n=50,offset=1e7", &Default::default()).unwrap();
        let surfaces = Surfaces::from_boxes(&scene);
        assert_eq!(surfaces.triangles.len(), 12 * 50);
        for (item, b) in scene.items.iter().enumerate() {
            assert_eq!(surfaces.open_edges(item), 0);
            let size = b.max.as_dvec3() - b.min.as_dvec3();
            let volume = size.x * size.y * size.z;
            assert!((surfaces.volume(item) - volume).abs() <= 1e-9 * volume);
            assert_eq!(surfaces.bounds(item), *b);
            // For every triangle the centre is behind it.
            for [p, q, r] in surfaces.of(item).map(|c| c.map(Vec3::as_dvec3)) {
                let normal = (q - p).cross(r - p);
                assert!(normal.dot(b.centre().as_dvec3() - p) < 0.0);
            }
        }
        let again = surfaces.into_scene("again").unwrap();
        assert_eq!(again.items, scene.items);
    }

    #[test]
    fn an_open_or_twisted_surface_is_told() {
        let mut surfaces = Surfaces::about(DVec3::ZERO);
        let unit = Aabb::new(Vec3::ZERO, Vec3::ONE);
        let corners: [Vec3; 8] = std::array::from_fn(|i| unit.corner(i));
        surfaces.push(SurfaceKind::Opaque, false, &corners, &BOX[..11]);
        let mut twisted = BOX;
        twisted[3].swap(0, 1);
        surfaces.push(SurfaceKind::Clear, true, &corners, &twisted);
        assert_eq!(surfaces.open_edges(0), 3);
        assert!(surfaces.open_edges(1) > 0);
        let owners: Vec<usize> = (0..23).map(|t| surfaces.item_of(t)).collect();
        assert!(owners[..11].iter().all(|&item| item == 0));
        assert!(owners[11..].iter().all(|&item| item == 1));
    }

    #[test]
    fn shapes_are_those_of_their_sources() {
        for (source, shape) in [
            ("city:n=10", ItemShape::Box),
            ("rooms:n=10", ItemShape::Box),
            ("freedm-map12", ItemShape::Wall),
            ("mesh:spheres:n=2000", ItemShape::Mesh),
        ] {
            let scene = load(source, &Default::default()).unwrap();
            assert_eq!(scene.item_shape(), shape, "{source}");
            // A boxes file contains boxes.
            let settled = scene.settled().unwrap();
            assert_eq!(settled.item_shape(), ItemShape::Box, "{source}");
        }
    }
}
