//! Spheres and a statue, both from the geodesic sphere.
//!
//! A geodesic sphere is an icosahedron whose faces are divided into f² triangles and projected onto
//! the sphere. Neighbouring faces share the points of their edge.

use std::collections::HashMap;

use glam::{DVec3, Vec3};

use crate::scene::families::lattice_cell;
use crate::scene::rng::fractal;
use crate::scene::{SeededRng, SurfaceKind, Surfaces};

/// Divisions per edge of the icosahedron.
const FREQUENCY: u32 = 8;
/// Distance of the centres before they are displaced, world units.
const SPACING: f64 = 6.0;

/// A field of spheres in space: faces in all directions.
///
/// They lie near the points of a lattice; no two touch.
pub fn spheres(triangles: usize, seed: u64) -> Surfaces {
    let (directions, faces) = icosphere(FREQUENCY);
    let count = (triangles / faces.len()).max(1);
    let side = libm::ceil(libm::cbrt(count as f64)) as usize;
    let mut surfaces = Surfaces::about(DVec3::ZERO);
    let mut rng = SeededRng::new(seed);
    for i in 0..count {
        let centre = (lattice_cell(i, side) + rng.point() * 0.3) * SPACING;
        let radius = rng.between(0.5, 2.0);
        let points = directions.iter().map(|d| (centre + d * radius).as_vec3());
        let points: Vec<Vec3> = points.collect();
        surfaces.push(SurfaceKind::Opaque, false, &points, &faces);
    }
    surfaces
}

/// Number of bulges (positive) and hollows of the body.
const LOBES: usize = 12;
/// Height / width.
const TALL: f64 = 1.8;
/// Radius without bulges, world units.
const RADIUS: f64 = 1.0;

/// A statue-like blob of about `triangles` triangles in one item.
///
/// A sphere whose radius varies with the direction: smoothly at large scale, roughly at small
/// scale.
///
/// Each direction meets the surface once, so it is closed and never intersects itself.
pub fn statue(triangles: usize, seed: u64) -> Surfaces {
    let frequency = libm::sqrt(triangles as f64 / 20.0) as u32;
    let (directions, faces) = icosphere(frequency);
    let mut rng = SeededRng::new(seed);
    // Direction, height and sharpness of each.
    let lobes = [(); LOBES].map(|()| {
        let direction = rng.normal3().normalize_or(DVec3::Z);
        (direction, rng.between(-0.3, 0.6), rng.between(4.0, 30.0))
    });
    // Between 0.2 and a few units.
    let radius = |d: DVec3| {
        let bulge = |(at, height, sharp): &(DVec3, f64, f64)| {
            height * libm::exp(-sharp * (1.0 - at.dot(d)))
        };
        let large: f64 = lobes.iter().map(bulge).sum();
        let small = fractal(d * 6.0, 5, seed) - 0.5;
        (RADIUS * (1.0 + large + 0.15 * small)).max(0.2)
    };
    let stretched = |d: &DVec3| (d * DVec3::new(1.0, 1.0, TALL) * radius(*d)).as_vec3();
    let points: Vec<Vec3> = directions.iter().map(stretched).collect();
    let mut surfaces = Surfaces::about(DVec3::ZERO);
    surfaces.push(SurfaceKind::Opaque, false, &points, &faces);
    surfaces
}

/// Golden ratio.
const PHI: f64 = 1.618_033_988_749_895;

/// A corner of the icosahedron.
///
/// In each of three planes, the four corners of a golden rectangle.
fn vertex(at: usize) -> DVec3 {
    let sign = |bit: usize| if at & bit == 0 { -1.0 } else { 1.0 };
    let mut vertex = [sign(1), -PHI * sign(2), 0.0];
    vertex.rotate_right(at / 4);
    vertex.into()
}

/// Three corners per face, counter-clockwise from outside.
const FACES: [usize; 60] = [
    0, 11, 5, 0, 5, 1, 0, 1, 7, 0, 7, 10, 0, 10, 11, 1, 5, 9, 5, 11, 4, 11, 10, 2, 10, 7, 6, 7, 1,
    8, 3, 9, 4, 3, 4, 2, 3, 2, 6, 3, 6, 8, 3, 8, 9, 4, 9, 5, 2, 4, 11, 6, 2, 10, 8, 6, 7, 9, 8, 1,
];

/// Unit directions and the triangles between them.
///
/// 20 f² triangles and 10 f² + 2 points for a frequency f >= 1.
pub fn icosphere(frequency: u32) -> (Vec<DVec3>, Vec<[u32; 3]>) {
    let f = frequency.max(1);
    let (mut points, mut triangles) = (Vec::new(), Vec::new());
    // Point of each set of corners and their weights, zero weights omitted.
    let mut ids: HashMap<[(usize, u32); 3], u32> = HashMap::new();
    let mut point = |face: [usize; 3], weights: [u32; 3]| {
        let mut key = [0, 1, 2].map(|k| match weights[k] {
            0 => (usize::MAX, 0),
            weight => (face[k], weight),
        });
        // The same sum in the same order for each adjoining face.
        key.sort_unstable();
        *ids.entry(key).or_insert_with(|| {
            let parts = key.iter().filter(|(_, weight)| *weight > 0);
            let sum = parts.fold(DVec3::ZERO, |sum, &(corner, weight)| {
                sum + vertex(corner) * (f64::from(weight) / f64::from(f))
            });
            points.push(sum.normalize());
            points.len() as u32 - 1
        })
    };
    for &face in FACES.as_chunks().0 {
        for j in 0..f {
            for i in 0..f - j {
                let mut at = |i: u32, j: u32| point(face, [f - i - j, i, j]);
                let (a, b, c) = (at(i, j), at(i + 1, j), at(i, j + 1));
                triangles.push([a, b, c]);
                if i + j + 1 < f {
                    triangles.push([b, at(i + 1, j + 1), c]);
                }
            }
        }
    }
    (points, triangles)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn spheres_are_apart_from_each_other() {
        let surfaces = spheres(64 * 1280, 5);
        let boxes: Vec<_> = (0..surfaces.items()).map(|i| surfaces.bounds(i)).collect();
        for (i, a) in boxes.iter().enumerate() {
            assert!(boxes[..i].iter().all(|b| !a.intersects(b)));
        }
    }

    #[test]
    fn the_centre_is_behind_every_triangle() {
        let surfaces = statue(30_000, 2);
        for [a, b, c] in surfaces.of(0).map(|c| c.map(Vec3::as_dvec3)) {
            assert!(a.dot(b.cross(c)) > 0.0);
        }
        assert_eq!(surfaces.open_edges(0), 0);
    }

    #[test]
    fn euler_counts_and_outward_faces() {
        for f in [1, 2, 7] {
            let (points, triangles) = icosphere(f);
            assert_eq!(triangles.len(), 20 * (f * f) as usize);
            assert_eq!(points.len(), 10 * (f * f) as usize + 2);
            for [a, b, c] in &triangles {
                let [a, b, c] = [a, b, c].map(|&p| points[p as usize]);
                assert!(a.dot(b.cross(c)) > 0.0);
            }
        }
    }
}
