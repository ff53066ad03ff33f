//! Planes as the block kernels read them.
//!
//! The rows of a block that are a plane's corners, and the plane's numbers in vectors for many
//! blocks.

use super::balls::{Unit, decide, distances, splat};
use super::box_block::{BoxBlock, sums_at};
use super::{Balls, BoxCorner, ConvexVolume, PlaneMask, Spheres};
use crate::kernel::{Isa, LaneMask, each};

/// Lanes of a block that no plane excludes, and the open planes of each lane.
pub type Sorted<I> = (LaneMask, <I as Isa>::Words);

/// Planes of a volume, prepared for many blocks with the same open planes.
pub trait Planes<I: Isa>: Copy {
    /// True if testing four blocks at once is faster than one by one.
    const IN_FOURS: bool = false;

    /// True if the planes test spheres, if a structure has them.
    const SPHERES: bool = false;

    /// The lanes that the planes do not drop.
    fn kept(&self, isa: I, block: &BoxBlock) -> LaneMask;

    /// [`Planes::kept`] of a block with its index in `balls`, its spheres.
    #[inline(always)]
    fn kept_balls(&self, isa: I, _balls: &Balls, (_, block): (usize, &BoxBlock)) -> LaneMask {
        self.kept(isa, block)
    }

    /// [`Planes::kept`] of four blocks.
    #[inline(always)]
    fn kept_of_four(&self, isa: I, blocks: &[BoxBlock; 4]) -> [LaneMask; 4] {
        each([0, 1, 2, 3], |i| self.kept(isa, &blocks[i]))
    }

    /// Prefetches the rows of a block that the test reads.
    #[inline(always)]
    fn prefetch(&self, block: &BoxBlock) {
        block.prefetch();
    }
}

/// One plane in vectors, as the block kernels read it, for many blocks.
///
/// A corner is outside if `(n.x x + n.y y + n.z z) + d < 0`. Testing the sum in brackets against
/// `-d` is the same bit for bit: a rounded sum of two numbers has the sign of the exact one, and is
/// zero only if that is.
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

    /// Keeps the lanes that the plane does not exclude.
    #[inline(always)]
    pub(super) fn keep(&self, isa: I, kept: I::Kept, block: &BoxBlock) -> I::Kept {
        let [a, b, c] = self.normal;
        let [x, y, z] = block.corner_rows(self.p_vertex);
        let sum = isa.add(isa.mul(a, isa.load(x)), isa.mul(b, isa.load(y)));
        let sum = isa.add(sum, isa.mul(c, isa.load(z)));
        isa.keep(kept, sum, self.minus_d)
    }
}

/// [`BoxBlock::admitted_by`] for this plane alone.
impl<I: Isa> Planes<I> for BroadcastPlane<I> {
    #[inline(always)]
    fn kept(&self, isa: I, block: &BoxBlock) -> LaneMask {
        isa.kept(self.keep(isa, isa.keep_all(), block))
    }
    #[inline(always)]
    fn prefetch(&self, block: &BoxBlock) {
        block.prefetch_corner(self.p_vertex);
    }
}

/// Number of planes of [`BroadcastPlanes`]: those of a frustum.
pub const MOST_PLANES: usize = 6;

/// The planes of a volume in vectors, for many blocks.
#[derive(Clone, Copy)]
pub struct BroadcastPlanes<I: Isa>([BroadcastPlane<I>; MOST_PLANES]);

impl<I: Isa> BroadcastPlanes<I> {
    /// The planes of a mask; `None` if there are too many.
    #[inline(always)]
    pub fn new(isa: I, volume: &ConvexVolume, mask: PlaneMask) -> Option<Self> {
        // Missing planes are replaced by the first one; a volume without planes gets one that
        // excludes nothing.
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
}

/// [`BoxBlock::admitted_by`] for these planes.
impl<I: Isa> Planes<I> for BroadcastPlanes<I> {
    #[inline(always)]
    fn kept(&self, isa: I, block: &BoxBlock) -> LaneMask {
        let mut kept = isa.keep_all();
        for plane in &self.0 {
            kept = plane.keep(isa, kept, block);
        }
        isa.kept(kept)
    }
}

/// One plane of a sphere test in vectors, for many blocks.
#[derive(Clone, Copy)]
pub struct BallPlane<'a, I: Isa> {
    spheres: &'a Spheres,
    index: u32,
    plane: Unit<I>,
}

