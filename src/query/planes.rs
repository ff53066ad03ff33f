//! Planes of a volume prepared for many blocks: coefficients in registers.

use crate::geometry::{
    BallFrustum, BallPlane, Balls, BoxBlock, BroadcastPlane, BroadcastPlanes, LaneMask,
};
use crate::kernel::Isa;

/// Planes of a volume, prepared for many blocks without other open planes.
pub trait Planes<I: Isa>: Copy {
    /// [`QueryVolume::kept_lanes`](super::QueryVolume::kept_lanes).
    fn kept(&self, isa: I, block: &BoxBlock) -> LaneMask;

    /// True if four blocks at once are faster than one after another.
    const IN_FOURS: bool;

    /// [`QueryVolume::SPHERES`](super::QueryVolume::SPHERES).
    const SPHERES: bool = false;

    /// [`QueryVolume::kept_balls`](super::QueryVolume::kept_balls).
    #[inline(always)]
    fn kept_balls(&self, isa: I, _balls: &Balls, (_, block): (usize, &BoxBlock)) -> LaneMask {
        self.kept(isa, block)
    }

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

impl<I: Isa> Planes<I> for BallPlane<'_, I> {
    const IN_FOURS: bool = false;
    const SPHERES: bool = true;

    #[inline(always)]
    fn kept(&self, isa: I, block: &BoxBlock) -> LaneMask {
        self.kept_boxes(isa, block)
    }
    #[inline(always)]
    fn kept_balls(&self, isa: I, balls: &Balls, block: (usize, &BoxBlock)) -> LaneMask {
        self.kept_balls(isa, balls, block)
    }
    #[inline(always)]
    fn prefetch(&self, block: &BoxBlock) {
        block.prefetch();
    }
}

impl<I: Isa> Planes<I> for BallFrustum<'_, I> {
    const IN_FOURS: bool = false;
    const SPHERES: bool = true;

    #[inline(always)]
    fn kept(&self, isa: I, block: &BoxBlock) -> LaneMask {
        self.kept_boxes(isa, block)
    }
    #[inline(always)]
    fn kept_balls(&self, isa: I, balls: &Balls, block: (usize, &BoxBlock)) -> LaneMask {
        self.kept_balls(isa, balls, block)
    }
    #[inline(always)]
    fn prefetch(&self, block: &BoxBlock) {
        block.prefetch();
    }
}
