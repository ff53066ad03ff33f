//! Inner boxes: axis-aligned boxes inside closed meshes, used as occluders.
//!
//! A search on a voxel grid proposes boxes (`cells`); exact tests prove that no triangle enters
//! them and that they are inside. (Silvennoinen, Saransaari, Laine and Lehtinen 2014, "Occluder
//! simplification using planar sections", name the voxel approach.)

mod cells;

use std::collections::BTreeMap;
use std::time::Instant;

use glam::{DVec3, Vec3};
use serde::Serialize;

use super::inner_boxes::cells::Grid;
use crate::arithmetic::Expansion;
use crate::geometry::Aabb;
use crate::query::ItemId;
use crate::scene::{Surfaces, WorldBox, volume_within};
use crate::threads;
use crate::visibility::region::without;
use crate::visibility::triangle::{Eye, faces, normal};

pub(crate) use super::inner_boxes::cells::Cells;

/// Boxes proven to be inside an item.
#[derive(Clone, PartialEq, Debug)]
pub struct InnerBoxes {
    /// Scene-local and overlapping, largest gain first.
    ///
    /// The open interior of each box is disjoint from the surface component that it lies in.
    pub boxes: Vec<Aabb>,
    /// Volume of the boxes / `volume`; overlapping components count twice.
    pub share: f64,
    /// Volume enclosed by the opaque triangles.
    pub volume: f64,
}

/// Default number of grid cells along each axis.
pub const CELLS: usize = 24;

/// Most boxes per item: each costs time in every view.
pub const MOST_BOXES: usize = 16;

/// Default number of boxes per item.
pub const BOXES: usize = 8;

/// Least share of the item's volume that a box must add.
const LEAST_GAIN: f64 = 1.0 / 64.0;

/// Number of attempts per box; it shrinks after each failed proof.
const MAX_TRIES: usize = 4;

/// Finds up to `most` (at most [`MOST_BOXES`]) large boxes inside an item.
///
/// Each is made of whole cells of a grid with `cells` (4 to 64) per axis over a connected
/// component; the largest gains win. Only opaque triangles count; `None` if these are not closed or
/// no box is found. O(t + cells⁴) per box.
pub fn inner_boxes_of(
    surfaces: &Surfaces,
    item: usize,
    cells: usize,
    most: usize,
) -> Option<InnerBoxes> {
    let solid = surfaces.solid_part(item);
    if solid.triangles.is_empty() || solid.open_edges(0) != 0 {
        return None;
    }
    let most = most.min(MOST_BOXES);
    let (parts, cells) = (parts(&solid), cells.clamp(4, 64));
    let volume_of = |part: &Vec<[Vec3; 3]>| volume_within(part.iter().copied());
    // Components that are wound inward hold no box.
    let inward: f64 = parts.iter().map(|part| volume_of(part).min(0.0)).sum();
    let volume = volume_within(solid.of(0)) - inward;
    let least = volume * LEAST_GAIN;
    // A box cannot add more than the volume of its component.
    let large = |part: &&Vec<[Vec3; 3]>| volume_of(part) >= least;
    let large = parts.iter().filter(large);
    let found = large.flat_map(|part| boxes_in(part, cells, most, least));
    let mut found: Vec<(f64, Aabb)> = found.collect();
    found.sort_by(|a, b| b.0.total_cmp(&a.0));
    found.truncate(most);
    let share = found.iter().map(|(gain, _)| gain).sum::<f64>() / volume;
    let boxes: Vec<Aabb> = found.into_iter().map(|(_, b)| b).collect();
    (!boxes.is_empty()).then_some(InnerBoxes {
        boxes,
        share,
        volume,
    })
}

/// Boxes in one connected closed component, each with the volume it adds.
///
/// At most `most`; each adds at least `least`.
fn boxes_in(part: &[[Vec3; 3]], cells: usize, most: usize, least: f64) -> Vec<(f64, Aabb)> {
    let bounds = Aabb::of_points(part.iter().flatten().copied());
    // The component is itself a box, like many walls and houses.
    if is_in(part, &bounds) {
        return vec![(volume(&WorldBox::of(&bounds, DVec3::ZERO)), bounds)];
    }
    let mut found: Vec<(f64, Aabb)> = Vec::new();
    let grid = Grid::of(part, cells);
    let mut inside = grid.cells(part);
    let tried = std::iter::from_fn(|| inside.next_box(0..cells));
    for (_, tried) in tried.take(most) {
        let [low, high] = tried.map(|cell| grid.corner(cell));
        let Some(prove) = prove(part, Aabb::new(low, high)) else {
            continue;
        };
        let exact = |b| WorldBox::of(b, DVec3::ZERO);
        let mut rest = vec![exact(&prove)];
        for (_, other) in &found {
            let other = exact(other);
            rest = rest.iter().flat_map(|b| without(b, &other)).collect();
        }
        let gain = rest.iter().map(volume).sum();
        if gain < least {
            break;
        }
        found.push((gain, prove));
    }
    found
}

