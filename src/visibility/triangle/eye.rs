//! The eye of a view, exactly: a point, or a direction for a parallel lens.

use glam::{DVec3, Vec3};

use crate::arithmetic::two_sum;
use crate::camera::Camera;

/// An eye in scene-local coordinates, as an exact sum of two f64 per axis, beside
/// the nearest f32 point.
///
/// Homogeneous: for an eye at infinity `weight` is 0 and the rest is the direction
/// towards it. A triangle `a`, `b`, `c` turns its front to the eye `e` where
/// `((b - a) x (c - a)) . (e - weight a) > 0`.
#[derive(Clone, Copy, PartialEq, Debug)]
#[non_exhaustive]
pub struct Eye {
    /// The larger part.
    pub high: DVec3,
    /// The rest, which rounding took from it: at most half an ulp of `high`.
    pub low: DVec3,
    /// 1 for a point, 0 for a direction.
    pub weight: f32,
    /// The f32 point next to it.
    pub nearest: Vec3,
    /// At least the distance from the eye to `nearest`.
    pub error: f64,
}

impl Eye {
    /// The eye of a camera on surfaces about an origin.
    pub fn of(camera: &Camera, origin: DVec3) -> Eye {
        match camera.lens.is_orthographic() {
            true => Eye::along(camera.frame.forward()),
            false => Eye::at(camera.frame.eye, origin),
        }
    }

    /// A point of the world as seen from a scene's origin. Exact.
    pub fn at(world: DVec3, origin: DVec3) -> Eye {
        let [x, y, z] = [0, 1, 2].map(|k| two_sum(world[k], -origin[k]));
        let high = DVec3::new(x.0, y.0, z.0);
        Eye::new(high, DVec3::new(x.1, y.1, z.1), 1.0)
    }

    /// A scene-local point.
    pub fn local(point: DVec3) -> Eye {
        Eye::new(point, DVec3::ZERO, 1.0)
    }

    /// An eye at infinity that looks along `forward`.
    pub fn along(forward: DVec3) -> Eye {
        Eye::new(-forward, DVec3::ZERO, 0.0)
    }

    fn new(high: DVec3, low: DVec3, weight: f32) -> Eye {
        let nearest = high.as_vec3();
        // Some roundings of 2^-53 each; the factor is far above them.
        let error = (high - nearest.as_dvec3()).length() + low.length();
        Eye {
            high,
            low,
            weight,
            nearest,
            error: error * (1.0 + 1e-12),
        }
    }
}
