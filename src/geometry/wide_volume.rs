//! The plane test in f64: planes that keep all of a camera's digits, against
//! f32 boxes that are promoted exactly. The same corners and the same order of
//! operations as in f32, and therefore just as monotone.

use glam::DVec3;

use super::convex_volume::MAX_PLANES;
use super::{Aabb, ConvexVolume, Plane, PlaneMask, Upper, VolumeError};

/// A half-space in f64: the points `x` with `normal . x + d >= 0` (closed).
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct WidePlane {
    pub normal: DVec3,
    pub d: f64,
}

impl WidePlane {
    pub const fn new(normal: DVec3, d: f64) -> Self {
        WidePlane { normal, d }
    }

    /// `((nx*x + ny*y) + nz*z) + d` in f64, as [`Plane::value_at`] does it in
    /// f32. An f32 coordinate is an f64 number, so nothing is rounded before
    /// the first product.
    #[inline(always)]
    pub fn value_at(&self, x: DVec3) -> f64 {
        ((self.normal.x * x.x + self.normal.y * x.y) + self.normal.z * x.z) + self.d
    }

    #[inline(always)]
    fn p_vertex(&self, b: &Aabb) -> DVec3 {
        let pick = |n: f64, low: f32, high: f32| f64::from(if n >= 0.0 { high } else { low });
        DVec3::new(
            pick(self.normal.x, b.min.x, b.max.x),
            pick(self.normal.y, b.min.y, b.max.y),
            pick(self.normal.z, b.min.z, b.max.z),
        )
    }

    /// Whether the whole box lies strictly outside. Touching is not outside.
    #[inline(always)]
    pub fn excludes(&self, b: &Aabb) -> bool {
        self.value_at(self.p_vertex(b)) < 0.0
    }

    /// Whether the whole box lies inside.
    #[inline(always)]
    pub fn contains(&self, b: &Aabb) -> bool {
        self.value_at(self.p_vertex(&Aabb::new(b.max, b.min))) >= 0.0
    }

    /// The same plane in coordinates about another point.
    pub fn about(&self, zero: DVec3) -> WidePlane {
        WidePlane::new(self.normal, self.normal.dot(zero) + self.d)
    }

    /// Rounded once to f32.
    pub fn narrow(&self) -> Plane {
        Plane::new(self.normal.as_vec3(), self.d as f32)
    }
}

impl From<&Plane> for WidePlane {
    fn from(plane: &Plane) -> Self {
        WidePlane::new(plane.normal.as_dvec3(), f64::from(plane.d))
    }
}

/// The closed intersection of up to 32 half-spaces in f64.
#[derive(Clone, Debug)]
pub struct WideVolume {
    planes: [WidePlane; MAX_PLANES],
    count: usize,
    mask: PlaneMask,
    upper: [Upper; MAX_PLANES],
}

impl WideVolume {
    /// # Errors
    /// More than 32 planes, or a plane with a NaN or infinite number.
    pub fn from_planes(planes: &[WidePlane]) -> Result<Self, VolumeError> {
        let count = planes.len();
        if count > MAX_PLANES {
            return Err(VolumeError::TooManyPlanes { count });
        }
        let mut volume = WideVolume {
            planes: [WidePlane::new(DVec3::ZERO, 0.0); MAX_PLANES],
            count,
            mask: 0,
            upper: [[true; 3]; MAX_PLANES],
        };
        for (index, &plane) in planes.iter().enumerate() {
            if !(plane.normal.is_finite() && plane.d.is_finite()) {
                return Err(VolumeError::NonFiniteWidePlane { index, plane });
            }
            let trivial = plane.normal == DVec3::ZERO && plane.d >= 0.0;
            volume.planes[index] = plane;
            volume.upper[index] = plane.normal.to_array().map(|n| n >= 0.0);
            volume.mask |= PlaneMask::from(!trivial) << index;
        }
        Ok(volume)
    }

    pub fn planes(&self) -> &[WidePlane] {
        &self.planes[..self.count]
    }

    /// Plane `index` of a mask bit, without a check in the inner loop.
    #[inline(always)]
    pub fn plane_of_bit(&self, index: u32) -> &WidePlane {
        &self.planes[index as usize % MAX_PLANES]
    }

    /// Which bounds the p-vertex of plane `index` takes, likewise.
    #[inline(always)]
    pub fn upper_of_bit(&self, index: u32) -> Upper {
        self.upper[index as usize % MAX_PLANES]
    }

    /// Bits of the planes that constrain anything.
    #[inline(always)]
    pub fn mask(&self) -> PlaneMask {
        self.mask
    }
}

/// The very same planes; only the arithmetic of the test is finer.
impl From<&ConvexVolume> for WideVolume {
    fn from(volume: &ConvexVolume) -> Self {
        let mut planes = [WidePlane::new(DVec3::ZERO, 0.0); MAX_PLANES];
        for (wide, plane) in planes.iter_mut().zip(volume.planes()) {
            *wide = plane.into();
        }
        WideVolume {
            planes,
            count: volume.planes().len(),
            mask: volume.mask(),
            upper: std::array::from_fn(|index| volume.upper_of_bit(index as u32)),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::Vec3;

    #[test]
    fn what_f32_rounds_away_decides_in_f64() {
        // 1e8 - 1 is no f32: in f32 the point touches the plane.
        let plane = WidePlane::new(DVec3::X, -1e8 - 1.0);
        let b = Aabb::new(Vec3::splat(0.0), Vec3::new(1e8, 0.0, 0.0));
        assert!(plane.excludes(&b) && !plane.narrow().excludes(&b));
    }

    #[test]
    fn bad_planes_are_typed_errors() {
        let good = WidePlane::new(DVec3::X, 0.0);
        let bad = WidePlane::new(DVec3::X, f64::NAN);
        assert!(matches!(
            WideVolume::from_planes(&[good, bad]),
            Err(VolumeError::NonFiniteWidePlane { index: 1, .. })
        ));
        assert!(matches!(
            WideVolume::from_planes(&[good; 33]),
            Err(VolumeError::TooManyPlanes { count: 33 })
        ));
        let free = WideVolume::from_planes(&[WidePlane::new(DVec3::ZERO, 0.0), good]).unwrap();
        assert_eq!(free.mask(), 0b10);
    }
}
