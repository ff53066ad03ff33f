//! Trees and bushes on a terrain. A tree is a closed trunk and three closed cones;
//! a bush is a dozen leaf cards, cut out and two-sided.

use glam::{DVec3, Vec3};

use super::super::{SurfaceKind, Surfaces};
use super::shapes::{Shape, card, column, cone};
use super::terrain::{Ground, on_ground};
use crate::scene::SeededRng;

/// Share of the triangles that are ground.
const GROUND: f64 = 0.3;
/// Share of the plants that are trees.
const TREES: f64 = 0.4;
/// Cards of a bush.
const CARDS: usize = 12;

/// Ground first, then plants until there are enough triangles.
pub fn build(triangles: usize, seed: u64) -> Surfaces {
    let mut surfaces = Surfaces::about(DVec3::ZERO);
    let ground = Ground::of((triangles as f64 * GROUND) as usize, seed);
    ground.add_to(&mut surfaces);
    let mut rng = SeededRng::new(seed);
    while surfaces.triangles.len() < triangles {
        let width = ground.width();
        let (x, y) = (rng.unit() * width, rng.unit() * width);
        let base = on_ground(&ground, x, y);
        let (kind, shape) = if rng.unit() < TREES {
            (SurfaceKind::Opaque, tree(base, &mut rng))
        } else {
            (SurfaceKind::CutOut, bush(base, &mut rng))
        };
        let two_sided = kind == SurfaceKind::CutOut;
        surfaces.push(kind, two_sided, &shape.points, &shape.triangles);
    }
    surfaces
}

/// 118 triangles. The cones overlap: each is closed for itself.
fn tree(base: Vec3, rng: &mut SeededRng) -> Shape {
    let tall = rng.between(4.0, 20.0) as f32;
    let mut shape = column(base - Vec3::Z * 0.5, tall * 0.03, tall * 0.3 + 0.5, 8);
    for (at, width) in [(0.2, 0.2), (0.42, 0.15), (0.64, 0.1)] {
        let foot = base + Vec3::Z * (tall * at);
        shape.add(&cone(foot, tall * width, tall * 0.36, 16));
    }
    shape
}

/// 24 triangles.
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
