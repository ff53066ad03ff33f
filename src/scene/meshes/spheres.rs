//! A field of spheres in space: many closed objects, each with all directions.

use glam::{DVec3, Vec3};

use super::super::{SurfaceKind, Surfaces};
use super::icosphere::icosphere;
use crate::scene::SeededRng;

/// Cuts along the edges of the icosahedron.
const FREQUENCY: u32 = 8;
/// Distance of the centres before they are moved, world units.
const SPACING: f64 = 6.0;

/// Spheres near the points of a lattice; none touches another.
pub fn build(triangles: usize, seed: u64) -> Surfaces {
    let (directions, faces) = icosphere(FREQUENCY);
    let count = (triangles / faces.len()).max(1);
    let side = libm::ceil(libm::cbrt(count as f64)) as usize;
    let mut surfaces = Surfaces::about(DVec3::ZERO);
    let mut rng = SeededRng::new(seed);
    for i in 0..count {
        let cell = DVec3::new(
            (i % side) as f64,
            (i / side % side) as f64,
            (i / (side * side)) as f64,
        );
        let centre = (cell + rng.point() * 0.3) * SPACING;
        let radius = rng.between(0.5, 2.0);
        let points: Vec<Vec3> = directions
            .iter()
            .map(|d| (centre + *d * radius).as_vec3())
            .collect();
        surfaces.push(SurfaceKind::Opaque, false, &points, &faces);
    }
    surfaces
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn spheres_are_apart_from_each_other() {
        let surfaces = build(64 * 1280, 5);
        let boxes: Vec<_> = (0..surfaces.items()).map(|i| surfaces.bounds(i)).collect();
        for (i, a) in boxes.iter().enumerate() {
            assert!(boxes[..i].iter().all(|b| !a.intersects(b)));
        }
    }
}
