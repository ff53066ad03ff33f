//! The query volume: an intersection of at most 32 half-spaces.
//!
//! The six planes of a frustum have names.

use glam::{DVec3, Vec3};
use serde::{Deserialize, Serialize};

use super::aabb::held;
use super::{Aabb, BoxCorner, Plane, PlaneF64};

/// Largest number of planes of one volume: one bit each in a [`PlaneMask`].
pub const MAX_PLANES: usize = 32;

/// The planes still to be tested: bit i stands for plane i.
///
/// The children of a node wholly inside plane i get a mask without bit i (Assarsson and Moeller
/// 2000, "Optimized view frustum culling algorithms for bounding boxes", Journal of Graphics Tools
/// 5(1), pp. 9-22).
pub type PlaneMask = u32;

named! {
    /// The names of a view frustum's planes, in the order a camera emits them.
    #[derive(Clone, Copy, PartialEq, Eq, Hash, Debug, Serialize, Deserialize)]
    #[serde(rename_all = "snake_case")]
    pub enum FrustumPlane {
        /// Towards -u.
        Left = "left",
        /// Towards u.
        Right = "right",
        /// Towards -v.
        Bottom = "bottom",
        /// Towards v.
        Top = "top",
        /// In front of the eye, perpendicular to the direction of view.
        Near = "near",
        /// The far end of the view; infinite perspectives have none.
        Far = "far",
    }
}

/// Planes that do not define a volume.
#[derive(Clone, PartialEq, Debug, thiserror::Error)]
#[non_exhaustive]
pub enum VolumeError {
    /// More planes than a mask has bits.
    #[error("a volume has at most 32 planes, not {count}")]
    TooManyPlanes {
        /// Number of planes given.
        count: usize,
    },
    /// A NaN or infinite number in a plane or in the eye of planes about the eye.
    #[error("{what}: {value}")]
    NotFinite {
        /// "the left plane is not finite", "plane 7 is not finite".
        what: String,
        /// The numbers.
        value: String,
    },
}

impl VolumeError {
    /// Checks the number of planes.
    pub(super) fn check_count(count: usize) -> Result<(), VolumeError> {
        match count > MAX_PLANES {
            true => Err(VolumeError::TooManyPlanes { count }),
            false => Ok(()),
        }
    }

    /// The error for a plane, by its label, with numbers that are not finite.
    pub(super) fn plane(label: &str, [x, y, z, d]: [impl std::fmt::Display; 4]) -> VolumeError {
        VolumeError::NotFinite {
            what: format!("{label} is not finite"),
            value: format!("({x}, {y}, {z}, {d})"),
        }
    }
}

/// The closed intersection of up to [`MAX_PLANES`] half-spaces.
///
/// It may be unbounded (an infinite far plane is simply an absent one), and it
/// may be empty. Zero planes mean all of space.
///
/// ```
/// use cullbench::geometry::{Aabb, ConvexVolume, Plane};
/// use glam::Vec3;
///
/// // The slab 0 <= x <= 10.
/// let slab = ConvexVolume::from_planes(&[
///     Plane::new(Vec3::X, 0.0),
///     Plane::new(-Vec3::X, 10.0),
/// ])?;
/// let touching = Aabb::new(Vec3::splat(-1.0), Vec3::new(0.0, 1.0, 1.0));
/// assert!(slab.sees(&touching), "bounds are closed: touching is visible");
/// # Ok::<(), cullbench::geometry::VolumeError>(())
/// ```
#[derive(Clone, PartialEq, Debug)]
pub struct ConvexVolume {
    planes: [Plane; MAX_PLANES],
    names: [Option<FrustumPlane>; MAX_PLANES],
    count: usize,
    mask: PlaneMask,
    p_vertices: [BoxCorner; MAX_PLANES],
    /// `-d`, the least `n * p` of a point inside.
    minus_d: [f32; MAX_PLANES],
}

impl ConvexVolume {
    /// A volume of unnamed planes. O(planes).
    ///
    /// # Errors
    /// More than 32 planes, or a plane with a NaN or infinite number.
    pub fn from_planes(planes: &[Plane]) -> Result<Self, VolumeError> {
        let unnamed: Vec<_> = planes.iter().map(|&plane| (None, plane)).collect();
        Self::from_labelled_planes(&unnamed)
    }

