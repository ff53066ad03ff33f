//! A volume dispatched per test, for queries that are not timed.
//!
//! A structure is compiled for it once instead of once per volume.

use super::volume::each_volume;
use super::{AnyVolume, Predicate, QueryVolume, Recorder};
use crate::geometry::{Aabb, BoxBlock, LaneMask, PlaneMask, PlaneRows, Sorted};
use crate::kernel::Isa;

/// Any volume of planes, with the verdicts and costs of the volume inside, bit for
/// bit. Points are not among them: some structures search for a point differently.
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
    /// Does nothing: an untimed query gains nothing by it.
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
