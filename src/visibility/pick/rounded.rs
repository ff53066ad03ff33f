//! A ray and a slab test in f32, as crate obvhs has them; rounding errors are not bounded.

use glam::{DVec3, Vec3};

use super::contract::Hit;
use crate::geometry::Aabb;
use crate::index::scale_for;
use crate::query::ItemId;
use crate::visibility::Ray;

/// Least component of a direction that is divided by.
const LEAST: f32 = 1e-20;

/// Local coordinates in which no area or product of a scene overflows.
#[derive(Clone, Copy, Debug)]
pub(super) struct About {
    zero: DVec3,
    /// A power of two, 1 for all but very large and very small scenes.
    pub scale: f32,
}

impl About {
    /// Coordinates about `zero` for the boxes of a scene.
    pub fn of(zero: DVec3, boxes: &[Aabb]) -> About {
        let scale = scale_for(boxes);
        About { zero, scale }
    }

    /// A box in these coordinates.
    pub fn scaled(&self, b: &Aabb) -> Aabb {
        Aabb::new(b.min * self.scale, b.max * self.scale)
    }

    /// A hit at a depth of these coordinates.
    #[inline(always)]
    pub fn hit(&self, item: ItemId, depth: f32) -> Hit {
        let depth = f64::from(depth) / f64::from(self.scale);
        Hit { item, depth }
    }
}

/// A ray in local coordinates, rounded to f32.
#[derive(Clone, Copy, Debug)]
pub(super) struct RoundedRay {
    pub origin: Vec3,
    pub direction: Vec3,
    inverse: Vec3,
    pub near: f32,
    pub far: f32,
}

impl RoundedRay {
    #[inline(always)]
    pub fn of(ray: &Ray, about: &About) -> RoundedRay {
        let scale = f64::from(about.scale);
        let direction = ray.direction.as_vec3();
        let inverse = |d: f32| {
            1.0 / if d.abs() < LEAST {
                LEAST.copysign(d)
            } else {
                d
            }
        };
        RoundedRay {
            origin: ((ray.origin - about.zero) * scale).as_vec3(),
            direction,
            inverse: Vec3::new(
                inverse(direction.x),
                inverse(direction.y),
                inverse(direction.z),
            ),
            near: (ray.near * scale) as f32,
            far: ((ray.far * scale) as f32).min(f32::MAX),
        }
    }

    /// The depth at which the box is entered, infinite if it is not met.
    #[inline(always)]
    pub fn entry(&self, b: &Aabb) -> f32 {
        let (enters, leaves) = self.slabs(b);
        match enters <= leaves && enters >= self.near && enters <= self.far {
            true => enters,
            false => f32::INFINITY,
        }
    }

    #[inline(always)]
    fn slabs(&self, b: &Aabb) -> (f32, f32) {
        let (a, b) = (
            (b.min - self.origin) * self.inverse,
            (b.max - self.origin) * self.inverse,
        );
        (a.min(b).max_element(), a.max(b).min_element())
    }
}
