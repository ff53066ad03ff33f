//! Query volumes: a [`Predicate`] and kernels that test sixteen boxes at once.
//!
//! The default of every kernel is the scalar test.

use glam::Vec3;

use crate::geometry::{
    Aabb, BallFrustum, BallPlane, Balls, BoxBlock, BroadcastPlane, BroadcastPlanes, ConvexVolume,
    ConvexVolumeF64, LANES, LaneMask, PlaneMask, PlaneRows, Planes, RelativeVolume, Sorted,
    Spheres,
};

use super::predicate::Bits;
use super::{Containment, NoRecorder, Predicate};
use crate::kernel::Isa;

/// A frustum, a point or a box that sees items.
///
/// Bit for bit its [`Predicate`], sixteen boxes at a time.
pub trait QueryVolume: Predicate {
    /// True if the volume is a point: [`QueryVolume::as_point`] returns it.
    ///
    /// For structures that search for points by other means than bounds.
    const IS_POINT: bool = false;

    /// True if [`QueryVolume::as_spheres`] returns spheres.
    const SPHERES: bool = false;

    /// The volume, if it sees items as spheres.
    #[inline(always)]
    fn as_spheres(&self) -> Option<&Spheres> {
        None
    }

    /// The point, if the volume is one.
    #[inline(always)]
    fn as_point(&self) -> Option<Vec3> {
        None
    }

    /// The lanes that no plane of the mask drops.
    ///
    /// Bit for bit [`Predicate::drops`], lane by lane. Bits of lanes without an item are
    /// unspecified.
    #[inline(always)]
    fn kept_lanes<I: Isa>(&self, _: I, block: &BoxBlock, mask: PlaneMask) -> LaneMask {
        let kept = |lane: usize| self.admits(&block.get(lane), mask, &mut NoRecorder);
        (0..LANES).fold(0, |kept_lanes, lane| {
            kept_lanes | LaneMask::from(kept(lane)) << lane
        })
    }

    /// [`QueryVolume::kept_lanes`] of a block with its index in `balls`, its spheres.
    #[inline(always)]
    fn kept_balls<I: Isa>(
        &self,
        isa: I,
        _balls: &Balls,
        (_, block): (usize, &BoxBlock),
        mask: PlaneMask,
    ) -> LaneMask {
        self.kept_lanes(isa, block, mask)
    }

    /// The plane of that bit, prepared for many blocks.
    ///
    /// [`QueryVolume::kept_lanes`] with only this bit in the mask.
    #[inline(always)]
    fn one_plane<I: Isa>(&self, _: I, plane: u32) -> impl Planes<I> {
        (self, 1 << plane)
    }

    /// All planes, prepared for many blocks; `None` if there are too many.
    ///
    /// [`QueryVolume::kept_lanes`] with [`Predicate::mask`].
    #[inline(always)]
    fn all_planes<I: Isa>(&self, _: I) -> Option<impl Planes<I>> {
        Some((self, self.mask()))
    }

    /// [`QueryVolume::kept_lanes`] of four blocks.
    #[inline(always)]
    fn kept_of_four<I: Isa>(
        &self,
        isa: I,
        blocks: &[BoxBlock; 4],
        mask: PlaneMask,
    ) -> [LaneMask; 4] {
        // No closure: it would be compiled separately, without the instruction set.
        let mut kept = [0; 4];
        for (i, block) in blocks.iter().enumerate() {
            kept[i] = self.kept_lanes(isa, block, mask);
        }
        kept
    }

    /// Prefetches the rows of a block that [`QueryVolume::kept_lanes`] reads.
    #[inline(always)]
    fn prefetch(&self, block: &BoxBlock, _mask: PlaneMask) {
        block.prefetch();
    }

    /// Classifies sixteen nodes at once.
    ///
    /// Returns the lanes that no plane of the mask excludes, and per lane the planes that do not
    /// contain it; bit for bit [`Predicate::classify`]. Words of excluded lanes are unspecified.
    #[inline(always)]
    fn sorted_lanes<I: Isa>(&self, isa: I, block: &BoxBlock, mask: PlaneMask) -> Sorted<I> {
        let mut kept = 0;
        let mut open = [mask; LANES];
        for (lane, open) in open.iter_mut().enumerate() {
            let (verdict, left) = self.classify(&block.get(lane), mask, &mut NoRecorder);
            kept |= LaneMask::from(verdict != Containment::Outside) << lane;
            *open = left;
        }
        (kept, isa.words(&open))
    }