    /// A box as six planes.
    ///
    /// The items that no plane excludes are exactly those that overlap it (closed bounds): a plane
    /// perpendicular to an axis evaluates to a difference of two numbers, whose sign no rounding
    /// changes. Infinite bounds count as the largest number. An empty box becomes a plane with
    /// nothing inside.
    pub fn of_box(b: &Aabb) -> Self {
        let planes = (0..3).flat_map(|axis| {
            let normal = Vec3::AXES[axis];
            let (low, high) = (held(b.min[axis]), held(b.max[axis]));
            [Plane::new(normal, -low), Plane::new(-normal, high)]
        });
        let planes: Vec<Plane> = match b.is_empty() {
            true => vec![Plane::new(Vec3::ZERO, -1.0)],
            false => planes.collect(),
        };
        Self::from_planes(&planes).expect("six finite planes")
    }

    /// A volume of planes, some of which have a name.
    ///
    /// # Errors
    /// The errors of [`ConvexVolume::from_planes`].
    pub fn from_labelled_planes(
        planes: &[(Option<FrustumPlane>, Plane)],
    ) -> Result<Self, VolumeError> {
        let count = planes.len();
        VolumeError::check_count(count)?;
        let mut volume = ConvexVolume {
            planes: [Plane::new(Vec3::ZERO, 0.0); MAX_PLANES],
            names: [None; MAX_PLANES],
            count,
            mask: 0,
            p_vertices: [BoxCorner([true; 3]); MAX_PLANES],
            minus_d: [0.0; MAX_PLANES],
        };
        for (index, &(name, plane)) in planes.iter().enumerate() {
            if !plane.is_finite() {
                let numbers = plane.normal.extend(plane.d).to_array();
                let label = match name {
                    Some(name) => format!("the {} plane", name.name()),
                    None => format!("plane {index}"),
                };
                return Err(VolumeError::plane(&label, numbers));
            }
            volume.planes[index] = plane;
            volume.names[index] = name;
            volume.p_vertices[index] = plane.p_vertex_corner();
            volume.minus_d[index] = -plane.d;
            volume.mask |= PlaneMask::from(!plane.is_trivial()) << index;
        }
        Ok(volume)
    }

    /// `-d` of plane `index`, without a bounds check.
    #[inline(always)]
    pub fn minus_d_of_bit(&self, index: u32) -> f32 {
        self.minus_d[index as usize % MAX_PLANES]
    }

    /// The plane of that name, if the volume has one.
    pub fn plane(&self, name: FrustumPlane) -> Option<&Plane> {
        let mut names = self.names[..self.count].iter();
        let index = names.position(|&n| n == Some(name))?;
        Some(&self.planes[index])
    }

    /// The name of plane `index` ("left", ...) or its number.
    pub fn plane_label(&self, index: usize) -> String {
        match self.names.get(index).copied().flatten() {
            Some(name) => name.name().to_owned(),
            None => format!("plane {index}"),
        }
    }

    /// The six-plane box test: true unless the whole box is outside one plane.
    ///
    /// Conservative: boxes near an edge of the frustum may pass. An empty box is never seen.
    /// O(planes).
    pub fn sees(&self, b: &Aabb) -> bool {
        !b.is_empty() && !self.planes().iter().any(|plane| plane.excludes(b))
    }

    /// Returns whether the point lies in the closed volume.
    ///
    /// The lecture's `CullPointAgainstFrustum`, with inward normals. O(planes).
    pub fn contains_point(&self, p: Vec3) -> bool {
        self.planes().iter().all(|plane| plane.contains_point(p))
    }
}

/// The closed intersection of up to 32 half-spaces in f64.
///
/// Tested against f32 boxes, which are promoted exactly. Corners and order of operations are those
/// of the f32 test, so it is monotone too.
#[derive(Clone, Debug)]
pub struct ConvexVolumeF64 {
    planes: [PlaneF64; MAX_PLANES],
    count: usize,
    mask: PlaneMask,
    p_vertices: [BoxCorner; MAX_PLANES],
}

