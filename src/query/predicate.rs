//! The test of one box against a query volume, plane by plane.
//!
//! [`QueryVolume`](super::QueryVolume) tests sixteen boxes at once.

use glam::Vec3;

use super::Recorder;
use crate::geometry::{Aabb, ConvexVolume, ConvexVolumeF64, PlaneMask, RelativeVolume, Spheres};

/// Position of a box relative to a query volume.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum Containment {
    /// No point of the box can be in the volume: the subtree is skipped.
    Outside,
    /// Undecided: the children are tested.
    Straddles,
    /// Every item in the box passes: the subtree is reported as one slice.
    Inside,
}

/// Up to 32 planes with a test of their own.
///
/// A camera's frustum in any form, or a box or a point, which have a single "plane" of
/// another shape.
///
/// A parent passes a mask of open planes to its children: the planes that it does not
/// lie wholly inside of. An implementation must be monotone, for each plane by itself:
///
/// - if it [excludes](Predicate::excludes) a box it drops every item within;
/// - if it [contains](Predicate::contains) a box it drops no item within.
///
/// Then a tree may skip what is excluded, accept what is contained and leave
/// decided planes out, and still returns exactly `{ i : volume.sees(items[i]) }`,
/// bit for bit, as a scan does.
pub trait Predicate: Sized + Sync {
    /// Bits of the planes that constrain anything: the initial mask of a query.
    fn mask(&self) -> PlaneMask;

    /// Returns whether the whole box is on the outer side of the plane of that bit.
    fn excludes(&self, plane: u32, bounds: &Aabb) -> bool;

    /// Returns whether the whole box is on the inner side of the plane of that bit.
    fn contains(&self, plane: u32, bounds: &Aabb) -> bool;

    /// Returns whether the plane of that bit drops an item.
    ///
    /// The default: if it excludes the item's bounds.
    #[inline(always)]
    fn drops(&self, plane: u32, item: &Aabb) -> bool {
        self.excludes(plane, item)
    }

    /// Number of planes that a test with this mask counts as.
    #[inline(always)]
    fn planes_open(mask: PlaneMask) -> u32 {
        mask.count_ones()
    }

    /// Classifies a node's bounds; returns the mask for its children too.
    ///
    /// The bounds must not be empty. Tests only the planes of `mask`.
    #[inline(always)]
    fn classify<R: Recorder>(
        &self,
        bounds: &Aabb,
        mask: PlaneMask,
        recorder: &mut R,
    ) -> (Containment, PlaneMask) {
        let mut undecided = mask;
        for plane in Bits(mask.into()) {
            recorder.planes_tested(Self::planes_open(1 << plane));
            if self.excludes(plane, bounds) {
                return (Containment::Outside, mask);
            }
            if self.contains(plane, bounds) {
                undecided &= !(1 << plane);
            }
        }
        let verdict = if undecided == 0 {
            Containment::Inside
        } else {
            Containment::Straddles
        };
        (verdict, undecided)
    }

    /// Returns whether an item below a node with this mask belongs to the answer.
    ///
    /// Half the work of [`Predicate::classify`]: an item has no children, so containment is not
    /// tested.
    #[inline(always)]
    fn admits<R: Recorder>(&self, item: &Aabb, mask: PlaneMask, recorder: &mut R) -> bool {
        for plane in Bits(mask.into()) {
            recorder.planes_tested(Self::planes_open(1 << plane));
            if self.drops(plane, item) {
                return false;
            }
        }
        true
    }

    /// Returns whether an item is not empty and no plane drops it. O(planes).
    fn sees(&self, item: &Aabb) -> bool {
        !item.is_empty() && self.admits(item, self.mask(), &mut super::NoRecorder)
    }
}

/// Region search: the boxes that contain this point (closed bounds).
impl Predicate for Vec3 {
    #[inline(always)]
    fn mask(&self) -> PlaneMask {
        1
    }
    #[inline(always)]
    fn excludes(&self, _: u32, bounds: &Aabb) -> bool {
        !bounds.contains_point(*self)
    }
    /// No box is small enough that every box within it must hold the point.
    #[inline(always)]
    fn contains(&self, _: u32, _: &Aabb) -> bool {
        false
    }
    #[inline(always)]
    fn planes_open(_: PlaneMask) -> u32 {
        0
    }
}

/// Box search: the boxes that share a point with this one (closed bounds).
///
/// An empty box shares no point with any other.
impl Predicate for Aabb {
    #[inline(always)]
    fn mask(&self) -> PlaneMask {
        1
    }
    #[inline(always)]
    fn excludes(&self, _: u32, bounds: &Aabb) -> bool {
        !self.intersects(bounds)
    }
    #[inline(always)]
    fn contains(&self, _: u32, bounds: &Aabb) -> bool {
        self.contains(bounds)
    }
    #[inline(always)]
    fn planes_open(_: PlaneMask) -> u32 {
        0
    }
}

