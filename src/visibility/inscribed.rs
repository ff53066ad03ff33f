//! Boxes within closed meshes: what a mesh hides at the least. A search on a grid
//! of cells proposes a box; exact tests prove that no triangle enters it and that
//! it is inside.
//!
//! (Inscribed boxes as occluders: Silvennoinen, Saransaari, Laine and Lehtinen 2014,
//! "Occluder simplification using planar sections", name the voxel approach.)

use glam::{DVec3, Vec3};

use super::triangle::{Eye, faces, normal};
use crate::arithmetic::Expansion;
use crate::geometry::Aabb;
use crate::scene::{SurfaceKind, Surfaces};
use crate::threads;

/// A box proven to be inside a mesh.
#[derive(Clone, Copy, PartialEq, Debug)]
#[non_exhaustive]
pub struct Inscribed {
    /// Scene-local; its open inside holds no point of the surface.
    pub inner: Aabb,
    /// Volume of the box over that of the mesh: 1 less the loss.
    pub share: f64,
}

/// Cells along each axis of [`inscribed_box`] by default.
pub const CELLS: usize = 24;

/// Half the lengths by which a box shrinks when its proof fails: some tries.
const TRIES: usize = 4;

/// A large axis-parallel box inside an item: of each of its pieces the largest box of
/// whole cells, by a grid of `cells` (4 to 64) along each axis, and of these the
/// largest. `None` for an item that is not opaque,
/// one-sided and closed, or where no box was found. O(t + cells⁴).
pub fn inscribed_box(surfaces: &Surfaces, item: usize, cells: usize) -> Option<Inscribed> {
    let is_solid = surfaces.kinds[item] == SurfaceKind::Opaque && !surfaces.two_sided[item];
    if !is_solid || surfaces.of_item[item].is_empty() || surfaces.open_edges(item) != 0 {
        return None;
    }
    let inner = parts(surfaces, item)
        .iter()
        .filter_map(|part| box_in(part, cells.clamp(4, 64)))
        .max_by(|a, b| volume(a).total_cmp(&volume(b)))?;
    let share = volume(&inner) / surfaces.volume(item);
    Some(Inscribed { inner, share })
}

/// A large box in a closed surface in one piece.
fn box_in(part: &[[Vec3; 3]], cells: usize) -> Option<Aabb> {
    let grid = Grid::of(part, cells);
    let [low, high] = grid.largest_box()?;
    let mut inner = Aabb::new(grid.corner(low), grid.corner(high));
    for _ in 0..TRIES {
        if !inner.is_empty() && is_in(part, &inner) {
            return Some(inner);
        }
        // Not proven: a little smaller.
        let less = inner.extent() / 8.0;
        inner = Aabb::new(inner.min + less, inner.max - less);
    }
    None
}

fn volume(b: &Aabb) -> f64 {
    let size = b.max.as_dvec3() - b.min.as_dvec3();
    size.x * size.y * size.z
}

/// The triangles of an item, apart where they have no point in common: pieces of a
/// closed surface are closed, and may overlap.
fn parts(surfaces: &Surfaces, item: usize) -> Vec<Vec<[Vec3; 3]>> {
    let triangles = &surfaces.triangles[surfaces.range(item)];
    let points = triangles.iter().flatten().copied();
    let (low, high) = points.fold((u32::MAX, 0), |(low, high), p| (low.min(p), high.max(p)));
    // Union and find by halving paths; the lowest point stands for its piece.
    let mut parent: Vec<u32> = (0..=high - low).collect();
    fn root(parent: &mut [u32], mut at: u32) -> u32 {
        while parent[at as usize] != at {
            parent[at as usize] = parent[parent[at as usize] as usize];
            at = parent[at as usize];
        }
        at
    }
    for [a, b, c] in triangles {
        for other in [b, c] {
            let [a, b] = [a, other].map(|p| root(&mut parent, p - low));
            parent[a.max(b) as usize] = a.min(b);
        }
    }
    let mut parts: Vec<(u32, Vec<[Vec3; 3]>)> = Vec::new();
    for corners in triangles {
        let piece = root(&mut parent, corners[0] - low);
        let corners = corners.map(|p| surfaces.points[p as usize]);
        match parts.iter_mut().rev().find(|(of, _)| *of == piece) {
            Some((_, part)) => part.push(corners),
            None => parts.push((piece, vec![corners])),
        }
    }
    parts.into_iter().map(|(_, part)| part).collect()
}

