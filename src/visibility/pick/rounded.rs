//! A ray and a slab test in f32, as the crates that are asked have them: what is
//! left to round is not watched.

use glam::{DVec3, Vec3};

use super::contract::Hit;
use crate::geometry::Aabb;
use crate::query::ItemId;
use crate::visibility::Ray;

/// Least component of a direction that is divided by.
const LEAST: f32 = 1e-20;

/// A ray about the zero of local coordinates, rounded to f32.
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
    pub fn of(ray: &Ray, zero: DVec3) -> RoundedRay {
        let direction = ray.direction.as_vec3();
        let inverse = |d: f32| {
            1.0 / if d.abs() < LEAST {
                LEAST.copysign(d)
            } else {
                d
            }
        };
        RoundedRay {
            origin: (ray.origin - zero).as_vec3(),
            direction,
            inverse: Vec3::new(
                inverse(direction.x),
                inverse(direction.y),
                inverse(direction.z),
            ),
            near: ray.near as f32,
            far: (ray.far as f32).min(f32::MAX),
        }
    }

    /// Whether the line of the ray, from its origin to `most`, meets the box.
    #[cfg(feature = "peers")]
    #[inline(always)]
    pub fn meets(&self, b: &Aabb, most: f32) -> bool {
        let (enters, leaves) = self.slabs(b);
        enters <= leaves && leaves >= self.near && enters <= most
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

    /// The item of a box, if that is met.
    #[inline(always)]
    pub fn hit(&self, item: ItemId, b: &Aabb) -> Option<Hit> {
        let depth = self.entry(b);
        let hit = Hit {
            item,
            depth: f64::from(depth),
        };
        depth.is_finite().then_some(hit)
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