/// Shrinks a box about its centre until it is proven inside; else `None`.
fn prove(part: &[[Vec3; 3]], mut tried: Aabb) -> Option<Aabb> {
    for _ in 0..MAX_TRIES {
        if !tried.is_empty() && is_in(part, &tried) {
            return Some(tried);
        }
        let less = tried.extent() / 8.0;
        tried = Aabb::new(tried.min + less, tried.max - less);
    }
    None
}

fn volume(b: &WorldBox) -> f64 {
    (b.max - b.min).element_product()
}

/// Splits an only item into connected components.
///
/// Components of a closed surface are closed, and may overlap.
fn parts(surfaces: &Surfaces) -> Vec<Vec<[Vec3; 3]>> {
    let triangles = &surfaces.triangles;
    // Union-find with path halving; the lowest point represents its component.
    let mut parent: Vec<u32> = (0..surfaces.points.len() as u32).collect();
    fn root(parent: &mut [u32], mut at: u32) -> u32 {
        while parent[at as usize] != at {
            parent[at as usize] = parent[parent[at as usize] as usize];
            at = parent[at as usize];
        }
        at
    }
    for [a, b, c] in triangles {
        for other in [b, c] {
            let [a, b] = [a, other].map(|p| root(&mut parent, *p));
            parent[a.max(b) as usize] = a.min(b);
        }
    }
    let mut parts: BTreeMap<u32, Vec<[Vec3; 3]>> = BTreeMap::new();
    for corners in triangles {
        let piece = root(&mut parent, corners[0]);
        let corners = corners.map(|p| surfaces.points[p as usize]);
        parts.entry(piece).or_default().push(corners);
    }
    parts.into_values().collect()
}

/// Statistics of the boxes inside the items of a mesh.
#[derive(Clone, PartialEq, Debug, Serialize)]
pub struct InnerBoxStats {
    /// Items of the mesh.
    pub item_count: usize,
    /// Items with an inner box: opaque, closed, and large enough for one.
    pub boxed_count: usize,
    /// Most boxes per item.
    pub box_limit: usize,
    /// Number of boxes in all items.
    pub box_count: usize,
    /// Volume of the boxes / volume of the items that have one; null if none has.
    ///
    /// Overlapping components count twice.
    pub volume_share: Option<f64>,
    /// Wall time of finding and proving all boxes.
    pub build_ns: f64,
}

/// Inner boxes of each item of a mesh, as found by [`inner_boxes_of`].
///
/// Pairs of item and box by ascending item, scene-local. Independent of the number of threads.
pub fn inner_boxes(
    surfaces: &Surfaces,
    cells: usize,
    most: usize,
    threads: usize,
) -> (Vec<(ItemId, Aabb)>, InnerBoxStats) {
    let begun = Instant::now();
    let boxes_of = |item| inner_boxes_of(surfaces, item, cells, most);
    let found = threads::map(threads, 0..surfaces.items(), boxes_of);
    let (mut boxes, mut boxed_count) = (Vec::new(), 0);
    let [mut inner, mut whole] = [0.0, 0.0];
    for (item, found) in (0..).zip(&found) {
        let Some(found) = found else { continue };
        inner += found.share * found.volume;
        whole += found.volume;
        boxed_count += 1;
        boxes.extend(found.boxes.iter().map(|b| (item, *b)));
    }
    let row = InnerBoxStats {
        item_count: surfaces.items(),
        boxed_count,
        box_limit: most,
        box_count: boxes.len(),
        volume_share: (boxed_count > 0).then(|| inner / whole),
        build_ns: begun.elapsed().as_nanos() as f64,
    };
    (boxes, row)
}

/// Returns `true` if the open box is inside a closed component.
pub fn is_in(part: &[[Vec3; 3]], inner: &Aabb) -> bool {
    let is_apart = part.iter().all(|corners| is_outside(*corners, inner));
    // No surface crosses the open box, so one point decides for all of it.
    is_apart && winding(part, inner).is_some_and(|turns| turns > 0)
}

