//! A heightfield, and a forest on it.
//!
//! Neighbouring tiles compute identical points for their common edge.

use glam::{DVec3, Vec3};

use crate::scene::rng::fractal;
use crate::scene::{SeededRng, SurfaceKind, Surfaces};

/// Quads along the edge of a tile.
const EDGE: usize = 16;
/// Triangles of a tile.
pub const TILE: usize = 2 * EDGE * EDGE;
/// Width of a quad, world units.
const STEP: f64 = 1.0;
/// Height of the relief, world units.
const RELIEF: f64 = 40.0;
/// Width of the largest hills, world units.
const HILL: f64 = 100.0;

/// Rolling ground over a square.
pub struct Ground {
    seed: u64,
    /// Tiles along each side.
    pub tiles: usize,
}

impl Ground {
    /// A square of about `triangles` triangles, one tile at least.
    pub fn of(triangles: usize, seed: u64) -> Ground {
        let tiles = libm::round(libm::sqrt(triangles as f64 / TILE as f64)) as usize;
        let tiles = tiles.max(1);
        Ground { seed, tiles }
    }

    /// Length of a side, world units.
    pub fn width(&self) -> f64 {
        (self.tiles * EDGE) as f64 * STEP
    }

    /// Height of the ground, exactly that of the mesh at the corners of its quads.
    pub fn altitude(&self, x: f64, y: f64) -> f64 {
        RELIEF * fractal(DVec3::new(x / HILL, y / HILL, 0.5), 7, self.seed)
    }

    /// The tile at a column and a row.
    fn tile(&self, column: usize, row: usize) -> Shape {
        let mut shape = Shape::default();
        for j in 0..=EDGE {
            for i in 0..=EDGE {
                let x = (column * EDGE + i) as f64 * STEP;
                let y = (row * EDGE + j) as f64 * STEP;
                let point = DVec3::new(x, y, self.altitude(x, y));
                shape.points.push(point.as_vec3());
            }
        }
        let at = |i: usize, j: usize| (j * (EDGE + 1) + i) as u32;
        for j in 0..EDGE {
            for i in 0..EDGE {
                let (a, b) = (at(i, j), at(i + 1, j));
                let (c, d) = (at(i + 1, j + 1), at(i, j + 1));
                shape.triangles.extend([[a, b, c], [a, c, d]]);
            }
        }
        shape
    }

    /// Appends all tiles, one item each.
    pub fn add_to(&self, surfaces: &mut Surfaces) {
        for row in 0..self.tiles {
            for column in 0..self.tiles {
                let Shape { points, triangles } = self.tile(column, row);
                surfaces.push(SurfaceKind::Opaque, false, &points, &triangles);
            }
        }
    }
}

/// A heightfield in tiles, without cracks.
pub fn terrain(triangles: usize, seed: u64) -> Surfaces {
    let mut surfaces = Surfaces::about(DVec3::ZERO);
    Ground::of(triangles, seed).add_to(&mut surfaces);
    surfaces
}

/// Share of the triangles that are ground.
const GROUND: f64 = 0.3;
/// Share of the plants that are trees.
const TREES: f64 = 0.4;
/// Leaf cards of a bush.
const CARDS: usize = 12;

/// Trees and bushes on a terrain.
///
/// Ground first, then plants until there are enough triangles. A tree is a closed trunk and three
/// closed cones; a bush is a dozen leaf cards, cut out and two-sided.
pub fn forest(triangles: usize, seed: u64) -> Surfaces {
    let mut surfaces = Surfaces::about(DVec3::ZERO);
    let ground = Ground::of((triangles as f64 * GROUND) as usize, seed);
    ground.add_to(&mut surfaces);
    let mut rng = SeededRng::new(seed);
    while surfaces.triangles.len() < triangles {
        let width = ground.width();
        let (x, y) = (rng.unit() * width, rng.unit() * width);
        let base = DVec3::new(x, y, ground.altitude(x, y)).as_vec3();
        let (kind, shape) = match rng.unit() < TREES {
            true => (SurfaceKind::Opaque, tree(base, &mut rng)),
            false => (SurfaceKind::CutOut, bush(base, &mut rng)),
        };
        let two_sided = kind == SurfaceKind::CutOut;
        surfaces.push(kind, two_sided, &shape.points, &shape.triangles);
    }
    surfaces
}

/// A tree of 118 triangles, whose cones overlap: each is closed in itself.
fn tree(base: Vec3, rng: &mut SeededRng) -> Shape {
    let tall = rng.between(4.0, 20.0) as f32;
    let mut shape = column(base - Vec3::Z * 0.5, tall * 0.03, tall * 0.3 + 0.5, 8);
    for (at, width) in [(0.2, 0.2), (0.42, 0.15), (0.64, 0.1)] {
        let foot = base + Vec3::Z * (tall * at);
        shape.add(&cone(foot, tall * width, tall * 0.36, 16));
    }
    shape
}

