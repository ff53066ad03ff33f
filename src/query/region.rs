//! Query regions and the verdict about a box: inside, straddling or outside,
//! with the memo that a parent hands to its children. Views have a file of
//! their own; traversal belongs to the structures.

use glam::Vec3;

use super::Recorder;
use crate::geometry::{Aabb, BoxBlock, LaneMask};
use crate::kernel::Isa;

/// How a box lies to a region.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum Containment {
    /// No point of the box can be in the region: skip the subtree.
    Outside,
    /// Not decided: look at the children.
    Straddles,
    /// Everything in the box passes: report the subtree as one slice.
    Inside,
}

/// A query region: a camera's view (every [`View`](super::View)), a box or a
/// point.
///
/// The memo carries what a parent has already decided down to its children
/// (for a view the mask of open planes). An implementation must be
/// monotone: if it calls a box `Outside` it must do so for every box within,
/// and likewise for `Inside`.
pub trait Region {
    type Memo: Copy;

    /// The memo for the root.
    fn start(&self) -> Self::Memo;

    /// The verdict about a node's bounds, and the memo for its children.
    fn classify<R: Recorder>(
        &self,
        bounds: &Aabb,
        memo: Self::Memo,
        recorder: &mut R,
    ) -> (Containment, Self::Memo);

    /// Whether an item below a node with this memo belongs to the answer.
    #[inline(always)]
    fn admits<R: Recorder>(&self, item: &Aabb, memo: Self::Memo, recorder: &mut R) -> bool {
        self.classify(item, memo, recorder).0 != Containment::Outside
    }

    /// [`Region::admits`] for sixteen items at once, one bit each. Lanes that
    /// hold no item may come out either way.
    fn admit_lanes<I: Isa>(&self, isa: I, block: &BoxBlock, memo: Self::Memo) -> LaneMask;

    /// How many planes a test with this memo evaluates.
    #[inline(always)]
    fn planes_open(_memo: Self::Memo) -> u32 {
        0
    }
}

/// Region search: which boxes hold this point (closed bounds).
impl Region for Vec3 {
    type Memo = ();

    #[inline(always)]
    fn start(&self) {}

    #[inline(always)]
    fn classify<R: Recorder>(&self, bounds: &Aabb, _: (), _: &mut R) -> (Containment, ()) {
        if bounds.contains_point(*self) {
            (Containment::Straddles, ())
        } else {
            (Containment::Outside, ())
        }
    }
    #[inline(always)]
    fn admit_lanes<I: Isa>(&self, _: I, block: &BoxBlock, _: ()) -> LaneMask {
        block.holding(*self)
    }
}

/// Box search: which boxes share a point with this one (closed bounds).
impl Region for Aabb {
    type Memo = ();

    #[inline(always)]
    fn start(&self) {}

    #[inline(always)]
    fn classify<R: Recorder>(&self, bounds: &Aabb, _: (), _: &mut R) -> (Containment, ()) {
        if !self.intersects(bounds) {
            (Containment::Outside, ())
        } else if self.contains(bounds) {
            (Containment::Inside, ())
        } else {
            (Containment::Straddles, ())
        }
    }
    #[inline(always)]
    fn admit_lanes<I: Isa>(&self, _: I, block: &BoxBlock, _: ()) -> LaneMask {
        block.meeting(self)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::{ConvexVolume, Plane};
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
        let (verdict, mask) = volume.classify(&poking_out_right, volume.start(), &mut NoRecorder);
        assert_eq!((verdict, mask), (Containment::Straddles, 0b10));
        let within = Aabb::new(Vec3::ZERO, Vec3::splat(1.0));
        assert_eq!(
            volume.classify(&within, mask, &mut NoRecorder),
            (Containment::Inside, 0)
        );
        let beyond = Aabb::new(Vec3::splat(1.5), Vec3::splat(2.0));
        assert_eq!(
            volume.classify(&beyond, volume.start(), &mut NoRecorder).0,
            Containment::Outside
        );
    }

    #[test]
    fn an_impossible_plane_rejects_every_item() {
        let b = Aabb::new(Vec3::ZERO, Vec3::ONE);
        let empty = ConvexVolume::from_planes(&[Plane::new(Vec3::ZERO, -1.0)]).unwrap();
        assert!(!empty.admits(&b, empty.start(), &mut NoRecorder));
    }
}