/// Returns `true` if a triangle and an open box are disjoint, exactly.
///
/// Tests the thirteen separating axes (Akenine-Möller 2001) by comparisons and orientations.
fn is_outside(corners: [Vec3; 3], b: &Aabb) -> bool {
    let [p, q, r] = corners;
    let (low, high) = (p.min(q).min(r), p.max(q).max(r));
    if high.cmple(b.min).any() || low.cmpge(b.max).any() {
        return true;
    }
    // A triangle without area has no plane to separate by.
    let on_plane = normal(corners) != DVec3::ZERO
        && [[p, q, r], [p, r, q]]
            .into_iter()
            .any(|triangle| (0..8).all(|i| !faces(&Eye::local(b.corner(i).as_dvec3()), triangle)));
    // Edges against the box's axes: in the projection along an axis, an edge separates if the
    // rectangle and the triangle lie on different sides of its line.
    on_plane
        || (0..3).any(|axis| {
            let flat = |v: Vec3| [v[(axis + 1) % 3], v[(axis + 2) % 3]];
            (0..3).any(|k| {
                let [a, b0, c] = [k, k + 1, k + 2].map(|i| flat(corners[i % 3]));
                let own = turn(a, b0, c);
                let sides = (0..8).map(|i| turn(a, b0, flat(b.corner(i))));
                let [mut left, mut right] = [own >= 0, own <= 0];
                for side in sides {
                    left &= side <= 0;
                    right &= side >= 0;
                }
                // If the triangle projects to a line, either side will do; if the edge projects to
                // a point, it has no line.
                (left || right) && a != b0
            })
        })
}

/// Orientation of `a`, `b`, `c`, exact: 1 if they turn left, -1 right, 0 collinear.
pub fn turn(a: [f32; 2], b: [f32; 2], c: [f32; 2]) -> i32 {
    let [[ax, ay], [bx, by], [cx, cy]] = [a, b, c].map(|p| p.map(f64::from));
    let (left, right) = ((bx - ax) * (cy - ay), (by - ay) * (cx - ax));
    let side = left - right;
    // Shewchuk 1997 proves an error factor of (3 + 16 * 2^-53) * 2^-53; this is 8 * 2^-53.
    if side.abs() > (left.abs() + right.abs()) * (4.0 * f64::EPSILON) {
        return if side > 0.0 { 1 } else { -1 };
    }
    let minus = |p: f64, q: f64| &Expansion::from(p) - &Expansion::from(q);
    (&(&minus(bx, ax) * &minus(cy, ay)) - &(&minus(by, ay) * &minus(cx, ax))).sign()
}

/// Winding number of a closed surface about a point in the box.
///
/// Counts crossings of an upward ray; `None` if each of the rays tried meets an edge.
fn winding(part: &[[Vec3; 3]], inner: &Aabb) -> Option<i32> {
    let (low, size) = (inner.min.as_dvec3(), inner.extent().as_dvec3());
    // Positions that are unlikely to lie below a corner.
    (1..16).find_map(|k| {
        let within = |step: f64| (0.5 + f64::from(k) * step).fract() * 0.8 + 0.1;
        let at = DVec3::new(within(0.381_966), within(0.237_512), 0.5);
        let from = (low + size * at).as_vec3();
        if !(from.cmpgt(inner.min).all() && from.cmplt(inner.max).all()) {
            return None;
        }
        let eye = Eye::local(from.as_dvec3());
        let mut turns = 0;
        for &[a, b, c] in part {
            let (low, high) = (a.min(b).min(c), a.max(b).max(c));
            let is_aside = low.x > from.x || high.x < from.x || low.y > from.y || high.y < from.y;
            if is_aside || high.z < from.z {
                continue;
            }
            let flat = |v: Vec3| [v.x, v.y];
            let sides = [(a, b), (b, c), (c, a)].map(|(p, q)| turn(flat(p), flat(q), flat(from)));
            let (some_left, some_right) = (sides.contains(&1), sides.contains(&-1));
            if some_left && some_right {
                continue;
            }
            if sides.contains(&0) {
                return None;
            }
            // An upward ray leaves the surface through a triangle that faces up and lies above the
            // point: the point is then behind the triangle.
            let is_in_front = faces(&eye, [a, b, c]);
            turns += i32::from(some_left) - i32::from(is_in_front);
        }
        Some(turns)
    })
}

#[cfg(test)]
mod tests {
    use glam::DVec3;

