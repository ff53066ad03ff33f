//! Planes of a view made ready for many blocks: by numbers that stay in
//! registers, or, where a view has none to keep, by asking it as ever.

use crate::geometry::{BoxBlock, BroadcastPlane, BroadcastPlanes, LaneMask};
use crate::kernel::Isa;

/// Planes of a view, made ready for many blocks that no other plane is open
/// for.
pub trait Planes<I: Isa>: Copy {
    /// [`QueryVolume::kept_lanes`](super::QueryVolume::kept_lanes).
    fn kept(&self, isa: I, block: &BoxBlock) -> LaneMask;

    /// Whether four blocks at once are quicker than each by itself.
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

    /// Asks for the memory that this reads ahead of it.
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
