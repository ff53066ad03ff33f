//! The plane test relative to the eye.
//!
//! Boxes are translated to the eye before they meet the planes, as in engines with large worlds.
//! Far from the scene's origin this keeps digits that `n . x + d` would cancel.

use glam::Vec3;

use super::{Aabb, ConvexVolume, Plane, PlaneF64, VolumeError};

/// Planes in coordinates relative to an f32 eye.
///
/// A box is translated by [`Aabb::relative_to`] and then gets THE plane test:
/// `((nx*(x-ex) + ny*(y-ey)) + nz*(z-ez)) + d` in f32, no fused multiply-add.
#[derive(Clone, Debug)]
pub struct RelativeVolume {
    /// The eye in f32 scene coordinates, which is subtracted from every box.
    pub(crate) eye: Vec3,
    planes: ConvexVolume,
}

impl RelativeVolume {
    /// Planes that are already relative to `eye`.
    ///
    /// # Errors
    /// An eye with a NaN or infinite coordinate.
    pub fn new(eye: Vec3, planes: ConvexVolume) -> Result<Self, VolumeError> {
        if !eye.is_finite() {
            return Err(VolumeError::NotFinite {
                what: "the eye is not finite in f32".to_owned(),
                value: eye.to_string(),
            });
        }
        Ok(RelativeVolume { eye, planes })
    }

    /// The planes of a volume relative to an eye.
    ///
    /// The offsets become `n . eye + d`, computed in f64 and rounded once.
    ///
    /// # Errors
    /// An eye or an offset beyond f32.
    pub fn about(eye: Vec3, volume: &ConvexVolume) -> Result<Self, VolumeError> {
        let moved = volume.planes().iter().map(PlaneF64::from);
        let moved = moved.map(|plane| plane.about(eye.as_dvec3()).narrow());
        let planes: Vec<Plane> = moved.collect();
        RelativeVolume::new(eye, ConvexVolume::from_planes(&planes)?)
    }

    /// The planes relative to the eye.
    #[inline(always)]
    pub fn planes(&self) -> &ConvexVolume {
        &self.planes
    }

    /// A box in the coordinates of the planes.
    #[inline(always)]
    pub fn moved(&self, b: &Aabb) -> Aabb {
        b.relative_to(self.eye)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn digits_that_a_far_zero_cancels_are_kept() {
        // A slanting plane through the eye, at ten million: points one unit in front and behind
        // must differ.
        let eye = Vec3::new(1e7, -1e7, 0.0);
        let plane = Plane::new(Vec3::new(0.6, 0.8, 0.0), 0.0);
        let about = ConvexVolume::from_planes(&[plane]).unwrap();
        let relative = RelativeVolume::new(eye, about).unwrap();
        let at = |x: f32| Aabb::new(eye + Vec3::X * x, eye + Vec3::X * x);
        assert!(relative.planes.sees(&relative.moved(&at(1.0))));
        assert!(!relative.planes.sees(&relative.moved(&at(-1.0))));
    }

    #[test]
    fn an_eye_that_is_no_point_is_an_error() {
        let all = ConvexVolume::from_planes(&[]).unwrap();
        let eye = Vec3::new(0.0, f32::INFINITY, 0.0);
        assert!(matches!(
            RelativeVolume::new(eye, all),
            Err(VolumeError::NotFinite { .. })
        ));
    }
}
