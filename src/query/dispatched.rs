//! A volume dispatched per test, for queries that are not timed.
//!
//! A structure is compiled for it once instead of once per volume.

use super::volume::each_volume;
use super::{AnyVolume, Predicate, QueryVolume, Recorder};
use crate::geometry::{Aabb, BoxBlock, LaneMask, PlaneMask, PlaneRows, Sorted};
use crate::kernel::Isa;

/// Any volume of planes, dispatched per test.
///
/// Verdicts and costs are those of the volume inside, bit for bit. Points are left out: some
/// structures search for a point by a different traversal.
pub(crate) struct Dispatched<'a>(pub AnyVolume<'a>);

// Not inlined, or all volumes would be compiled into each structure again.
impl Predicate for Dispatched<'_> {
    #[inline(never)]
    fn mask(&self) -> PlaneMask {
        each_volume!(self.0, volume => Predicate::mask(volume))
    }
    #[inline(never)]
    fn excludes(&self, plane: u32, bounds: &Aabb) -> bool {
        each_volume!(self.0, volume => volume.excludes(plane, bounds))
    }
    #[inline(never)]
    fn contains(&self, plane: u32, bounds: &Aabb) -> bool {
        each_volume!(self.0, volume => Predicate::contains(volume, plane, bounds))
    }
    #[inline(never)]
    fn drops(&self, plane: u32, item: &Aabb) -> bool {
        each_volume!(self.0, volume => Predicate::drops(volume, plane, item))
    }
    #[inline(never)]
    fn admits<R: Recorder>(&self, item: &Aabb, mask: PlaneMask, recorder: &mut R) -> bool {
        each_volume!(self.0, volume => volume.admits(item, mask, recorder))
    }
}

impl QueryVolume for Dispatched<'_> {
    #[inline(never)]
    fn kept_lanes<I: Isa>(&self, isa: I, block: &BoxBlock, mask: PlaneMask) -> LaneMask {
        each_volume!(self.0, volume => volume.kept_lanes(isa, block, mask))
    }
    /// Does nothing: prefetches gain nothing in an untimed query.
    fn prefetch(&self, _: &BoxBlock, _: PlaneMask) {}
    #[inline(never)]
    fn sorted_lanes<I: Isa>(&self, isa: I, block: &BoxBlock, mask: PlaneMask) -> Sorted<I> {
        each_volume!(self.0, volume => volume.sorted_lanes(isa, block, mask))
    }
    #[inline(never)]
    fn rows(&self) -> Option<PlaneRows> {
        each_volume!(self.0, volume => volume.rows())
    }
}