    use super::*;
    use crate::scene::{Family, SeededRng, SurfaceKind, load};

    /// Returns `true` if the open box is inside one piece of a closed item, exactly.
    fn is_inside(surfaces: &Surfaces, item: usize, inner: &Aabb) -> bool {
        let parts = parts(&surfaces.solid_part(item));
        parts.iter().any(|part| is_in(part, inner))
    }

    fn mesh(name: &str, triangles: usize) -> Surfaces {
        let family = Family::named(&format!("mesh:{name}"));
        family.unwrap().mesh(triangles, 3)
    }

    #[test]
    fn boxes_are_found_and_are_inside() {
        let statue = mesh("statue", 5000);
        let found = inner_boxes_of(&statue, 0, CELLS, MOST_BOXES).unwrap();
        assert!(found.share > 0.45 && found.share < 1.0, "{found:?}");
        // Independent check: from random points of the boxes the surface is all around.
        let mut rng = SeededRng::new(1);
        for place in 0..100 {
            let b = &found.boxes[place % found.boxes.len()];
            let p = b.min.as_dvec3() + rng.point() * b.extent().as_dvec3();
            let angle: f64 = statue
                .of(0)
                .map(|corners| solid_angle(corners.map(|c| c.as_dvec3() - p)))
                .sum();
            assert!((angle / (2.0 * std::f64::consts::TAU) - 1.0).abs() < 1e-6);
        }
        // Independent check: points of the statue's own box estimate the boxes' joint volume.
        let bounds = statue.bounds(0);
        let size = bounds.max.as_dvec3() - bounds.min.as_dvec3();
        let held = (0..100_000).filter(|_| {
            let p = bounds.min.as_dvec3() + rng.point() * size;
            let holds =
                |b: &Aabb| p.cmpge(b.min.as_dvec3()).all() && p.cmple(b.max.as_dvec3()).all();
            found.boxes.iter().any(holds)
        });
        let share = held.count() as f64 / 1e5 * size.x * size.y * size.z / statue.volume(0);
        assert!(
            (share / found.share - 1.0).abs() < 0.02,
            "{share} {}",
            found.share
        );
        let spheres = mesh("spheres", 5 * 1280);
        for item in 0..spheres.items() {
            // The cube inscribed in a ball has 2 / (sqrt(3) pi) = 37 % of its volume.
            let found = inner_boxes_of(&spheres, item, CELLS, MOST_BOXES).unwrap();
            let whole = spheres.volume(item);
            let first = volume(&WorldBox::of(&found.boxes[0], DVec3::ZERO)) / whole;
            assert!(first > 0.25 && first < 0.37, "{first}");
            assert!(found.share > 0.6 && found.share < 1.0, "{found:?}");
        }
    }

    /// Solid angle seen from the origin (van Oosterom and Strackee 1983).
    fn solid_angle([a, b, c]: [DVec3; 3]) -> f64 {
        let lengths = [a, b, c].map(DVec3::length);
        let [x, y, z] = lengths;
        let below = x * y * z + a.dot(b) * z + b.dot(c) * x + c.dot(a) * y;
        2.0 * libm::atan2(a.dot(b.cross(c)), below)
    }

    #[test]
    fn a_box_a_step_too_large_has_no_proof() {
        let scene = load("city:n=20", &Default::default()).unwrap();
        let surfaces = Surfaces::from_boxes(&scene);
        for (item, b) in scene.items.iter().enumerate() {
            assert!(is_inside(&surfaces, item, b), "the open box itself");
            let mut larger = *b;
            larger.max[item % 3] = larger.max[item % 3].next_up();
            assert!(!is_inside(&surfaces, item, &larger));
            let away = b.max + 1.0;
            assert!(!is_inside(&surfaces, item, &Aabb::new(away, away + 1.0)));
            let share = inner_boxes_of(&surfaces, item, 8, 1).unwrap().share;
            assert!((share - 1.0).abs() < 1e-9, "all of a box: {share}");
        }
    }

    #[test]
    fn only_closed_opaque_items_have_one() {
        let forest = mesh("forest", 20_000);
        let (boxes, row) = inner_boxes(&forest, 12, BOXES, 1);
        assert_eq!(boxes, inner_boxes(&forest, 12, BOXES, 3).0);
        let mut trees: Vec<ItemId> = boxes.iter().map(|(item, _)| *item).collect();
        trees.dedup();
        let is_tree = |item: &ItemId| forest.of_item[*item as usize].len() == 118;
        assert!(trees.is_sorted() && trees.iter().all(is_tree));
        assert!(trees.len() > 20 && trees.len() == row.boxed_count);
        for (item, inner) in &boxes {
            assert!(is_inside(&forest, *item as usize, inner));
        }
        let share = row.volume_share.unwrap();
        assert!(share > 0.2 && share < 1.0, "{share}");
        let (_, ground) = inner_boxes(&mesh("terrain", 2000), CELLS, BOXES, 1);
        assert_eq!((ground.boxed_count, ground.volume_share), (0, None));
    }

