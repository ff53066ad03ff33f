//! Convex volumes with planes in f64, tested against f32 boxes.
//!
//! Boxes are promoted exactly. Corners and order of operations are those of the f32 test, so it is as monotone.

use glam::DVec3;

use super::convex_volume::MAX_PLANES;
use super::{BoxCorner, ConvexVolume, PlaneF64, PlaneMask, VolumeError};

/// The closed intersection of up to 32 half-spaces in f64.
#[derive(Clone, Debug)]
pub struct ConvexVolumeF64 {
    planes: [PlaneF64; MAX_PLANES],
    count: usize,
    mask: PlaneMask,
    p_vertices: [BoxCorner; MAX_PLANES],
}

impl ConvexVolumeF64 {
    /// # Errors
    /// More than 32 planes, or a plane with a NaN or infinite number.
    pub fn from_planes(planes: &[PlaneF64]) -> Result<Self, VolumeError> {
        VolumeError::check_count(planes.len())?;
        for (index, plane) in planes.iter().enumerate() {
            let numbers = plane.normal.extend(plane.d);
            if !numbers.is_finite() {
                let label = format!("plane {index}");
                return Err(VolumeError::plane(&label, numbers.to_array()));
            }
        }
        Ok(Self::from_finite(planes.iter().copied()))
    }

    fn from_finite(planes: impl ExactSizeIterator<Item = PlaneF64>) -> Self {
        let mut volume = ConvexVolumeF64 {
            planes: [PlaneF64::new(DVec3::ZERO, 0.0); MAX_PLANES],
            count: planes.len(),
            mask: 0,
            p_vertices: [BoxCorner([true; 3]); MAX_PLANES],
        };
        for (index, plane) in planes.enumerate() {
            let trivial = plane.normal == DVec3::ZERO && plane.d >= 0.0;
            volume.planes[index] = plane;
            volume.p_vertices[index] = BoxCorner(plane.normal.to_array().map(|n| n >= 0.0));
            volume.mask |= PlaneMask::from(!trivial) << index;
        }
        volume
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

    /// The p-vertex of plane `index`, without a check.
    #[inline(always)]
    pub fn p_vertex_of_bit(&self, index: u32) -> BoxCorner {
        self.p_vertices[index as usize % MAX_PLANES]
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
        Self::from_finite(volume.planes().iter().map(PlaneF64::from))
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
            Err(VolumeError::NotFinite { what, .. }) if what.starts_with("plane 1 ")
        ));
        assert!(matches!(
            ConvexVolumeF64::from_planes(&[good; 33]),
            Err(VolumeError::TooManyPlanes { count: 33 })
        ));
        let free = ConvexVolumeF64::from_planes(&[PlaneF64::new(DVec3::ZERO, 0.0), good]).unwrap();
        assert_eq!(free.mask(), 0b10);
    }
}