impl<'a, I: Isa> BallPlane<'a, I> {
    /// The plane of that bit.
    #[inline(always)]
    pub fn new(isa: I, spheres: &'a Spheres, index: u32) -> Self {
        let plane = splat(isa, spheres.plane_of_bit(index).1.unit);
        BallPlane {
            spheres,
            index,
            plane,
        }
    }
}

/// The test of [`Spheres`] for this plane alone.
impl<I: Isa> Planes<I> for BallPlane<'_, I> {
    const SPHERES: bool = true;

    #[inline(always)]
    fn kept(&self, isa: I, block: &BoxBlock) -> LaneMask {
        self.spheres.kept_boxes(isa, block, 1 << self.index)
    }
    #[inline(always)]
    fn kept_balls(&self, isa: I, balls: &Balls, (at, block): (usize, &BoxBlock)) -> LaneMask {
        let (centres, radii) = balls.load(isa, at);
        let farthest = isa.add(distances(isa, self.plane, centres), radii);
        let question = || (self.spheres, 1 << self.index, block);
        decide(isa, farthest, balls.doubt, question)
    }
}

/// The planes of a view frustum in vectors, for many blocks.
#[derive(Clone, Copy)]
pub struct BallFrustum<'a, I: Isa> {
    spheres: &'a Spheres,
    depth: Unit<I>,
    half_depth: I::Floats,
    sides: [([I::Floats; 2], Unit<I>); 2],
}

impl<'a, I: Isa> BallFrustum<'a, I> {
    /// `None` unless the planes are those of a symmetric frustum with a far plane.
    #[inline(always)]
    pub fn new(isa: I, spheres: &'a Spheres) -> Option<Self> {
        let sums = spheres.frustum.as_ref()?;
        let [([f, r], t), ([g, s], u)] = sums.sides;
        Some(BallFrustum {
            spheres,
            depth: splat(isa, sums.depth),
            half_depth: isa.splat(sums.half_depth),
            sides: [
                ([isa.splat(f), isa.splat(r)], splat(isa, t)),
                ([isa.splat(g), isa.splat(s)], splat(isa, u)),
            ],
        })
    }
}

/// The test of [`Spheres`] for all planes.
impl<I: Isa> Planes<I> for BallFrustum<'_, I> {
    const SPHERES: bool = true;

    #[inline(always)]
    fn kept(&self, isa: I, block: &BoxBlock) -> LaneMask {
        self.spheres.kept_boxes(isa, block, 0b11_1111)
    }
    #[inline(always)]
    fn kept_balls(&self, isa: I, balls: &Balls, (at, block): (usize, &BoxBlock)) -> LaneMask {
        let (centres, radii) = balls.load(isa, at);
        let depth = distances(isa, self.depth, centres);
        let mut least = isa.sub_abs(self.half_depth, depth);
        for ([factor, rest], t) in self.sides {
            let s = isa.near_mul_add(factor, depth, rest);
            least = isa.min(isa.sub_abs(s, distances(isa, t, centres)), least);
        }
        let question = || (self.spheres, 0b11_1111, block);
        decide(isa, isa.add(least, radii), 2.0 * balls.doubt, question)
    }
}

/// THE plane test on sixteen boxes at once.
impl BoxBlock {
    /// The lanes that none of the planes of a mask excludes.
    ///
    /// Bit for bit [`Plane::excludes`](super::Plane::excludes), lane by lane. Bits of lanes without
    /// a box are unspecified.
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

    /// [`BoxBlock::admitted_by`] for four blocks.
    ///
    /// Each plane's numbers are broadcast once for all four. This pays if all planes are open and
    /// there are too few registers to keep them.
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
        each(kept, |kept| isa.kept(kept))
    }

    /// [`BoxBlock::admitted_by`] for nodes, with the planes open below each lane.
    ///
    /// A lane's word is `mask` without the planes that contain the whole box
    /// ([`Plane::contains`](super::Plane::contains)).
    #[inline(always)]
    pub fn sorted_by<I: Isa>(&self, isa: I, volume: &ConvexVolume, mask: PlaneMask) -> Sorted<I> {
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