/// The boxes inside all items of a mesh.
#[derive(Clone, PartialEq, Debug)]
#[non_exhaustive]
pub struct InnerBoxes {
    /// By item, scene-local; empty where there is none.
    pub boxes: Vec<Aabb>,
    /// How many items have one.
    pub count: usize,
    /// Volume of the boxes over that of the items that have one, in which pieces that
    /// overlap count twice; `None` if no item has one.
    pub share: Option<f64>,
}

impl InnerBoxes {
    /// A box for each item, as [`inscribed_box`] finds it on a grid of so many cells.
    /// The same on any number of threads.
    pub fn of(surfaces: &Surfaces, cells: usize, threads: usize) -> InnerBoxes {
        const CHUNK: usize = 16;
        let mut found = vec![None; surfaces.items()];
        let chunks = found.chunks_mut(CHUNK).enumerate();
        threads::share(threads, chunks, |(chunk, found)| {
            for (place, found) in found.iter_mut().enumerate() {
                *found = inscribed_box(surfaces, chunk * CHUNK + place, cells);
            }
        });
        let some = found.iter().flatten();
        let [boxes, items] = some.clone().fold([0.0, 0.0], |[boxes, items], one| {
            let own = volume(&one.inner);
            [boxes + own, items + own / one.share]
        });
        InnerBoxes {
            count: some.count(),
            share: (items > 0.0).then(|| boxes / items),
            boxes: found
                .iter()
                .map(|found| found.map_or(Aabb::EMPTY, |one| one.inner))
                .collect(),
        }
    }
}

/// Whether the open box is in the inside of one piece of a closed item: exactly.
pub fn is_inside(surfaces: &Surfaces, item: usize, inner: &Aabb) -> bool {
    parts(surfaces, item).iter().any(|part| is_in(part, inner))
}

fn is_in(part: &[[Vec3; 3]], inner: &Aabb) -> bool {
    let is_apart = part.iter().all(|corners| is_outside(*corners, inner));
    // All of an open box without a surface in it is inside, or none is.
    is_apart && winding(part, inner).is_some_and(|turns| turns > 0)
}

/// Whether a triangle and an open box have no point in common: exactly, by the
/// thirteen separating axes (Akenine-Möller 2001) as comparisons and orientations.
fn is_outside(corners: [Vec3; 3], b: &Aabb) -> bool {
    let [p, q, r] = corners;
    let (low, high) = (p.min(q).min(r), p.max(q).max(r));
    if high.cmple(b.min).any() || low.cmpge(b.max).any() {
        return true;
    }
    // Without area there is no plane to be behind.
    let on_plane = normal(corners) != DVec3::ZERO
        && [[p, q, r], [p, r, q]]
            .into_iter()
            .any(|triangle| (0..8).all(|i| !faces(&Eye::local(b.corner(i).as_dvec3()), triangle)));
    // Edges against the box's axes: a line of the projection along the axis that has
    // the rectangle on one side, the triangle on the other.
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
                // Where the projection is a line, both sides of it are free; where it
                // is a point, there is no line.
                (left || right) && a != b0
            })
        })
}

/// The sign of the turn from `a` over `b` to `c`, exactly: 1 is to the left.
fn turn(a: [f32; 2], b: [f32; 2], c: [f32; 2]) -> i32 {
    let [[ax, ay], [bx, by], [cx, cy]] = [a, b, c].map(|p| p.map(f64::from));
    let (left, right) = ((bx - ax) * (cy - ay), (by - ay) * (cx - ax));
    let side = left - right;
    // Four roundings on each way: Shewchuk 1997 proves 3 + 16 * 2^-53 of them.
    if side.abs() > (left.abs() + right.abs()) * (4.0 * f64::EPSILON) {
        return if side > 0.0 { 1 } else { -1 };
    }
    let minus = |p: f64, q: f64| &Expansion::from(p) - &Expansion::from(q);
    let (left, right) = (
        &minus(bx, ax) * &minus(cy, ay),
        &minus(by, ay) * &minus(cx, ax),
    );
    (&left - &right).sign()
}

