//! Planes as the block kernels read them: which rows of a block are a plane's
//! corners, and its numbers in vectors for many blocks.

use super::box_block::{BoxBlock, RowMask};
use super::{ConvexVolume, PlaneMask, Upper};
use crate::kernel::{Isa, LaneMask};

/// The rows of a block that hold the p-vertices of a plane, and those of the
/// opposite corners, its n-vertices: the same ones for every box.
#[derive(Clone, Copy, Debug)]
pub struct Corner {
    /// Whether the p-vertex is at the upper bound, axis by axis. Booleans and no
    /// numbers: a row of theirs needs no check.
    upper: Upper,
}

impl Corner {
    /// Of the upper bounds where `upper` says so.
    pub const fn of(upper: Upper) -> Corner {
        Corner { upper }
    }

    #[inline(always)]
    pub(super) fn far(self) -> [usize; 3] {
        let [x, y, z] = self.upper;
        [
            3 * usize::from(x),
            1 + 3 * usize::from(y),
            2 + 3 * usize::from(z),
        ]
    }

    #[inline(always)]
    pub(super) fn near(self) -> [usize; 3] {
        let [x, y, z] = self.upper;
        [
            3 * usize::from(!x),
            1 + 3 * usize::from(!y),
            2 + 3 * usize::from(!z),
        ]
    }

    /// The rows of the p-vertices as a set.
    #[inline(always)]
    pub fn rows(self) -> RowMask {
        self.far().iter().fold(0, |rows, &row| rows | 1 << row)
    }
}

/// One plane as the block kernels read it, in vectors, for many blocks.
///
/// A corner is outside if `(n.x x + n.y y + n.z z) + d < 0`. Here it is if the
/// sum in brackets is below `-d`, which is the same bit for bit: a rounded sum
/// of two numbers has the sign of the exact one, and is zero only where that is.
#[derive(Clone, Copy)]
pub struct Blade<I: Isa> {
    normal: [I::Floats; 3],
    pub(super) least: I::Floats,
    pub(super) corner: Corner,
}

impl<I: Isa> Blade<I> {
    #[inline(always)]
    pub fn new(isa: I, volume: &ConvexVolume, bit: u32) -> Self {
        let [x, y, z] = volume.plane_of_bit(bit).normal.to_array();
        Blade {
            normal: [isa.splat(x), isa.splat(y), isa.splat(z)],
            least: isa.splat(volume.least_of_bit(bit)),
            corner: volume.corner_of_bit(bit),
        }
    }

    /// Those of the lanes that the plane does not exclude.
    #[inline(always)]
    pub(super) fn keep(&self, isa: I, kept: I::Kept, block: &BoxBlock) -> I::Kept {
        let [a, b, c] = self.normal;
        let [x, y, z] = block.numbered_rows(self.corner.far());
        let sum = isa.add(isa.mul(a, isa.load(x)), isa.mul(b, isa.load(y)));
        let sum = isa.add(sum, isa.mul(c, isa.load(z)));
        isa.keep(kept, sum, self.least)
    }

    /// [`BoxBlock::admitted_by`] for this plane alone.
    #[inline(always)]
    pub fn admitted(&self, isa: I, block: &BoxBlock) -> LaneMask {
        isa.kept(self.keep(isa, isa.keep_all(), block))
    }

    /// Asks for the rows that [`Blade::admitted`] reads.
    #[inline(always)]
    pub fn prefetch(&self, block: &BoxBlock) {
        block.prefetch_corner(self.corner);
    }
}

/// Planes of [`Blades`]: those of a frustum.
pub const MOST_BLADES: usize = 6;

/// The planes of a volume, all of them made ready for many blocks.
#[derive(Clone, Copy)]
pub struct Blades<I: Isa>([Blade<I>; MOST_BLADES]);

impl<I: Isa> Blades<I> {
    /// The planes of a mask; `None` if they are too many.
    #[inline(always)]
    pub fn new(isa: I, volume: &ConvexVolume, mask: PlaneMask) -> Option<Self> {
        // Where there are fewer, the first one is tested again; a volume
        // without any has a plane that excludes nothing in its place.
        let first = Blade::new(isa, volume, mask.trailing_zeros());
        let mut blades = [first; MOST_BLADES];
        let mut left = mask;
        for blade in &mut blades {
            if left != 0 {
                *blade = Blade::new(isa, volume, left.trailing_zeros());
                left &= left - 1;
            }
        }
        (left == 0).then_some(Blades(blades))
    }

    /// [`BoxBlock::admitted_by`] for these planes.
    #[inline(always)]
    pub fn admitted(&self, isa: I, block: &BoxBlock) -> LaneMask {
        let mut kept = isa.keep_all();
        for blade in &self.0 {
            kept = blade.keep(isa, kept, block);
        }
        isa.kept(kept)
    }
}
