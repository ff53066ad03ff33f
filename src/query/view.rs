//! What a camera's view is asked with: planes, and how a box is tested against
//! one of them. The culling tests and precisions there are, the masks that all
//! of them share, and one type for any of them.

use crate::geometry::{
    ALL_ROWS, Aabb, Blade, Blades, BoxBlock, ConvexVolume, LANES, LaneMask, PlaneMask, PlaneRows,
    RelativeVolume, RowMask, Spheres, WideVolume,
};

use super::planes::planes_as_ever;
use super::{AsEver, Containment, NoRecorder, Planes, Recorder, Region};
use crate::kernel::Isa;

/// Up to 32 planes with a culling test of their own; every view is a
/// [`Region`] whose memo is the mask of the planes that are still open.
///
/// An implementation must be monotone, for each plane by itself:
///
/// - if it [excludes](View::excludes) a box it drops every item within;
/// - if it [contains](View::contains) a box it drops no item within.
///
/// Then a tree may skip what is excluded, accept what is contained and leave
/// decided planes out, and still returns exactly `{ i : view.sees(items[i]) }`,
/// bit for bit, as a scan does.
pub trait View: Sized {
    /// Bits of the planes that constrain anything: what a query starts with.
    fn mask(&self) -> PlaneMask;

    /// Whether the plane of that bit has the whole box on its outer side.
    fn excludes(&self, plane: u32, bounds: &Aabb) -> bool;

    /// Whether the plane of that bit has the whole box on its inner side.
    fn contains(&self, plane: u32, bounds: &Aabb) -> bool;

    /// Whether an item is dropped by the plane of that bit; by default, where
    /// its bounds are excluded.
    #[inline(always)]
    fn drops(&self, plane: u32, item: &Aabb) -> bool {
        self.excludes(plane, item)
    }

    /// The lanes that no plane of the mask drops: bit for bit
    /// [`View::drops`], lane by lane.
    fn kept_lanes<I: Isa>(&self, isa: I, block: &BoxBlock, mask: PlaneMask) -> LaneMask;

    /// One plane by itself, made ready for many blocks.
    type OnePlane<'v, I: Isa>: Planes<I>
    where
        Self: 'v;

    /// The plane of that bit, made ready: [`View::kept_lanes`] with this bit for
    /// a mask.
    fn one_plane<I: Isa>(&self, isa: I, plane: u32) -> Self::OnePlane<'_, I>;

    /// [`View::kept_lanes`] of four blocks.
    #[inline(always)]
    fn kept_of_four<I: Isa>(
        &self,
        isa: I,
        [a, b, c, d]: &[BoxBlock; 4],
        mask: PlaneMask,
    ) -> [LaneMask; 4] {
        [
            self.kept_lanes(isa, a, mask),
            self.kept_lanes(isa, b, mask),
            self.kept_lanes(isa, c, mask),
            self.kept_lanes(isa, d, mask),
        ]
    }

    /// All planes, made ready for many blocks.
    type AllPlanes<'v, I: Isa>: Planes<I>
    where
        Self: 'v;

    /// All planes, made ready: [`View::kept_lanes`] with [`View::mask`]. `None`
    /// if they are too many.
    fn all_planes<I: Isa>(&self, isa: I) -> Option<Self::AllPlanes<'_, I>>;

    /// The rows of a block that [`View::kept_lanes`] reads.
    #[inline(always)]
    fn rows_read(&self, _mask: PlaneMask) -> RowMask {
        ALL_ROWS
    }

    /// Asks for the memory that [`View::kept_lanes`] reads ahead of it.
    #[inline(always)]
    fn prefetch(&self, block: &BoxBlock, _mask: PlaneMask) {
        block.prefetch();
    }

    /// Sixteen nodes at once: the lanes that no plane of the mask excludes, and
    /// for each of them the planes that do not contain it, bit for bit
    /// [`Region::classify`]. Lanes that are excluded have any word.
    #[inline(always)]
    fn sorted_lanes<I: Isa>(
        &self,
        isa: I,
        block: &BoxBlock,
        mask: PlaneMask,
    ) -> (LaneMask, I::Words) {
        let mut kept = 0;
        let mut open = [mask; LANES];
        for (lane, open) in open.iter_mut().enumerate() {
            let (verdict, left) = self.classify(&block.get(lane), mask, &mut NoRecorder);
            kept |= LaneMask::from(verdict != Containment::Outside) << lane;
            *open = left;
        }
        (kept, isa.words(&open))
    }

    /// The open planes side by side, where one box against all of them at once
    /// is the whole test of nodes and of items; `None` where it is not.
    #[inline(always)]
    fn rows(&self) -> Option<PlaneRows> {
        None
    }

    /// Whether an item belongs to the answer: no plane drops it, and it is not
    /// empty. O(planes).
    fn sees(&self, item: &Aabb) -> bool {
        !item.is_empty() && self.admits(item, self.mask(), &mut NoRecorder)
    }
}

impl<V: View> Region for V {
    type Memo = PlaneMask;

    #[inline(always)]
    fn start(&self) -> PlaneMask {
        self.mask()
    }