/// How often a closed surface winds around a point in the box: crossings of a ray
/// upward from it, `None` if every ray that was tried meets an edge.
fn winding(part: &[[Vec3; 3]], inner: &Aabb) -> Option<i32> {
    let (low, size) = (inner.min.as_dvec3(), inner.extent().as_dvec3());
    // Places of the plane that are unlikely to be those of corners.
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
            // Upward the ray leaves through a triangle that faces up, if it is above:
            // the point then is behind it.
            let is_in_front = faces(&eye, [a, b, c]);
            turns += match (some_left, is_in_front) {
                (true, false) => 1,
                (false, true) => -1,
                _ => 0,
            };
        }
        Some(turns)
    })
}

/// Cells of the bounds of a piece: inside or not.
struct Grid {
    cells: usize,
    low: DVec3,
    step: DVec3,
    /// A word per row along x, bit by bit.
    inside: Vec<u64>,
}

impl Grid {
    fn of(part: &[[Vec3; 3]], cells: usize) -> Grid {
        let points = part.iter().flatten();
        let low = points.clone().fold(Vec3::INFINITY, |low, p| low.min(*p));
        let high = points.fold(Vec3::NEG_INFINITY, |high, p| high.max(*p));
        let low = low.as_dvec3();
        let step = (high.as_dvec3() - low) / cells as f64;
        let mut grid = Grid {
            cells,
            low,
            step,
            inside: vec![0; cells * cells],
        };
        let touched = grid.touched(part);
        grid.fill(&touched);
        grid
    }

    /// Lower corner of a cell.
    fn corner(&self, cell: [usize; 3]) -> Vec3 {
        let [x, y, z] = cell.map(|index| index as f64);
        (self.low + self.step * DVec3::new(x, y, z)).as_vec3()
    }

    /// Cells that a triangle may enter: those of its bounds on both sides of its
    /// plane, and a little more. (Only a proposal: the proof does not use it.)
    fn touched(&self, part: &[[Vec3; 3]]) -> Vec<u64> {
        let n = self.cells;
        let mut touched = vec![0u64; n * n];
        for corners in part {
            let [a, b, c] = corners.map(Vec3::as_dvec3);
            let across = (b - a).cross(c - a);
            let reach = across.abs().dot(self.step) * 0.5001;
            let cell = |p: DVec3, slack: f64| {
                let at = (p - self.low) / self.step + slack;
                at.to_array().map(|x| (x.max(0.0) as usize).min(n - 1))
            };
            let first = cell(a.min(b).min(c), -1e-6);
            let last = cell(a.max(b).max(c), 1e-6);
            for z in first[2]..=last[2] {
                for y in first[1]..=last[1] {
                    for x in first[0]..=last[0] {
                        let at = DVec3::new(x as f64, y as f64, z as f64) + 0.5;
                        let centre = self.low + self.step * at;
                        if across.dot(centre - a).abs() <= reach {
                            touched[z * n + y] |= 1 << x;
                        }
                    }
                }
            }
        }
        touched
    }

    /// What cannot be reached from the sides without a touched cell on the way.
    fn fill(&mut self, touched: &[u64]) {
        let n = self.cells;
        let row = if n == 64 { u64::MAX } else { (1 << n) - 1 };
        let mut outside = vec![0u64; n * n];
        let ends = 1 | 1 << (n - 1);
        for (i, out) in outside.iter_mut().enumerate() {
            let is_side = [i / n, i % n].iter().any(|&k| k == 0 || k == n - 1);
            *out = if is_side { row } else { ends } & !touched[i];
        }
        let mut has_grown = true;
        while has_grown {
            has_grown = false;
            for i in 0..n * n {
                let (z, y) = (i / n, i % n);
                let mut grown = outside[i];
                let mut take = |ok: bool, from: usize| {
                    if ok {
                        grown |= outside[from];
                    }
                };
                take(y > 0, i.wrapping_sub(1));
                take(y + 1 < n, i + 1);
                take(z > 0, i.wrapping_sub(n));
                take(z + 1 < n, i + n);
                grown &= !touched[i];
                loop {
                    let wider = (grown | grown << 1 | grown >> 1) & row & !touched[i];
                    if wider == grown {
                        break;
                    }
                    grown = wider;
                }
                has_grown |= grown != outside[i];
                outside[i] = grown;
            }
        }
        let rest = touched.iter().zip(&outside).map(|(t, o)| row & !t & !o);
        self.inside = rest.collect();
    }

