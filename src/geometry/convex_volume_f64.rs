//! The plane test in f64: planes that keep all of a camera's digits, against
//! f32 boxes that are promoted exactly. The same corners and the same order of
//! operations as in f32, and therefore just as monotone.

use glam::DVec3;

use super::convex_volume::MAX_PLANES;
use super::{ConvexVolume, PVertexSigns, PlaneF64, PlaneMask, VolumeError};

/// The closed intersection of up to 32 half-spaces in f64.
#[derive(Clone, Debug)]
pub struct ConvexVolumeF64 {
    planes: [PlaneF64; MAX_PLANES],
    count: usize,
    mask: PlaneMask,
    upper: [PVertexSigns; MAX_PLANES],
}

impl ConvexVolumeF64 {
    /// # Errors
    /// More than 32 planes, or a plane with a NaN or infinite number.
    pub fn from_planes(planes: &[PlaneF64]) -> Result<Self, VolumeError> {
        let count = planes.len();
        if count > MAX_PLANES {
            return Err(VolumeError::TooManyPlanes { count });
        }
        let mut volume = ConvexVolumeF64 {
            planes: [PlaneF64::new(DVec3::ZERO, 0.0); MAX_PLANES],
            count,
            mask: 0,
            upper: [[true; 3]; MAX_PLANES],
        };
        for (index, &plane) in planes.iter().enumerate() {
            if !(plane.normal.is_finite() && plane.d.is_finite()) {
                return Err(VolumeError::NonFinitePlaneF64 { index, plane });
            }
            let trivial = plane.normal == DVec3::ZERO && plane.d >= 0.0;
            volume.planes[index] = plane;
            volume.upper[index] = plane.normal.to_array().map(|n| n >= 0.0);
            volume.mask |= PlaneMask::from(!trivial) << index;
        }
        Ok(volume)
    }

    /// The planes, in the order in which they were given.
    pub fn planes(&self) -> &[PlaneF64] {
        &self.planes[..self.count]
    }

    /// Plane `index` of a mask bit, without a check in the inner loop.
    #[inline(always)]
    pub fn plane_of_bit(&self, index: u32) -> &PlaneF64 {
        &self.planes[index as usize % MAX_PLANES]
    }

    /// Which bounds the p-vertex of plane `index` takes, likewise.
    #[inline(always)]
    pub fn p_vertex_signs_of_bit(&self, index: u32) -> PVertexSigns {
        self.upper[index as usize % MAX_PLANES]
    }

    /// Bits of the planes that constrain anything.
    #[inline(always)]
    pub fn mask(&self) -> PlaneMask {
        self.mask
    }
}

/// The very same planes; only the arithmetic of the test is finer.
impl From<&ConvexVolume> for ConvexVolumeF64 {
    fn from(volume: &ConvexVolume) -> Self {
        let mut planes = [PlaneF64::new(DVec3::ZERO, 0.0); MAX_PLANES];
        for (wide, plane) in planes.iter_mut().zip(volume.planes()) {
            *wide = plane.into();
        }
        ConvexVolumeF64 {
            planes,
            count: volume.planes().len(),
            mask: volume.mask(),
            upper: std::array::from_fn(|index| volume.p_vertex_signs_of_bit(index as u32)),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::Aabb;
    use glam::Vec3;

    #[test]
    fn what_f32_rounds_away_decides_in_f64() {
        // 1e8 - 1 is no f32: in f32 the point touches the plane.
        let plane = PlaneF64::new(DVec3::X, -1e8 - 1.0);
        let b = Aabb::new(Vec3::splat(0.0), Vec3::new(1e8, 0.0, 0.0));
        assert!(plane.excludes(&b) && !plane.narrow().excludes(&b));
    }

    #[test]
    fn bad_planes_are_typed_errors() {
        let good = PlaneF64::new(DVec3::X, 0.0);
        let bad = PlaneF64::new(DVec3::X, f64::NAN);
        assert!(matches!(
            ConvexVolumeF64::from_planes(&[good, bad]),
            Err(VolumeError::NonFinitePlaneF64 { index: 1, .. })
        ));
        assert!(matches!(
            ConvexVolumeF64::from_planes(&[good; 33]),
            Err(VolumeError::TooManyPlanes { count: 33 })
        ));
        let free = ConvexVolumeF64::from_planes(&[PlaneF64::new(DVec3::ZERO, 0.0), good]).unwrap();
        assert_eq!(free.mask(), 0b10);
    }
}
