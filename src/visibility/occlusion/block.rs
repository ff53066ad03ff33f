//! Sixteen boxes side by side, and the plane test on them. The block is the unit
//! of the tree: what is tested, projected and looked up together.

use crate::geometry::{Aabb, ConvexVolume, PlaneMask};
use crate::kernel::{Isa, LANES, LaneMask};

/// Sixteen boxes as six rows: least x, y, z, then greatest x, y, z; scene-local.
#[derive(Clone, Copy, Debug)]
#[repr(C, align(64))]
pub struct Block {
    /// Row `axis` holds the lower bounds, row `3 + axis` the upper ones.
    pub rows: [[f32; LANES]; 6],
}

impl Block {
    /// The empty box in every lane.
    pub const EMPTY: Block = {
        let (low, high) = ([f32::INFINITY; LANES], [f32::NEG_INFINITY; LANES]);
        Block {
            rows: [low, low, low, high, high, high],
        }
    };

    /// Puts a box into a lane.
    pub fn set(&mut self, lane: usize, b: &Aabb) {
        for axis in 0..3 {
            self.rows[axis][lane] = b.min[axis];
            self.rows[3 + axis][lane] = b.max[axis];
        }
    }

    /// The box in a lane.
    #[inline(always)]
    pub fn get(&self, lane: usize) -> Aabb {
        let row = |k: usize| self.rows[k][lane];
        Aabb::new(
            [row(0), row(1), row(2)].into(),
            [row(3), row(4), row(5)].into(),
        )
    }

    /// The smallest box that holds all sixteen.
    pub fn union(&self) -> Aabb {
        (0..LANES).fold(Aabb::EMPTY, |all, lane| all.union(&self.get(lane)))
    }

    /// The lanes that no plane of the mask excludes, bit for bit as
    /// [`Plane::excludes`](crate::geometry::Plane::excludes) has it, and for each
    /// lane the planes of the mask that do not hold the whole box.
    #[inline(always)]
    pub fn sorted_by<I: Isa>(
        &self,
        isa: I,
        volume: &ConvexVolume,
        mask: PlaneMask,
        open: &mut [PlaneMask; LANES],
    ) -> LaneMask {
        let mut words = isa.splat_word(mask);
        let mut kept = isa.keep_all();
        let mut left = mask;
        while left != 0 {
            let bit = left.trailing_zeros();
            left &= left - 1;
            let minus_d = isa.splat(volume.minus_d_of_bit(bit));
            let upper = volume.p_vertex_signs_of_bit(bit);
            kept = isa.keep(kept, self.sums(isa, volume, bit, upper), minus_d);
            let nearest = self.sums(isa, volume, bit, upper.map(|upper| !upper));
            words = isa.without(words, nearest, minus_d, 1 << bit);
        }
        // The words leave the vector by a row that adds nothing to them.
        isa.compress(open, words, LaneMask::MAX);
        isa.kept(kept)
    }

    /// The lanes that no plane of the mask excludes.
    #[inline(always)]
    pub fn admitted_by<I: Isa>(&self, isa: I, volume: &ConvexVolume, mask: PlaneMask) -> LaneMask {
        let mut kept = isa.keep_all();
        let mut left = mask;
        while left != 0 {
            let bit = left.trailing_zeros();
            left &= left - 1;
            let minus_d = isa.splat(volume.minus_d_of_bit(bit));
            let upper = volume.p_vertex_signs_of_bit(bit);
            kept = isa.keep(kept, self.sums(isa, volume, bit, upper), minus_d);
        }
        isa.kept(kept)
    }

    /// `(nx*x + ny*y) + nz*z` at one corner of each box. It is below `-d` exactly
    /// where the plane's value is below zero: a rounded sum of two numbers has the
    /// sign of the exact one.
    #[inline(always)]
    fn sums<I: Isa>(&self, isa: I, volume: &ConvexVolume, bit: u32, upper: [bool; 3]) -> I::Floats {
        let n = volume.plane_of_bit(bit).normal;
        let row = |axis: usize| &self.rows[if upper[axis] { 3 + axis } else { axis }];
        let along = |n: f32, axis: usize| isa.mul(isa.splat(n), isa.load(row(axis)));
        isa.add(isa.add(along(n.x, 0), along(n.y, 1)), along(n.z, 2))
    }
}

/// The first `count` lanes, all of them from sixteen on.
#[inline(always)]
pub fn first_lanes(count: usize) -> LaneMask {
    if count >= LANES {
        LaneMask::MAX
    } else {
        (1 << count) - 1
    }
}