    /// The box of inside cells with the most of them: first cell and the one behind
    /// the last. All slabs of z, and the largest rectangle of each.
    fn largest_box(&self) -> Option<[[usize; 3]; 2]> {
        let n = self.cells;
        let mut best = (0, [[0; 3]; 2]);
        for low in 0..n {
            let mut rows = self.inside[low * n..(low + 1) * n].to_vec();
            for high in low + 1..=n {
                if high > low + 1 {
                    let next = &self.inside[(high - 1) * n..high * n];
                    rows.iter_mut()
                        .zip(next)
                        .for_each(|(row, next)| *row &= next);
                }
                if rows.iter().all(|&row| row == 0) {
                    break;
                }
                for first in 0..n {
                    let mut common = u64::MAX;
                    for (last, row) in rows.iter().enumerate().skip(first) {
                        common &= row;
                        if common == 0 {
                            break;
                        }
                        let (at, length) = longest_run(common);
                        let count = length * (last + 1 - first) * (high - low);
                        if count > best.0 {
                            let end = [at + length, last + 1, high];
                            best = (count, [[at, first, low], end]);
                        }
                    }
                }
            }
        }
        (best.0 > 0).then_some(best.1)
    }
}

/// Where the longest run of ones begins, and how long it is.
fn longest_run(word: u64) -> (usize, usize) {
    let (mut left, mut length) = (word, 0);
    let mut last = left;
    while left != 0 {
        last = left;
        left &= left >> 1;
        length += 1;
    }
    (last.trailing_zeros() as usize, length)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::{Mesh, SeededRng, load};

    fn mesh(name: &str, triangles: usize) -> Surfaces {
        (Mesh::named(&format!("mesh:{name}")).unwrap().build)(triangles, 3)
    }

    #[test]
    fn boxes_are_found_and_are_inside() {
        let statue = mesh("statue", 5000);
        let found = inscribed_box(&statue, 0, CELLS).unwrap();
        assert!(found.share > 0.15 && found.share < 1.0, "{found:?}");
        // Independently: from random points of the box the surface is all around.
        let mut rng = SeededRng::new(1);
        for _ in 0..50 {
            let size = found.inner.extent().as_dvec3();
            let p = found.inner.min.as_dvec3() + rng.point() * size;
            let angle: f64 = statue
                .of(0)
                .map(|corners| solid_angle(corners.map(|c| c.as_dvec3() - p)))
                .sum();
            assert!((angle / (2.0 * std::f64::consts::TAU) - 1.0).abs() < 1e-6);
        }
        let spheres = mesh("spheres", 5 * 1280);
        for item in 0..spheres.items() {
            // The cube in a ball has 2 / (sqrt(3) pi) = 37 % of it.
            let share = inscribed_box(&spheres, item, CELLS).unwrap().share;
            assert!(share > 0.25 && share < 0.37, "{share}");
        }
    }

    /// Seen from the zero (van Oosterom and Strackee 1983).
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
            let share = inscribed_box(&surfaces, item, 8).unwrap().share;
            assert!(share > 0.3, "{share}");
        }
    }

    #[test]
    fn only_closed_opaque_items_have_one() {
        let forest = mesh("forest", 20_000);
        let found = InnerBoxes::of(&forest, 12, 1);
        assert_eq!(found, InnerBoxes::of(&forest, 12, 3));
        let (mut trees, mut volumes) = (0, [0.0, 0.0]);
        for (item, inner) in found.boxes.iter().enumerate() {
            let is_tree = forest.of_item[item].len() == 118;
            assert!(is_tree || inner.is_empty());
            assert!(inner.is_empty() || is_inside(&forest, item, inner));
            if !inner.is_empty() {
                trees += 1;
                volumes[0] += volume(inner);
                volumes[1] += forest.volume(item);
            }
        }
        assert!(trees > 20 && trees == found.count, "{trees}");
        let share = volumes[0] / volumes[1];
        assert!((found.share.unwrap() / share - 1.0).abs() < 1e-9 && share < 0.5);
        let ground = InnerBoxes::of(&mesh("terrain", 2000), CELLS, 1);
        assert_eq!((ground.count, ground.share), (0, None));
    }

    #[test]
    fn separation_is_what_clipping_says() {
        // Cut the triangle by the six planes in f64: something left means common points.
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
        // A needle without area, through the middle.
        let [a, b] = [Vec3::splat(-2.0), Vec3::splat(2.0)];
        assert!(!is_outside([a, b, Vec3::ZERO], &unit) && !is_outside([a, a, b], &unit));
        assert!(is_outside(
            [a + Vec3::X * 4.0, b + Vec3::X * 4.0, Vec3::X * 4.0],
            &unit
        ));
    }
}