    /// The open planes side by side: tests one box against all of them at once.
    ///
    /// `None` unless that is the whole test of nodes and of items.
    #[inline(always)]
    fn rows(&self) -> Option<PlaneRows> {
        None
    }
}

/// Planes of a mask, not prepared: each block is tested by the volume.
impl<I: Isa, V: QueryVolume> Planes<I> for (&V, PlaneMask) {
    const IN_FOURS: bool = true;
    const SPHERES: bool = V::SPHERES;

    #[inline(always)]
    fn kept_balls(&self, isa: I, balls: &Balls, block: (usize, &BoxBlock)) -> LaneMask {
        self.0.kept_balls(isa, balls, block, self.1)
    }

    #[inline(always)]
    fn kept_of_four(&self, isa: I, blocks: &[BoxBlock; 4]) -> [LaneMask; 4] {
        self.0.kept_of_four(isa, blocks, self.1)
    }
    #[inline(always)]
    fn kept(&self, isa: I, block: &BoxBlock) -> LaneMask {
        self.0.kept_lanes(isa, block, self.1)
    }
    #[inline(always)]
    fn prefetch(&self, block: &BoxBlock) {
        self.0.prefetch(block, self.1);
    }
}

impl QueryVolume for ConvexVolume {
    #[inline(always)]
    fn kept_lanes<I: Isa>(&self, isa: I, block: &BoxBlock, mask: PlaneMask) -> LaneMask {
        block.admitted_by(isa, self, mask)
    }
    #[inline(always)]
    fn kept_of_four<I: Isa>(
        &self,
        isa: I,
        blocks: &[BoxBlock; 4],
        mask: PlaneMask,
    ) -> [LaneMask; 4] {
        BoxBlock::four_admitted_by(isa, blocks, self, mask)
    }

    #[inline(always)]
    fn one_plane<I: Isa>(&self, isa: I, plane: u32) -> impl Planes<I> {
        BroadcastPlane::new(isa, self, plane)
    }
    #[inline(always)]
    fn all_planes<I: Isa>(&self, isa: I) -> Option<impl Planes<I>> {
        BroadcastPlanes::new(isa, self, self.mask())
    }
    #[inline(always)]
    fn prefetch(&self, block: &BoxBlock, mask: PlaneMask) {
        // Mostly one plane or two; more read nearly everything.
        let (lowest, highest) = (mask.trailing_zeros(), mask.checked_ilog2().unwrap_or(0));
        block.prefetch_corner(self.p_vertex_of_bit(lowest));
        block.prefetch_corner(self.p_vertex_of_bit(highest));
        if mask & mask.wrapping_sub(1) & !(1 << highest) != 0 {
            block.prefetch();
        }
    }
    #[inline(always)]
    fn sorted_lanes<I: Isa>(&self, isa: I, block: &BoxBlock, mask: PlaneMask) -> Sorted<I> {
        block.sorted_by(isa, self, mask)
    }
    fn rows(&self) -> Option<PlaneRows> {
        PlaneRows::collect(Bits(self.mask().into()).map(|plane| self.plane_of_bit(plane)))
    }
}

impl QueryVolume for Spheres {
    const SPHERES: bool = true;

    #[inline(always)]
    fn kept_lanes<I: Isa>(&self, isa: I, block: &BoxBlock, mask: PlaneMask) -> LaneMask {
        self.kept_boxes(isa, block, mask)
    }
    #[inline(always)]
    fn as_spheres(&self) -> Option<&Spheres> {
        Some(self)
    }
    #[inline(always)]
    fn one_plane<I: Isa>(&self, isa: I, plane: u32) -> impl Planes<I> {
        BallPlane::new(isa, self, plane)
    }
    #[inline(always)]
    fn all_planes<I: Isa>(&self, isa: I) -> Option<impl Planes<I>> {
        BallFrustum::new(isa, self)
    }
    #[inline(always)]
    fn sorted_lanes<I: Isa>(&self, isa: I, block: &BoxBlock, mask: PlaneMask) -> Sorted<I> {
        block.sorted_by(isa, self.planes(), mask)
    }
    #[inline(always)]
    fn kept_balls<I: Isa>(
        &self,
        isa: I,
        balls: &Balls,
        block: (usize, &BoxBlock),
        mask: PlaneMask,
    ) -> LaneMask {
        self.kept_balls(isa, balls, block, mask)
    }
}

