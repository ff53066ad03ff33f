//! Sixteen lanes at a time: the few vector operations that the block kernels
//! are written in, and the instruction set that has them as plain arrays. Which
//! one runs is chosen next door; what the lanes mean is the callers' business.

/// Lanes of a vector: the boxes of one block.
pub const LANES: usize = 16;

/// One bit per lane.
pub type LaneMask = u16;

/// An instruction set: sixteen f32 lanes and sixteen u32 lanes.
///
/// Every operation rounds once, to nearest, and lane by lane; so whatever is
/// written in them comes out bit for bit the same on every instruction set. A
/// value of such a type is the proof that the processor has it.
pub trait Isa: Copy {
    /// Sixteen f32.
    type Floats: Copy;
    /// Sixteen u32.
    type Words: Copy;

    fn load(self, row: &[f32; LANES]) -> Self::Floats;
    fn to_array(self, floats: Self::Floats) -> [f32; LANES];
    fn splat(self, x: f32) -> Self::Floats;
    fn add(self, a: Self::Floats, b: Self::Floats) -> Self::Floats;
    fn sub(self, a: Self::Floats, b: Self::Floats) -> Self::Floats;
    fn mul(self, a: Self::Floats, b: Self::Floats) -> Self::Floats;
    /// `a` where `a < b`, else `b`: of a NaN and a number in this order, the
    /// number.
    fn lower(self, a: Self::Floats, b: Self::Floats) -> Self::Floats;
    /// The lanes where `a < 0`.
    fn below_zero(self, a: Self::Floats) -> LaneMask;
    /// The lanes where `a <= b`.
    fn at_most(self, a: Self::Floats, b: Self::Floats) -> LaneMask;

    fn words(self, row: &[u32; LANES]) -> Self::Words;
    fn splat_word(self, x: u32) -> Self::Words;
    /// `first`, `first + 1` and so on.
    fn counting(self, first: u32) -> Self::Words;
    /// `words` without `bits` in the lanes where `values >= 0`.
    fn without(self, words: Self::Words, values: Self::Floats, bits: u32) -> Self::Words;
    /// `words` with `bits` set in some lanes.
    fn with(self, words: Self::Words, lanes: LaneMask, bits: u32) -> Self::Words;
    /// The lanes that are zero.
    fn zeros(self, words: Self::Words) -> LaneMask;
    /// Moves the words of `lanes` together, lowest first, to the start of
    /// `place`; what the rest of it holds is nobody's business.
    fn pack(self, place: &mut [u32; LANES], words: Self::Words, lanes: LaneMask);
    /// Appends the words of `lanes`, lowest first.
    fn append(self, out: &mut Vec<u32>, row: &[u32; LANES], lanes: LaneMask);
}

/// Plain arrays, which the compiler turns into whatever vectors there are: for
/// processors without a file of their own here, and for Miri.
#[derive(Clone, Copy, Debug)]
pub struct Plain;

#[inline(always)]
fn lanes_where(holds: impl Fn(usize) -> bool) -> LaneMask {
    // A bit as wide as a float: a comparison then selects among them without
    // leaving the vector.
    let bits: [u32; LANES] = std::array::from_fn(|lane| u32::from(holds(lane)) << lane);
    bits.iter().fold(0, |all, bit| all | bit) as LaneMask
}

impl Isa for Plain {
    type Floats = [f32; LANES];
    type Words = [u32; LANES];