/// A bush of 24 triangles.
fn bush(base: Vec3, rng: &mut SeededRng) -> Shape {
    let size = rng.between(0.4, 1.2) as f32;
    let mut shape = Shape::default();
    for _ in 0..CARDS {
        let at = rng.point().as_vec3() - Vec3::new(0.5, 0.5, 0.0);
        let (sin, cos) = libm::sincos(rng.between(0.0, std::f64::consts::TAU));
        let across = Vec3::new(cos as f32, sin as f32, 0.0) * 0.4;
        let up = Vec3::new(-across.y, across.x, 0.8) * 0.5;
        shape.add(&card(base + at * size, across * size, up * size));
    }
    shape
}

/// Points and the triangles between them, counter-clockwise from outside.
#[derive(Default)]
pub struct Shape {
    pub points: Vec<Vec3>,
    pub triangles: Vec<[u32; 3]>,
}

impl Shape {
    /// Appends another shape.
    pub fn add(&mut self, other: &Shape) {
        let first = self.points.len() as u32;
        self.points.extend_from_slice(&other.points);
        let moved = |t: &[u32; 3]| t.map(|corner| first + corner);
        self.triangles.extend(other.triangles.iter().map(moved));
    }
}

/// A regular polygon about `centre`, counter-clockwise from above.
fn ring(centre: Vec3, radius: f32, sides: u32) -> impl Iterator<Item = Vec3> {
    (0..sides).map(move |i| {
        let turn = std::f64::consts::TAU * f64::from(i) / f64::from(sides);
        let (sin, cos) = libm::sincos(turn);
        centre + Vec3::new(cos as f32, sin as f32, 0.0) * radius
    })
}

/// A fan over the polygon of `sides` points from `first`, facing up.
fn cap(first: u32, sides: u32) -> impl Iterator<Item = [u32; 3]> {
    (1..sides - 1).map(move |i| [first, first + i, first + i + 1])
}

/// A closed cone standing on the disc about `base`: 2 `sides` - 2 triangles.
pub fn cone(base: Vec3, radius: f32, height: f32, sides: u32) -> Shape {
    let mut points: Vec<Vec3> = ring(base, radius, sides).collect();
    points.push(base + Vec3::Z * height);
    let side = (0..sides).map(|i| [i, (i + 1) % sides, sides]);
    let floor = cap(0, sides).map(|[a, b, c]| [a, c, b]);
    let triangles = side.chain(floor).collect();
    Shape { points, triangles }
}

/// A closed column standing on the disc about `base`: 4 `sides` - 4 triangles.
pub fn column(base: Vec3, radius: f32, height: f32, sides: u32) -> Shape {
    let top = base + Vec3::Z * height;
    let points = ring(base, radius, sides).chain(ring(top, radius, sides));
    let points = points.collect();
    let side = (0..sides).flat_map(|i| {
        let (a, b) = (i, (i + 1) % sides);
        [[a, b, sides + b], [a, sides + b, sides + a]]
    });
    let floor = cap(0, sides).map(|[a, b, c]| [a, c, b]);
    let triangles = side.chain(floor).chain(cap(sides, sides)).collect();
    Shape { points, triangles }
}

/// A rectangle about `centre` with two half edges: two triangles.
pub fn card(centre: Vec3, u: Vec3, v: Vec3) -> Shape {
    Shape {
        points: vec![
            centre - u - v,
            centre + u - v,
            centre + u + v,
            centre - u + v,
        ],
        triangles: vec![[0, 1, 2], [0, 2, 3]],
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::collections::HashMap;

    /// An edge by the coordinates of its ends.
    type Edge = [[u32; 3]; 2];

    #[test]
    fn tiles_meet_without_cracks_and_face_upward() {
        let surfaces = terrain(9 * TILE, 3);
        assert_eq!(surfaces.triangles.len(), 9 * TILE);
        let mut edges: HashMap<Edge, i32> = HashMap::new();
        for item in 0..surfaces.items() {
            for corners in surfaces.of(item) {
                let [a, b, c] = corners.map(Vec3::as_dvec3);
                assert!((b - a).cross(c - a).z > 0.0);
                for k in 0..3 {
                    let key = [k, (k + 1) % 3].map(|i| corners[i].to_array().map(f32::to_bits));
                    *edges.entry(key).or_default() += 1;
                }
            }
        }
        let alone = edges.keys().filter(|[a, b]| !edges.contains_key(&[*b, *a]));
        assert_eq!(alone.count(), 4 * 3 * EDGE, "only the outer rim is open");
        assert!(edges.values().all(|&count| count == 1));
    }
}
