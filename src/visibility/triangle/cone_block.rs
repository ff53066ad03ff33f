//! Sixteen cones at a time: the test of `normal_cone` in lanes.

use super::eye::Eye;
use super::normal_cone::{Cone, Prepared};
use super::selection::Selection;
use crate::kernel::{Isa, Kernel, LANES, LaneMask, Work};

/// Sixteen cones in f32: 28 bytes a cone.
#[derive(Clone, Copy, Debug, bytemuck::Zeroable, bytemuck::Pod)]
#[repr(C, align(64))]
pub struct ConeBlock {
    apex: [[f32; LANES]; 3],
    axis: [[f32; LANES]; 3],
    /// Infinite for a lane that is never rejected.
    square: [f32; LANES],
}

impl ConeBlock {
    /// Sixteen cones that reject nothing.
    pub const EMPTY: ConeBlock = ConeBlock {
        apex: [[0.0; LANES]; 3],
        axis: [[0.0; LANES]; 3],
        square: [f32::INFINITY; LANES],
    };

    /// Writes a cone.
    pub fn set(&mut self, lane: usize, cone: &Cone) {
        for k in 0..3 {
            self.apex[k][lane] = cone.apex[k];
            self.axis[k][lane] = cone.axis[k];
        }
        self.square[lane] = cone.square();
    }

    /// Apex and axis, three rows each, and the square of the sine.
    #[inline(always)]
    fn rows<I: Isa>(&self, isa: I) -> [I::Floats; 7] {
        // One by one: a closure would be compiled for the portable set.
        [
            isa.load(&self.apex[0]),
            isa.load(&self.apex[1]),
            isa.load(&self.apex[2]),
            isa.load(&self.axis[0]),
            isa.load(&self.axis[1]),
            isa.load(&self.axis[2]),
            isa.load(&self.square),
        ]
    }
}

/// The lanes that see none of their triangles. At the lowest: 21 operations.
#[inline(always)]
pub fn rejected<I: Isa>(isa: I, block: &ConeBlock, view: &Broadcast<I>) -> LaneMask {
    let [x, y, z, a, b, c, square] = block.rows(isa);
    let [ex, ey, ez] = view.minus_eye;
    let [x, y, z] = match view.is_parallel {
        true => [ex, ey, ez],
        false => [isa.add(x, ex), isa.add(y, ey), isa.add(z, ez)],
    };
    let way = [x, y, z];
    let t = isa.add(dot(isa, way, [a, b, c]), view.minus_margin);
    let needed = isa.mul(square, dot(isa, way, way));
    isa.at_most(view.zero, t) & isa.at_most(needed, isa.mul(t, t))
}

#[inline(always)]
fn dot<I: Isa>(isa: I, [x, y, z]: [I::Floats; 3], [a, b, c]: [I::Floats; 3]) -> I::Floats {
    let xy = isa.add(isa.mul(x, a), isa.mul(y, b));
    isa.add(xy, isa.mul(z, c))
}

/// A view in all lanes.
#[derive(Clone, Copy)]
pub struct Broadcast<I: Isa> {
    minus_eye: [I::Floats; 3],
    minus_margin: I::Floats,
    zero: I::Floats,
    is_parallel: bool,
}

impl<I: Isa> Broadcast<I> {
    /// All numbers of a view.
    #[inline(always)]
    pub fn of(isa: I, view: &Prepared) -> Broadcast<I> {
        Broadcast {
            minus_eye: [
                isa.splat(view.minus_eye[0]),
                isa.splat(view.minus_eye[1]),
                isa.splat(view.minus_eye[2]),
            ],
            minus_margin: isa.splat(view.minus_margin),
            zero: isa.splat(0.0),
            is_parallel: view.is_parallel,
        }
    }
}

/// Takes the clusters away whose cones see nothing: one cone a cluster.
pub fn cull_clusters(blocks: &[ConeBlock], eye: &Eye, kernel: Kernel, kept: &mut Selection) {
    if let Some(prepared) = Prepared::of(eye) {
        let (view, words) = (&prepared, kept.blocks_mut());
        kernel.run(Clear {
            blocks,
            view,
            words,
        });
    }
}

struct Clear<'a> {
    blocks: &'a [ConeBlock],
    view: &'a Prepared,
    words: &'a mut [[u64; LANES]],
}

impl Work for Clear<'_> {
    type Output = ();

    #[inline(always)]
    fn run<I: Isa>(self, isa: I) {
        let view = Broadcast::of(isa, self.view);
        for (i, words) in self.words.iter_mut().enumerate() {
            let gone = rejected(isa, &self.blocks[i], &view);
            clear(words, gone, &[u64::MAX; LANES]);
        }
    }
}

/// All ones in the places of the bits of a number below 16.
const SPREAD: [[u64; 4]; 16] = {
    let mut spread = [[0; 4]; 16];
    let mut bits = 0;
    while bits < 16 {
        let mut lane = 0;
        while lane < 4 {
            if bits >> lane & 1 == 1 {
                spread[bits][lane] = u64::MAX;
            }
            lane += 1;
        }
        bits += 1;
    }
    spread
};

/// Takes `triangles` out of the words of the lanes that are gone, without a branch a lane:
/// four at a time, by a table, as compilers make stores under a mask of any comparison here.
#[inline(always)]
pub fn clear(words: &mut [u64; LANES], gone: LaneMask, triangles: &[u64; LANES]) {
    if gone == 0 {
        return;
    }
    for part in 0..LANES / 4 {
        let spread = &SPREAD[usize::from(gone >> (4 * part)) & 15];
        for lane in 0..4 {
            words[4 * part + lane] &= !(spread[lane] & triangles[4 * part + lane]);
        }
    }
}
