//! Rays and bodies in f32 as crate obvhs takes them, without bounds on rounding.

use ::obvhs::ray::Ray as TheirRay;
use ::obvhs::triangle::Triangle;
use glam::{DVec3, Vec3};

use super::contract::Hit;
use crate::geometry::Aabb;
use crate::index::scale_for;
use crate::query::ItemId;
use crate::visibility::Ray;
use crate::visibility::truth::{Body, Facet, SolidBox};

/// Least component of a direction that is divided by.
const LEAST: f32 = 1e-20;

/// Local coordinates in which no area or product of a scene overflows.
#[derive(Clone, Copy, Debug)]
pub(super) struct About {
    zero: DVec3,
    /// A power of two, 1 for all but very large and very small scenes.
    scale: f32,
}

impl About {
    /// Coordinates relative to `zero` for the boxes of a scene.
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
    origin: Vec3,
    direction: Vec3,
    inverse: Vec3,
    near: f32,
    pub far: f32,
}

impl RoundedRay {
    #[inline(always)]
    pub fn of(ray: &Ray, about: &About) -> RoundedRay {
        let scale = f64::from(about.scale);
        let direction = ray.direction.as_vec3();
        let inverse = |d: f32| match d.abs() < LEAST {
            true => 1.0 / LEAST.copysign(d),
            false => 1.0 / d,
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

    /// The same ray as the crate takes it.
    #[inline(always)]
    pub fn theirs(&self) -> TheirRay {
        let (origin, direction) = (self.origin.into(), self.direction.into());
        TheirRay::new(origin, direction, 0.0, self.far.next_up())
    }
}

/// A body as a leaf of the crate's trees holds it.
pub(super) trait Primitive: Body {
    /// The body in f32.
    type Rounded: Send + Sync;

    /// Rounds the body, whose box is `bounds`, to the coordinates of a tree.
    fn rounded(&self, bounds: &Aabb, about: &About) -> Self::Rounded;

    /// Depth at which the ray enters the body, infinite if it does not meet it.
    fn depth(body: &Self::Rounded, ray: &RoundedRay, theirs: &TheirRay) -> f32;
}

impl Primitive for SolidBox {
    type Rounded = Aabb;

    fn rounded(&self, bounds: &Aabb, about: &About) -> Aabb {
        about.scaled(bounds)
    }

    #[inline(always)]
    fn depth(b: &Aabb, ray: &RoundedRay, _: &TheirRay) -> f32 {
        let (a, b) = (
            (b.min - ray.origin) * ray.inverse,
            (b.max - ray.origin) * ray.inverse,
        );
        let (enters, leaves) = (a.min(b).max_element(), a.max(b).min_element());
        match enters <= leaves && enters >= ray.near && enters <= ray.far {
            true => enters,
            false => f32::INFINITY,
        }
    }
}

impl Primitive for Facet {
    /// The triangle, and whether it is met from behind too.
    type Rounded = (Triangle, bool);

    fn rounded(&self, _: &Aabb, about: &About) -> (Triangle, bool) {
        let [v0, v1, v2] = self.corners.map(|corner| (corner * about.scale).into());
        (Triangle { v0, v1, v2 }, self.two_sided)
    }

    #[inline(always)]
    fn depth((triangle, two_sided): &(Triangle, bool), ray: &RoundedRay, theirs: &TheirRay) -> f32 {
        let [u, v] = [triangle.v1 - triangle.v0, triangle.v2 - triangle.v0];
        let is_behind = u.cross(v).dot(theirs.direction) >= 0.0;
        let depth = triangle.intersect(theirs);
        match depth >= ray.near && (*two_sided || !is_behind) {
            true => depth,
            false => f32::INFINITY,
        }
    }
}
