//! Planes as the block kernels read them: which rows of a block are a plane's
//! corners, and its numbers in vectors for many blocks.

use super::box_block::{BoxBlock, sums_at};
use super::{BoxCorner, ConvexVolume, PlaneMask};
use crate::kernel::{Isa, LaneMask};

/// One plane as the block kernels read it, in vectors, for many blocks.
///
/// A corner is outside if `(n.x x + n.y y + n.z z) + d < 0`. Here it is if the
/// sum in brackets is below `-d`, which is the same bit for bit: a rounded sum
/// of two numbers has the sign of the exact one, and is zero only where that is.
#[derive(Clone, Copy)]
pub struct BroadcastPlane<I: Isa> {
    normal: [I::Floats; 3],
    pub(super) minus_d: I::Floats,
    pub(super) p_vertex: BoxCorner,
}

impl<I: Isa> BroadcastPlane<I> {
    /// The plane of a volume that this bit of a mask stands for.
    #[inline(always)]
    pub fn new(isa: I, volume: &ConvexVolume, bit: u32) -> Self {
        let [x, y, z] = volume.plane_of_bit(bit).normal.to_array();
        BroadcastPlane {
            normal: [isa.splat(x), isa.splat(y), isa.splat(z)],
            minus_d: isa.splat(volume.minus_d_of_bit(bit)),
            p_vertex: volume.p_vertex_of_bit(bit),
        }
    }

    /// Those of the lanes that the plane does not exclude.
    #[inline(always)]
    pub(super) fn keep(&self, isa: I, kept: I::Kept, block: &BoxBlock) -> I::Kept {
        let [a, b, c] = self.normal;
        let [x, y, z] = block.corner_rows(self.p_vertex);
        let sum = isa.add(isa.mul(a, isa.load(x)), isa.mul(b, isa.load(y)));
        let sum = isa.add(sum, isa.mul(c, isa.load(z)));
        isa.keep(kept, sum, self.minus_d)
    }

    /// [`BoxBlock::admitted_by`] for this plane alone.
    #[inline(always)]
    pub fn admitted(&self, isa: I, block: &BoxBlock) -> LaneMask {
        isa.kept(self.keep(isa, isa.keep_all(), block))
    }

    /// Prefetches the rows that [`BroadcastPlane::admitted`] reads.
    #[inline(always)]
    pub fn prefetch(&self, block: &BoxBlock) {
        block.prefetch_corner(self.p_vertex);
    }
}

/// Planes of [`BroadcastPlanes`]: those of a frustum.
pub const MOST_PLANES: usize = 6;

/// The planes of a volume in vectors, for many blocks.
#[derive(Clone, Copy)]
pub struct BroadcastPlanes<I: Isa>([BroadcastPlane<I>; MOST_PLANES]);

impl<I: Isa> BroadcastPlanes<I> {
    /// The planes of a mask; `None` if they are too many.
    #[inline(always)]
    pub fn new(isa: I, volume: &ConvexVolume, mask: PlaneMask) -> Option<Self> {
        // Where there are fewer, the first one is tested again; a volume
        // without any has a plane that excludes nothing in its place.
        let first = BroadcastPlane::new(isa, volume, mask.trailing_zeros());
        let mut planes = [first; MOST_PLANES];
        let mut left = mask;
        for plane in &mut planes {
            if left != 0 {
                *plane = BroadcastPlane::new(isa, volume, left.trailing_zeros());
                left &= left - 1;
            }
        }
        (left == 0).then_some(BroadcastPlanes(planes))
    }

    /// [`BoxBlock::admitted_by`] for these planes.
    #[inline(always)]
    pub fn admitted(&self, isa: I, block: &BoxBlock) -> LaneMask {
        let mut kept = isa.keep_all();
        for plane in &self.0 {
            kept = plane.keep(isa, kept, block);
        }
        isa.kept(kept)
    }
}

/// THE plane test on sixteen boxes at once.
impl BoxBlock {
    /// The lanes that none of the planes of a mask excludes: bit for bit
    /// [`Plane::excludes`](super::Plane::excludes), lane by lane. Lanes without a box come out as they
    /// may.
    #[inline(always)]
    pub fn admitted_by<I: Isa>(&self, isa: I, volume: &ConvexVolume, mask: PlaneMask) -> LaneMask {
        let mut kept = isa.keep_all();
        let mut left = mask;
        while left != 0 {
            kept = BroadcastPlane::new(isa, volume, left.trailing_zeros()).keep(isa, kept, self);
            left &= left - 1;
        }
        isa.kept(kept)
    }

    /// [`BoxBlock::admitted_by`] for four blocks: each plane's numbers are
    /// broadcast once for all of them, which pays where all planes are open and
    /// registers are too few to keep them ([`BroadcastPlanes`](super::BroadcastPlanes)).
    #[inline(always)]
    pub fn four_admitted_by<I: Isa>(
        isa: I,
        blocks: &[BoxBlock; 4],
        volume: &ConvexVolume,
        mask: PlaneMask,
    ) -> [LaneMask; 4] {
        let mut kept = [isa.keep_all(); 4];
        let mut left = mask;
        while left != 0 {
            let plane = BroadcastPlane::new(isa, volume, left.trailing_zeros());
            left &= left - 1;
            for i in 0..4 {
                kept[i] = plane.keep(isa, kept[i], &blocks[i]);
            }
        }
        [
            isa.kept(kept[0]),
            isa.kept(kept[1]),
            isa.kept(kept[2]),
            isa.kept(kept[3]),
        ]
    }

    /// [`BoxBlock::admitted_by`] for nodes: also which planes stay open below
    /// each lane. A lane's word is `mask` without the planes that hold the
    /// whole box ([`Plane::contains`](super::Plane::contains)).
    #[inline(always)]
    pub fn sorted_by<I: Isa>(
        &self,
        isa: I,
        volume: &ConvexVolume,
        mask: PlaneMask,
    ) -> (LaneMask, I::Words) {
        let mut kept = isa.keep_all();
        let mut open = isa.splat_word(mask);
        let mut left = mask;
        while left != 0 {
            let bit = left.trailing_zeros();
            left &= left - 1;
            let plane = BroadcastPlane::new(isa, volume, bit);
            kept = plane.keep(isa, kept, self);
            let near = self.corner_rows(plane.p_vertex.opposite());
            let nearest = sums_at(isa, volume.plane_of_bit(bit).normal, near);
            let minus_d = isa.splat(volume.minus_d_of_bit(bit));
            open = isa.without(open, nearest, minus_d, 1 << bit);
        }
        (isa.kept(kept), open)
    }
}