    #[inline(always)]
    fn load(self, row: &[f32; LANES]) -> [f32; LANES] {
        *row
    }
    #[inline(always)]
    fn to_array(self, floats: [f32; LANES]) -> [f32; LANES] {
        floats
    }
    #[inline(always)]
    fn splat(self, x: f32) -> [f32; LANES] {
        [x; LANES]
    }
    #[inline(always)]
    fn add(self, a: [f32; LANES], b: [f32; LANES]) -> [f32; LANES] {
        std::array::from_fn(|lane| a[lane] + b[lane])
    }
    #[inline(always)]
    fn sub(self, a: [f32; LANES], b: [f32; LANES]) -> [f32; LANES] {
        std::array::from_fn(|lane| a[lane] - b[lane])
    }
    #[inline(always)]
    fn mul(self, a: [f32; LANES], b: [f32; LANES]) -> [f32; LANES] {
        std::array::from_fn(|lane| a[lane] * b[lane])
    }
    #[inline(always)]
    fn lower(self, a: [f32; LANES], b: [f32; LANES]) -> [f32; LANES] {
        std::array::from_fn(|lane| if a[lane] < b[lane] { a[lane] } else { b[lane] })
    }
    #[inline(always)]
    fn below_zero(self, a: [f32; LANES]) -> LaneMask {
        lanes_where(|lane| a[lane] < 0.0)
    }
    #[inline(always)]
    fn at_most(self, a: [f32; LANES], b: [f32; LANES]) -> LaneMask {
        lanes_where(|lane| a[lane] <= b[lane])
    }
    #[inline(always)]
    fn words(self, row: &[u32; LANES]) -> [u32; LANES] {
        *row
    }
    #[inline(always)]
    fn splat_word(self, x: u32) -> [u32; LANES] {
        [x; LANES]
    }
    #[inline(always)]
    fn counting(self, first: u32) -> [u32; LANES] {
        std::array::from_fn(|lane| first.wrapping_add(lane as u32))
    }
    #[inline(always)]
    fn without(self, words: [u32; LANES], values: [f32; LANES], bits: u32) -> [u32; LANES] {
        std::array::from_fn(|lane| words[lane] & !if values[lane] >= 0.0 { bits } else { 0 })
    }
    #[inline(always)]
    fn with(self, words: [u32; LANES], lanes: LaneMask, bits: u32) -> [u32; LANES] {
        std::array::from_fn(|lane| words[lane] | if lanes >> lane & 1 == 1 { bits } else { 0 })
    }
    #[inline(always)]
    fn zeros(self, words: [u32; LANES]) -> LaneMask {
        lanes_where(|lane| words[lane] == 0)
    }
    #[inline(always)]
    fn pack(self, place: &mut [u32; LANES], words: [u32; LANES], lanes: LaneMask) {
        let (mut left, mut count) = (lanes, 0);
        while left != 0 {
            place[count] = words[left.trailing_zeros() as usize];
            count += 1;
            left &= left - 1;
        }
    }
    #[inline(always)]
    fn append(self, out: &mut Vec<u32>, row: &[u32; LANES], lanes: LaneMask) {
        let mut left = lanes;
        while left != 0 {
            out.push(row[left.trailing_zeros() as usize]);
            left &= left - 1;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::kernel::{Kernel, Work};
    use proptest::prelude::*;

    /// Every operation on the same lanes, as bits.
    struct All<'a> {
        a: &'a [f32; LANES],
        b: &'a [f32; LANES],
        words: &'a [u32; LANES],
        lanes: LaneMask,
    }

    impl Work for All<'_> {
        type Output = (Vec<u32>, [LaneMask; 3]);

        #[inline(always)]
        fn run<I: Isa>(self, isa: I) -> Self::Output {
            let (a, b) = (isa.load(self.a), isa.load(self.b));
            let floats = [
                isa.add(a, b),
                isa.sub(a, b),
                isa.mul(a, isa.splat(self.b[3])),
                isa.lower(a, b),
            ];
            let bits = floats.map(|x| isa.to_array(x).map(canonical));
            let mut out: Vec<u32> = bits.as_flattened().to_vec();
            let words = isa.without(isa.words(self.words), a, 0b101);
            let marked = isa.with(words, self.lanes, 1 << 31 | 2);
            let all = [
                words,
                marked,
                isa.counting(self.words[0]),
                isa.splat_word(7),
            ];
            for words in all {
                let mut place = [0; LANES];
                isa.pack(&mut place, words, self.lanes);
                out.extend_from_slice(&place[..self.lanes.count_ones() as usize]);
            }
            isa.append(&mut out, self.words, self.lanes);
            isa.append(&mut out, self.words, !self.lanes);
            let masks = [isa.below_zero(a), isa.at_most(a, b), isa.zeros(words)];
            (out, masks)
        }
    }

    /// The bits of a number; which NaN it is, is nobody's business.
    fn canonical(x: f32) -> u32 {
        if x.is_nan() {
            f32::NAN.to_bits()
        } else {
            x.to_bits()
        }
    }

    proptest! {
        #[test]
        fn every_instruction_set_does_the_same(
            a in prop::array::uniform16(prop_oneof![prop::num::f32::ANY, (-2i8..3).prop_map(f32::from), Just(-0.0)]),
            b in prop::array::uniform16(prop_oneof![prop::num::f32::ANY, (-2i8..3).prop_map(f32::from), Just(-0.0)]),
            words in prop::array::uniform16(0u32..8),
            lanes in any::<LaneMask>(),
        ) {
            let work = || All { a: &a, b: &b, words: &words, lanes };
            let plain = work().run(Plain);
            for kernel in Kernel::available() {
                prop_assert_eq!(&kernel.run(work()), &plain, "{}", kernel);
            }
        }
    }
}