impl QueryVolume for ConvexVolumeF64 {
    #[inline(always)]
    fn kept_lanes<I: Isa>(&self, _: I, block: &BoxBlock, mask: PlaneMask) -> LaneMask {
        let planes =
            Bits(mask.into()).map(|plane| (self.plane_of_bit(plane), self.p_vertex_of_bit(plane)));
        block.admitted_by_wide(planes)
    }
}

impl QueryVolume for RelativeVolume {
    #[inline(always)]
    fn kept_lanes<I: Isa>(&self, isa: I, block: &BoxBlock, mask: PlaneMask) -> LaneMask {
        let moved = block.relative_to(self.eye);
        moved.admitted_by(isa, self.planes(), mask)
    }
    #[inline(always)]
    fn sorted_lanes<I: Isa>(&self, isa: I, block: &BoxBlock, mask: PlaneMask) -> Sorted<I> {
        let moved = block.relative_to(self.eye);
        moved.sorted_by(isa, self.planes(), mask)
    }
}

impl QueryVolume for Vec3 {
    const IS_POINT: bool = true;

    #[inline(always)]
    fn as_point(&self) -> Option<Vec3> {
        Some(*self)
    }
    #[inline(always)]
    fn kept_lanes<I: Isa>(&self, _: I, block: &BoxBlock, mask: PlaneMask) -> LaneMask {
        debug_assert_eq!(mask, self.mask(), "a point is never decided");
        block.holding(*self)
    }
}

impl QueryVolume for Aabb {
    #[inline(always)]
    fn kept_lanes<I: Isa>(&self, _: I, block: &BoxBlock, mask: PlaneMask) -> LaneMask {
        match mask {
            0 => LaneMask::MAX,
            _ if self.is_empty() => 0,
            _ => block.meeting(self),
        }
    }
}