    /// Tests only the planes left in `mask`. `bounds` must not be empty.
    #[inline(always)]
    fn classify<R: Recorder>(
        &self,
        bounds: &Aabb,
        mask: PlaneMask,
        recorder: &mut R,
    ) -> (Containment, PlaneMask) {
        let mut undecided = mask;
        for plane in Bits(mask) {
            recorder.planes_tested(1);
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

    /// Half the work of [`Region::classify`]: an item has no children to hand
    /// a mask to, so nothing needs to be contained.
    #[inline(always)]
    fn admits<R: Recorder>(&self, item: &Aabb, mask: PlaneMask, recorder: &mut R) -> bool {
        for plane in Bits(mask) {
            recorder.planes_tested(1);
            if self.drops(plane, item) {
                return false;
            }
        }
        true
    }

    #[inline(always)]
    fn admit_lanes<I: Isa>(&self, isa: I, block: &BoxBlock, mask: PlaneMask) -> LaneMask {
        self.kept_lanes(isa, block, mask)
    }

    #[inline(always)]
    fn planes_open(mask: PlaneMask) -> u32 {
        mask.count_ones()
    }
}

/// THE plane test in f32. Monotone because round-to-nearest is: see
/// [`Plane::value_at`](crate::geometry::Plane::value_at).
impl View for ConvexVolume {
    #[inline(always)]
    fn mask(&self) -> PlaneMask {
        self.mask()
    }
    #[inline(always)]
    fn excludes(&self, plane: u32, bounds: &Aabb) -> bool {
        self.plane_of_bit(plane).excludes(bounds)
    }
    #[inline(always)]
    fn contains(&self, plane: u32, bounds: &Aabb) -> bool {
        self.plane_of_bit(plane).contains(bounds)
    }
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

    type OnePlane<'v, I: Isa> = Blade<I>;
    type AllPlanes<'v, I: Isa> = Blades<I>;

    #[inline(always)]
    fn one_plane<I: Isa>(&self, isa: I, plane: u32) -> Blade<I> {
        Blade::new(isa, self, plane)
    }
    #[inline(always)]
    fn all_planes<I: Isa>(&self, isa: I) -> Option<Blades<I>> {
        Blades::new(isa, self, self.mask())
    }
    #[inline(always)]
    fn rows_read(&self, mask: PlaneMask) -> RowMask {
        Bits(mask).fold(0, |rows, plane| rows | self.corner_of_bit(plane).rows())
    }
    #[inline(always)]
    fn prefetch(&self, block: &BoxBlock, mask: PlaneMask) {
        // Mostly one plane or two; more read nearly everything.
        let (lowest, highest) = (mask.trailing_zeros(), mask.checked_ilog2().unwrap_or(0));
        block.prefetch_corner(self.corner_of_bit(lowest));
        block.prefetch_corner(self.corner_of_bit(highest));
        if mask & mask.wrapping_sub(1) & !(1 << highest) != 0 {
            block.prefetch();
        }
    }
    #[inline(always)]
    fn sorted_lanes<I: Isa>(
        &self,
        isa: I,
        block: &BoxBlock,
        mask: PlaneMask,
    ) -> (LaneMask, I::Words) {
        block.sorted_by(isa, self, mask)
    }
    fn rows(&self) -> Option<PlaneRows> {
        PlaneRows::collect(Bits(self.mask()).map(|plane| self.plane_of_bit(plane)))
    }
}

/// The sphere test, on an index over [`sphere_cube`](crate::geometry::sphere_cube)s.
/// Nodes get the plane test, items that and their spheres'; monotone because
/// the cube's corners have a say in both: see [`Spheres`].
impl View for Spheres {
    planes_as_ever!();

    #[inline(always)]
    fn mask(&self) -> PlaneMask {
        self.planes().mask()
    }
    #[inline(always)]
    fn excludes(&self, plane: u32, bounds: &Aabb) -> bool {
        self.planes().plane_of_bit(plane).excludes(bounds)
    }
    #[inline(always)]
    fn contains(&self, plane: u32, bounds: &Aabb) -> bool {
        self.planes().plane_of_bit(plane).contains(bounds)
    }
    #[inline(always)]
    fn drops(&self, plane: u32, item: &Aabb) -> bool {
        self.drops(plane, item)
    }
    #[inline(always)]
    fn kept_lanes<I: Isa>(&self, _: I, block: &BoxBlock, mask: PlaneMask) -> LaneMask {
        block.admitted_as_spheres(Bits(mask).map(|index| {
            let (plane, margin) = self.plane_of_bit(index);
            (plane, self.planes().upper_of_bit(index), margin)
        }))
    }
}

/// The plane test in f64. Monotone as in f32: promoting is exact, and every
/// operation rounds to nearest.
impl View for WideVolume {
    planes_as_ever!();

    #[inline(always)]
    fn mask(&self) -> PlaneMask {
        self.mask()
    }
    #[inline(always)]
    fn excludes(&self, plane: u32, bounds: &Aabb) -> bool {
        self.plane_of_bit(plane).excludes(bounds)
    }
    #[inline(always)]
    fn contains(&self, plane: u32, bounds: &Aabb) -> bool {
        self.plane_of_bit(plane).contains(bounds)
    }
    #[inline(always)]
    fn kept_lanes<I: Isa>(&self, _: I, block: &BoxBlock, mask: PlaneMask) -> LaneMask {
        let planes = Bits(mask).map(|plane| (self.plane_of_bit(plane), self.upper_of_bit(plane)));
        block.admitted_by_wide(planes)
    }
}

/// The plane test on boxes relative to the eye. Monotone because moving a box
/// is ([`Aabb::relative_to`]): a box within another is moved to a box within
/// the other one moved, and there the plane test is monotone.
impl View for RelativeVolume {
    planes_as_ever!();

    #[inline(always)]
    fn mask(&self) -> PlaneMask {
        self.planes().mask()
    }
    #[inline(always)]
    fn excludes(&self, plane: u32, bounds: &Aabb) -> bool {
        let planes = self.planes();
        planes.plane_of_bit(plane).excludes(&self.moved(bounds))
    }
    #[inline(always)]
    fn contains(&self, plane: u32, bounds: &Aabb) -> bool {
        let planes = self.planes();
        planes.plane_of_bit(plane).contains(&self.moved(bounds))
    }
    #[inline(always)]
    fn kept_lanes<I: Isa>(&self, isa: I, block: &BoxBlock, mask: PlaneMask) -> LaneMask {
        let moved = block.relative_to(self.eye());
        moved.admitted_by(isa, self.planes(), mask)
    }
    #[inline(always)]
    fn sorted_lanes<I: Isa>(
        &self,
        isa: I,
        block: &BoxBlock,
        mask: PlaneMask,
    ) -> (LaneMask, I::Words) {
        let moved = block.relative_to(self.eye());
        moved.sorted_by(isa, self.planes(), mask)
    }
}

/// Any of the views there are: what an erased structure is asked with. It is
/// looked into once per query, never per node.
#[derive(Clone, Copy, Debug)]
#[non_exhaustive]
pub enum AnyView<'a> {
    Volume(&'a ConvexVolume),
    Spheres(&'a Spheres),
    Wide(&'a WideVolume),
    Relative(&'a RelativeVolume),
}

impl AnyView<'_> {
    /// [`View::sees`] of the view.
    pub fn sees(&self, item: &Aabb) -> bool {
        match self {
            AnyView::Volume(view) => view.sees(item),
            AnyView::Spheres(view) => view.sees(item),
            AnyView::Wide(view) => view.sees(item),
            AnyView::Relative(view) => view.sees(item),
        }
    }
}

macro_rules! any_view_of {
    ($($variant:ident: $view:ty),*) => {$(
        impl<'a> From<&'a $view> for AnyView<'a> {
            fn from(view: &'a $view) -> Self {
                AnyView::$variant(view)
            }
        }
    )*};
}
any_view_of!(Volume: ConvexVolume, Spheres: Spheres, Wide: WideVolume, Relative: RelativeVolume);

/// The bits that are set, lowest first.
struct Bits(PlaneMask);

impl Iterator for Bits {
    type Item = u32;

    #[inline(always)]
    fn next(&mut self) -> Option<u32> {
        if self.0 == 0 {
            return None;
        }
        let index = self.0.trailing_zeros();
        self.0 &= self.0 - 1;
        Some(index)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::arbitrary::{any_box, number, vector};
    use crate::geometry::{BoxBlocks, Plane, sphere_cube};
    use crate::kernel::{BASELINE, Plain};
    use glam::Vec3;
    use proptest::prelude::*;

    /// What every view owes: monotone plane by plane, lanes like the scalar
    /// test, and verdicts about a node that fit all of its items.
    fn check<V: View>(view: &V, items: &[Aabb]) -> Result<(), TestCaseError> {
        let node = Aabb::union_of(items);
        let mask = view.mask();
        for plane in Bits(mask) {
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
                view.kept_lanes(BASELINE, block, mask),
                view.kept_lanes(BASELINE, block, left),
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
        fn no_view_contradicts_itself(
            items in prop::collection::vec(any_box(), 1..20),
            planes in prop::collection::vec((vector(), number()), 1..8),
            eye in vector(),
        ) {
            let planes = planes.into_iter().map(|(n, d)| Plane::new(n, d));
            let volume = ConvexVolume::from_planes(&planes.collect::<Vec<_>>()).unwrap();
            check(&volume, &items)?;
            check(&WideVolume::from(&volume), &items)?;
            check(&RelativeVolume::new(eye, volume.clone()).unwrap(), &items)?;
            let spheres = Spheres::new(&volume);
            // Whatever the boxes are, and as they are meant.
            check(&spheres, &items)?;
            let cubes: Vec<Aabb> = items.iter().map(sphere_cube).collect();
            check(&spheres, &cubes)?;
            for (b, cube) in items.iter().zip(&cubes) {
                prop_assert!(!volume.sees(b) || spheres.sees(cube));
            }
        }
    }
}
