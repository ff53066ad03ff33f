//! Planes of a volume prepared for many blocks: coefficients in registers.

use crate::geometry::{BoxBlock, BroadcastPlane, BroadcastPlanes, LaneMask};
use crate::kernel::Isa;

/// Planes of a volume, prepared for many blocks without other open planes.
pub trait Planes<I: Isa>: Copy {
    /// [`QueryVolume::kept_lanes`](super::QueryVolume::kept_lanes).
    fn kept(&self, isa: I, block: &BoxBlock) -> LaneMask;

    /// True if four blocks at once are faster than one after another.
    const IN_FOURS: bool;

    /// [`QueryVolume::kept_of_four`](super::QueryVolume::kept_of_four).
    #[inline(always)]
    fn kept_of_four(&self, isa: I, [a, b, c, d]: &[BoxBlock; 4]) -> [LaneMask; 4] {
        [
            self.kept(isa, a),
            self.kept(isa, b),
            self.kept(isa, c),
            self.kept(isa, d),
        ]
    }

    /// Prefetches the rows of a block that the test reads.
    fn prefetch(&self, block: &BoxBlock);
}

impl<I: Isa> Planes<I> for BroadcastPlane<I> {
    const IN_FOURS: bool = false;

    #[inline(always)]
    fn kept(&self, isa: I, block: &BoxBlock) -> LaneMask {
        self.admitted(isa, block)
    }
    #[inline(always)]
    fn prefetch(&self, block: &BoxBlock) {
        self.prefetch(block);
    }
}

impl<I: Isa> Planes<I> for BroadcastPlanes<I> {
    const IN_FOURS: bool = false;

    #[inline(always)]
    fn kept(&self, isa: I, block: &BoxBlock) -> LaneMask {
        self.admitted(isa, block)
    }
    #[inline(always)]
    fn prefetch(&self, block: &BoxBlock) {
        block.prefetch();
    }
}