impl ConvexVolumeF64 {
    /// The volume on the inner side of all planes; all of space without planes.
    ///
    /// # Errors
    /// More than 32 planes, or a plane with a NaN or infinite number.
    pub fn from_planes(planes: &[PlaneF64]) -> Result<Self, VolumeError> {
        VolumeError::check_count(planes.len())?;
        for (index, plane) in planes.iter().enumerate() {
            if !plane.is_finite() {
                let numbers = plane.normal.extend(plane.d).to_array();
                return Err(VolumeError::plane(&format!("plane {index}"), numbers));
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
            volume.planes[index] = plane;
            volume.p_vertices[index] = plane.p_vertex_corner();
            volume.mask |= PlaneMask::from(!plane.is_trivial()) << index;
        }
        volume
    }
}

/// The same planes; only the arithmetic of the test has more digits.
impl From<&ConvexVolume> for ConvexVolumeF64 {
    fn from(volume: &ConvexVolume) -> Self {
        Self::from_finite(volume.planes().iter().map(PlaneF64::from))
    }
}

/// The planes of a volume and their precomputed data, by the bits of its mask.
macro_rules! planes_of {
    ($Volume:ident, $Plane:ident) => {
        impl $Volume {
            /// The planes, in the order in which they were given.
            pub fn planes(&self) -> &[$Plane] {
                &self.planes[..self.count]
            }

            /// Plane `index` of a mask bit.
            ///
            /// Like `planes()[index]`, but without a bounds check in the inner loop (a bit index is
            /// always below [`MAX_PLANES`]).
            #[inline(always)]
            pub fn plane_of_bit(&self, index: u32) -> &$Plane {
                &self.planes[index as usize % MAX_PLANES]
            }

            /// The p-vertex of plane `index`, without a bounds check.
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
    };
}

planes_of!(ConvexVolume, Plane);
planes_of!(ConvexVolumeF64, PlaneF64);

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn zero_planes_are_no_constraint_or_the_empty_set() {
        let b = Aabb::new(Vec3::ZERO, Vec3::ONE);
        let free = ConvexVolume::from_planes(&[Plane::new(Vec3::ZERO, 0.0)]).unwrap();
        assert!(free.sees(&b) && free.mask() == 0);
        let empty = ConvexVolume::from_planes(&[Plane::new(Vec3::ZERO, -1.0)]).unwrap();
        assert!(!empty.sees(&b));
        assert_eq!(empty.mask(), 1, "an impossible plane must stay in the mask");
        assert!(ConvexVolume::from_planes(&[]).unwrap().sees(&b));
        for inverted in [Aabb::new(Vec3::splat(0.75), Vec3::splat(0.25)), Aabb::EMPTY] {
            assert!(!ConvexVolume::of_box(&inverted).sees(&b));
        }
        assert_eq!(ConvexVolume::of_box(&b), ConvexVolume::of_box(&b));
    }

    #[test]
    fn bad_planes_are_typed_errors() {
        let sound = Plane::new(Vec3::X, 1.0);
        for bad in [f32::NAN, f32::INFINITY, f32::NEG_INFINITY] {
            for place in 0..4 {
                let mut numbers = [1.0, 2.0, 3.0, 4.0];
                numbers[place] = bad;
                let [x, y, z, d] = numbers;
                let planes = [sound, Plane::new(Vec3::new(x, y, z), d), sound];
                assert!(matches!(
                    ConvexVolume::from_planes(&planes),
                    Err(VolumeError::NotFinite { what, .. }) if what.starts_with("plane 1 ")
                ));
            }
        }
        assert!(matches!(
            ConvexVolume::from_planes(&[sound; 33]),
            Err(VolumeError::TooManyPlanes { count: 33 })
        ));
    }

    #[test]
    fn what_f32_rounds_away_decides_in_f64() {
        // f32 cannot hold 1e8 - 1: in f32 the point touches the plane.
        let plane = PlaneF64::new(DVec3::X, -1e8 - 1.0);
        let b = Aabb::new(Vec3::splat(0.0), Vec3::new(1e8, 0.0, 0.0));
        assert!(plane.excludes(&b) && !plane.narrow().excludes(&b));
    }

    #[test]
    fn bad_planes_in_f64_are_typed_errors() {
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