/// THE plane test, of planes and of the bounds as they see them.
///
/// Monotone because round-to-nearest is: see
/// [`Plane::value_at`](crate::geometry::Plane::value_at). In f64 as well: promoting a box
/// is exact.
macro_rules! plane_test {
    ($own:ident => $planes:expr, $bounds:ident => $moved:expr) => {
        #[inline(always)]
        fn mask(&$own) -> PlaneMask {
            $planes.mask()
        }
        #[inline(always)]
        fn excludes(&$own, plane: u32, $bounds: &Aabb) -> bool {
            $planes.plane_of_bit(plane).excludes($moved)
        }
        #[inline(always)]
        fn contains(&$own, plane: u32, $bounds: &Aabb) -> bool {
            $planes.plane_of_bit(plane).contains($moved)
        }
    };
}
pub(crate) use plane_test;

impl Predicate for ConvexVolume {
    plane_test!(self => self, bounds => bounds);
}

impl Predicate for ConvexVolumeF64 {
    plane_test!(self => self, bounds => bounds);
}

/// The sphere test, on an index over [sphere cubes](crate::geometry::sphere_cube).
///
/// Nodes get the plane test, items the plane test and the sphere test. Monotone because both use
/// the cube's corners: see [`Spheres`].
impl Predicate for Spheres {
    plane_test!(self => self.planes(), bounds => bounds);

    #[inline(always)]
    fn drops(&self, plane: u32, item: &Aabb) -> bool {
        self.drops(plane, item)
    }
}

/// The plane test on boxes relative to the eye.
///
/// Monotone because [`Aabb::relative_to`] is: translation keeps a box within its container, and the
/// plane test on the translated boxes is monotone.
impl Predicate for RelativeVolume {
    plane_test!(self => self.planes(), bounds => &self.moved(bounds));
}

/// The bits that are set, lowest first.
pub(crate) struct Bits(pub u64);

impl Iterator for Bits {
    type Item = u32;

    #[inline(always)]
    fn next(&mut self) -> Option<u32> {
        let bit = (self.0 != 0).then(|| self.0.trailing_zeros())?;
        self.0 &= self.0 - 1;
        Some(bit)
    }
}

impl DoubleEndedIterator for Bits {
    #[inline(always)]
    fn next_back(&mut self) -> Option<u32> {
        let bit = self.0.checked_ilog2()?;
        self.0 &= !(1 << bit);
        Some(bit)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::Plane;
    use crate::query::NoRecorder;

    fn unit_cube() -> ConvexVolume {
        let planes = [Vec3::X, Vec3::Y, Vec3::Z]
            .into_iter()
            .flat_map(|axis| [Plane::new(axis, 1.0), Plane::new(-axis, 1.0)])
            .collect::<Vec<_>>();
        ConvexVolume::from_planes(&planes).unwrap()
    }

    #[test]
    fn masks_lose_the_planes_that_are_decided() {
        let volume = unit_cube();
        let poking_out_right = Aabb::new(Vec3::ZERO, Vec3::new(2.0, 0.5, 0.5));
        let (verdict, mask) = volume.classify(&poking_out_right, volume.mask(), &mut NoRecorder);
        assert_eq!((verdict, mask), (Containment::Straddles, 0b10));
        let within = Aabb::new(Vec3::ZERO, Vec3::splat(1.0));
        assert_eq!(
            volume.classify(&within, mask, &mut NoRecorder),
            (Containment::Inside, 0)
        );
        let beyond = Aabb::new(Vec3::splat(1.5), Vec3::splat(2.0));
        assert_eq!(
            volume.classify(&beyond, volume.mask(), &mut NoRecorder).0,
            Containment::Outside
        );
    }

    #[test]
    fn an_impossible_plane_rejects_every_item() {
        let b = Aabb::new(Vec3::ZERO, Vec3::ONE);
        let empty = ConvexVolume::from_planes(&[Plane::new(Vec3::ZERO, -1.0)]).unwrap();
        assert!(!empty.sees(&b));
    }

    #[test]
    fn a_point_and_a_box_count_no_planes() {
        let mut cost = crate::query::QueryCost::default();
        let b = Aabb::new(Vec3::ZERO, Vec3::ONE);
        assert!(Vec3::ONE.admits(&b, 1, &mut cost) && b.admits(&b, 1, &mut cost));
        assert_eq!(
            Vec3::ONE.classify(&b, 1, &mut cost).0,
            Containment::Straddles
        );
        assert_eq!(b.classify(&b, 1, &mut cost), (Containment::Inside, 0));
        assert_eq!(cost, Default::default());
    }
}