    #[test]
    fn a_piece_wound_inward_takes_nothing_from_the_share() {
        let mut house = Surfaces::about(DVec3::ZERO);
        let at = |x: f32| Aabb::new(Vec3::X * x, Vec3::X * x + Vec3::splat(4.0));
        house.push_box(SurfaceKind::Opaque, &at(0.0));
        let alone = inner_boxes_of(&house, 0, 8, 2);
        let (first, end) = (house.triangles.len(), house.of_item[0].end);
        house.push_box(SurfaceKind::Opaque, &at(9.0));
        house.triangles[first..]
            .iter_mut()
            .for_each(|t| t.swap(0, 1));
        house.of_item.truncate(1);
        house.of_item[0].end = 2 * end;
        assert_eq!(inner_boxes_of(&house, 0, 8, 2), alone);
    }

    #[test]
    fn a_pane_on_a_house_takes_none_of_its_boxes() {
        let mut house = Surfaces::about(DVec3::ZERO);
        let walls = Aabb::new(Vec3::ZERO, Vec3::splat(4.0));
        house.push_box(SurfaceKind::Opaque, &walls);
        let whole = inner_boxes_of(&house, 0, 8, 1);
        assert_eq!(whole.as_ref().unwrap().volume, 64.0);
        // Adds glass copies of the first two triangles.
        house.triangles.extend_from_within(..2);
        house.of_item[0].end += 2;
        house.kinds.extend([SurfaceKind::Clear; 2]);
        house.two_sided.extend([true; 2]);
        assert_eq!(inner_boxes_of(&house, 0, 8, 1), whole);
        assert_eq!(
            inner_boxes(&house, 8, 1, 1).1.volume_share,
            Some(whole.unwrap().share)
        );
        // A wall of glass leaves the house open.
        house.kinds[0] = SurfaceKind::Clear;
        assert_eq!(inner_boxes_of(&house, 0, 8, 1), None);
    }

    #[test]
    fn separation_is_what_clipping_says() {
        // Clips the triangle by the six planes in f64: a remainder means common points.
        let unit = Aabb::new(Vec3::splat(-1.0), Vec3::ONE);
        let mut rng = SeededRng::new(4);
        let (mut apart, mut by_edge) = (0, 0);
        for _ in 0..20_000 {
            let centre = rng.normal3();
            let corners = [0; 3].map(|_| (centre + rng.normal3() * 1.5).as_vec3());
            let mut polygon = corners.map(Vec3::as_dvec3).to_vec();
            for plane in 0..6 {
                let (axis, sign) = (plane / 2, if plane % 2 == 0 { 1.0 } else { -1.0 });
                let side = |p: DVec3| 1.0 - p[axis] * sign;
                let mut cut = Vec::new();
                for (i, &p) in polygon.iter().enumerate() {
                    let q = polygon[(i + 1) % polygon.len()];
                    if side(p) > 0.0 {
                        cut.push(p);
                    }
                    if (side(p) > 0.0) != (side(q) > 0.0) {
                        cut.push(p + (q - p) * (side(p) / (side(p) - side(q))));
                    }
                }
                polygon = cut;
            }
            let is_apart = is_outside(corners, &unit);
            assert_eq!(is_apart, polygon.is_empty(), "{corners:?}");
            let [a, b, c] = corners;
            let bounds = Aabb::new(a.min(b).min(c), a.max(b).max(c));
            apart += u32::from(is_apart);
            by_edge += u32::from(is_apart && bounds.intersects(&unit));
        }
        assert!(apart > 1000 && by_edge > 100, "{apart} {by_edge}");
        // A triangle without area through the middle.
        let [a, b] = [Vec3::splat(-2.0), Vec3::splat(2.0)];
        assert!(!is_outside([a, b, Vec3::ZERO], &unit) && !is_outside([a, a, b], &unit));
        assert!(is_outside(
            [a + Vec3::X * 4.0, b + Vec3::X * 4.0, Vec3::X * 4.0],
            &unit
        ));
    }
}