/// Any volume for an erased structure.
///
/// Dispatched once per query, never per node. A box becomes one by
/// [`ConvexVolume::of_box`].
#[derive(Clone, Copy, Debug)]
pub enum AnyVolume<'a> {
    /// THE plane test in f32.
    Planes(&'a ConvexVolume),
    /// The sphere test.
    Spheres(&'a Spheres),
    /// The plane test in f64.
    PlanesF64(&'a ConvexVolumeF64),
    /// The plane test about the eye.
    Relative(&'a RelativeVolume),
    /// Region search.
    Point(Vec3),
}

/// Evaluates an expression for the volume inside, compiled for each type.
macro_rules! each_volume {
    ($any:expr, $volume:ident => $work:expr) => {
        match $any {
            $crate::query::AnyVolume::Planes($volume) => $work,
            $crate::query::AnyVolume::Spheres($volume) => $work,
            $crate::query::AnyVolume::PlanesF64($volume) => $work,
            $crate::query::AnyVolume::Relative($volume) => $work,
            $crate::query::AnyVolume::Point(point) => {
                let $volume = &point;
                $work
            }
        }
    };
}
pub(crate) use each_volume;

impl AnyVolume<'_> {
    /// [`Predicate::sees`] of the volume.
    pub fn sees(&self, item: &Aabb) -> bool {
        each_volume!(*self, volume => volume.sees(item))
    }
}

macro_rules! any_volume_of {
    ($($variant:ident: $volume:ty),*) => {$(
        impl<'a> From<&'a $volume> for AnyVolume<'a> {
            fn from(volume: &'a $volume) -> Self {
                AnyVolume::$variant(volume)
            }
        }
    )*};
}
any_volume_of!(Planes: ConvexVolume, Spheres: Spheres, PlanesF64: ConvexVolumeF64, Relative: RelativeVolume);

impl From<Vec3> for AnyVolume<'_> {
    fn from(point: Vec3) -> Self {
        AnyVolume::Point(point)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::tests_arbitrary::{any_box, number, vector};
    use crate::geometry::{BoxBlocks, Plane, sphere_cube};
    use crate::kernel::Plain;
    use proptest::prelude::*;

    /// Checks the contract of a volume.
    ///
    /// Monotone plane by plane, lanes like the scalar test, verdicts about a node that hold for its
    /// items.
    fn check<V: QueryVolume>(view: &V, items: &[Aabb]) -> Result<(), TestCaseError> {
        let node = Aabb::union_of(items);
        let mask = view.mask();
        for plane in Bits(mask.into()) {
            for item in items {
                prop_assert!(!view.excludes(plane, &node) || view.drops(plane, item));
                prop_assert!(!view.contains(plane, &node) || !view.drops(plane, item));
                prop_assert!(!view.excludes(plane, item) || view.drops(plane, item));
            }
        }
        let (verdict, left) = view.classify(&node, mask, &mut NoRecorder);
        let mut blocks = BoxBlocks::with_capacity(items.len());
        items.iter().for_each(|b| blocks.push(b));
        for (start, lanes, block) in blocks.range(0, items.len()) {
            let (all, open) = (
                view.kept_lanes(Plain, block, mask),
                view.kept_lanes(Plain, block, left),
            );
            let (passed, words) = view.sorted_lanes(Plain, block, mask);
            for lane in (0..16).filter(|lane| lanes >> lane & 1 == 1) {
                let item = &items[start + lane];
                let (verdict_here, left_here) = view.classify(item, mask, &mut NoRecorder);
                let outside = verdict_here == Containment::Outside;
                prop_assert_eq!(passed >> lane & 1 == 0, outside);
                prop_assert!(outside || words[lane] == left_here);
                let seen = view.sees(item);
                prop_assert_eq!(all >> lane & 1 == 1, seen, "lane {} of {:?}", lane, item);
                if verdict != Containment::Outside {
                    prop_assert_eq!(open >> lane & 1 == 1, seen, "masked");
                    prop_assert_eq!(view.admits(item, left, &mut NoRecorder), seen);
                }
                prop_assert!(verdict != Containment::Outside || !seen);
                prop_assert!(verdict != Containment::Inside || seen);
            }
        }
        Ok(())
    }

    #[test]
    fn a_difference_beyond_f32_decides_the_same_in_node_and_item() {
        // The x of the item relative to the eye overflows, the node's does not.
        let item = Aabb::new(Vec3::splat(-3e38), Vec3::splat(-3e38));
        let other = Aabb::new(Vec3::splat(-1.0), Vec3::ZERO);
        let beside = Plane::new(Vec3::new(0.0, 1e-30, 0.0), -1.0);
        for eye in [Vec3::X * 3e38, Vec3::X * -3e38] {
            for sign in [1.0, -1.0] {
                let items = [item, other].map(|b| Aabb::new(b.min * sign, b.max * sign));
                let items = items.map(|b| Aabb::new(b.min.min(b.max), b.min.max(b.max)));
                let volume = ConvexVolume::from_planes(&[beside]).unwrap();
                check(&RelativeVolume::new(eye, volume).unwrap(), &items).unwrap();
            }
        }
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(4000))]

        #[test]
        fn no_volume_contradicts_itself(
            items in prop::collection::vec(any_box(), 1..20),
            planes in prop::collection::vec((vector(), number()), 1..8),
            eye in vector(),
        ) {
            let planes = planes.into_iter().map(|(n, d)| Plane::new(n, d));
            let volume = ConvexVolume::from_planes(&planes.collect::<Vec<_>>()).unwrap();
            check(&volume, &items)?;
            check(&ConvexVolumeF64::from(&volume), &items)?;
            check(&RelativeVolume::new(eye, volume.clone()).unwrap(), &items)?;
            check(&eye, &items)?;
            check(&items[0], &items)?;
            check(&Aabb::new(items[0].max, items[0].min), &items)?;
            let spheres = Spheres::new(&volume);
            // Any boxes, then the cubes that the volume is meant for.
            check(&spheres, &items)?;
            let cubes: Vec<Aabb> = items.iter().map(sphere_cube).collect();
            check(&spheres, &cubes)?;
            for (b, cube) in items.iter().zip(&cubes) {
                prop_assert!(!volume.sees(b) || spheres.sees(cube));
            }
        }
    }
}
