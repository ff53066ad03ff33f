//! A statue-like blob: a sphere whose radius changes with the direction, smoothly
//! at large (limbs and hollows) and roughly at small. Each direction meets the
//! surface once, so it is closed and never crosses itself.

use glam::{DVec3, Vec3};

use super::super::noise::fractal;
use super::super::{SurfaceKind, Surfaces};
use super::icosphere::icosphere;
use crate::scene::SeededRng;

/// Bulges (positive) and hollows of the body.
const LOBES: usize = 12;
/// How much taller than wide it is.
const TALL: f64 = 1.8;
/// Radius without bulges, world units.
const RADIUS: f64 = 1.0;

/// One item of about `triangles` triangles.
pub fn build(triangles: usize, seed: u64) -> Surfaces {
    let frequency = libm::sqrt(triangles as f64 / 20.0) as u32;
    let (directions, faces) = icosphere(frequency);
    let shape = Body::new(seed);
    let points: Vec<Vec3> = directions
        .iter()
        .map(|d| (*d * DVec3::new(1.0, 1.0, TALL) * shape.radius(*d)).as_vec3())
        .collect();
    let mut surfaces = Surfaces::about(DVec3::ZERO);
    surfaces.push(SurfaceKind::Opaque, false, &points, &faces);
    surfaces
}

struct Body {
    seed: u64,
    /// Direction, height and sharpness of each.
    lobes: Vec<(DVec3, f64, f64)>,
}

impl Body {
    fn new(seed: u64) -> Body {
        let mut rng = SeededRng::new(seed);
        let lobes = (0..LOBES).map(|_| {
            let direction = rng.normal3().normalize_or(DVec3::Z);
            (direction, rng.between(-0.3, 0.6), rng.between(4.0, 30.0))
        });
        Body {
            seed,
            lobes: lobes.collect(),
        }
    }

    /// Between 0.2 and some units.
    fn radius(&self, d: DVec3) -> f64 {
        let bulge = |(at, height, sharp): &(DVec3, f64, f64)| {
            height * libm::exp(-sharp * (1.0 - at.dot(d)))
        };
        let large: f64 = self.lobes.iter().map(bulge).sum();
        let small = fractal(d * 6.0, 5, self.seed) - 0.5;
        (RADIUS * (1.0 + large + 0.15 * small)).max(0.2)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_centre_is_behind_every_triangle() {
        let surfaces = build(30_000, 2);
        for [a, b, c] in surfaces.of(0).map(|c| c.map(Vec3::as_dvec3)) {
            assert!(a.dot(b.cross(c)) > 0.0);
        }
        assert_eq!(surfaces.open_edges(0), 0);
    }
}
