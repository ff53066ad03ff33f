//! A heightfield in tiles, without cracks: neighbours compute the points of their
//! common edge alike.

use glam::{DVec3, Vec3};

use super::super::noise::fractal;
use super::super::{SurfaceKind, Surfaces};
use super::shapes::Shape;

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
        Ground {
            seed,
            tiles: tiles.max(1),
        }
    }

    /// Length of a side, world units.
    pub fn width(&self) -> f64 {
        (self.tiles * EDGE) as f64 * STEP
    }

    /// Height of the ground, exactly that of the mesh at the corners of its quads.
    pub fn altitude(&self, x: f64, y: f64) -> f64 {
        RELIEF * fractal(DVec3::new(x / HILL, y / HILL, 0.5), 7, self.seed)
    }

    /// The tile in a column and a row.
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

/// The ground alone.
pub fn build(triangles: usize, seed: u64) -> Surfaces {
    let mut surfaces = Surfaces::about(DVec3::ZERO);
    Ground::of(triangles, seed).add_to(&mut surfaces);
    surfaces
}

/// A place on the ground.
pub fn on_ground(ground: &Ground, x: f64, y: f64) -> Vec3 {
    DVec3::new(x, y, ground.altitude(x, y)).as_vec3()
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::collections::HashMap;

    /// Edges by the coordinates of their ends.
    type Edge = [[u32; 3]; 2];

    #[test]
    fn tiles_meet_without_cracks_and_face_upward() {
        let surfaces = build(9 * TILE, 3);
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
