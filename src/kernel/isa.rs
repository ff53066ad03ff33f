//! Sixteen lanes at a time: the vector operations of the block kernels.

/// Lanes of a vector: the boxes of one block.
pub const LANES: usize = 16;

/// One bit per lane.
pub type LaneMask = u16;

/// The first `count` lanes, all of them from sixteen on.
#[inline(always)]
pub fn first_lanes(count: usize) -> LaneMask {
    ((1u32 << count.min(LANES)) - 1) as LaneMask
}

/// An instruction set: sixteen f32 lanes and sixteen u32 lanes.
///
/// Every operation but [`Isa::near_mul_add`] rounds once, to nearest, lane by lane: results are
/// bit-identical on every instruction set. A value of the type proves that the processor supports
/// the instructions.
pub trait Isa: Copy + Send + Sync {
    /// True if the registers hold the coefficients of six planes and a block.
    const MANY_REGISTERS: bool = false;

    /// Sixteen f32.
    type Floats: Copy;
    /// Sixteen u32.
    type Words: Copy;
    /// A set of lanes, in the form that comparisons produce.
    type Kept: Copy;
    /// Appends row after row.
    type Appender<'a>: Append<'a, Self>;

    /// Runs a piece in a separate function, compiled for these instructions.
    ///
    /// A loop needs a separate function to keep its values in registers.
    #[inline(always)]
    fn run_outlined<P: Piece<Self>>(self, piece: P) -> P::Output {
        piece.run(self)
    }

    /// The numbers of a row.
    fn load(self, row: &[f32; LANES]) -> Self::Floats;
    /// Per lane, `table[place]` and the number after it.
    ///
    /// A place without a successor yields the last two numbers of the table.
    ///
    /// # Panics
    /// If the table has fewer than two.
    fn pairs(self, table: &[f32], places: &[u32; LANES]) -> [Self::Floats; 2];
    /// The numbers of all lanes, lane 0 first.
    fn to_array(self, floats: Self::Floats) -> [f32; LANES];
    /// The whole parts of numbers from 0 up to 2^31, lane 0 first.
    fn whole(self, floats: Self::Floats) -> [i32; LANES];
    /// The same number in every lane.
    fn splat(self, x: f32) -> Self::Floats;
    /// `a + b`, rounded once.
    fn add(self, a: Self::Floats, b: Self::Floats) -> Self::Floats;
    /// `a * b`, rounded once; never fused with a sum.
    fn mul(self, a: Self::Floats, b: Self::Floats) -> Self::Floats;
    /// `a * b + c`, rounded once or twice: for sums whose error a bound covers.
    #[inline(always)]
    fn near_mul_add(self, a: Self::Floats, b: Self::Floats, c: Self::Floats) -> Self::Floats {
        self.add(self.mul(a, b), c)
    }
    /// `a` where `a < b`, else `b`; the number if `a` is a NaN and `b` is not.
    fn min(self, a: Self::Floats, b: Self::Floats) -> Self::Floats;
    /// `a` where `a > b`, else `b`; the number if `a` is a NaN and `b` is not.
    fn max(self, a: Self::Floats, b: Self::Floats) -> Self::Floats;
    /// `a - |b|`, rounded once.
    fn sub_abs(self, a: Self::Floats, b: Self::Floats) -> Self::Floats;
    /// All lanes.
    fn keep_all(self) -> Self::Kept;
    /// Clears the lanes where `values < least`; lanes with a NaN stay.
    fn keep(self, kept: Self::Kept, values: Self::Floats, least: Self::Floats) -> Self::Kept;
    /// One bit per lane that is kept.
    fn kept(self, kept: Self::Kept) -> LaneMask;
    /// The lanes where not `values < least`, those with a NaN included.
    #[inline(always)]
    fn not_below(self, values: Self::Floats, least: f32) -> LaneMask {
        self.kept(self.keep(self.keep_all(), values, self.splat(least)))
    }
    /// The lanes where `a <= b`.
    fn at_most(self, a: Self::Floats, b: Self::Floats) -> LaneMask;

    /// The words of a row.
    fn words(self, row: &[u32; LANES]) -> Self::Words;
    /// The same word in every lane.
    fn splat_word(self, x: u32) -> Self::Words;
    /// `first`, `first + 1` and so on.
    fn iota(self, first: u32) -> Self::Words;
    /// `words` without `bits` in the lanes where `values >= least`.
    fn without(
        self,
        words: Self::Words,
        values: Self::Floats,
        least: Self::Floats,
        bits: u32,
    ) -> Self::Words;
    /// The lanes that are `x`.
    fn equal(self, words: Self::Words, x: u32) -> LaneMask;
    /// Moves the words of `lanes` to the start of `place`, lowest lane first.
    ///
    /// The rest of `place` is unspecified.
    fn compress(self, place: &mut [u32; LANES], words: Self::Words, lanes: LaneMask);
    /// Appends the words of `lanes`, lowest first.
    #[inline(always)]
    fn append(self, out: &mut Vec<u32>, row: &[u32; LANES], lanes: LaneMask) {
        // Reserve first: a register would not outlive the call that makes it.
        Self::Appender::onto(out, 0).push(self, row, lanes);
    }
}

/// A piece of a larger work: what [`Isa::run_outlined`] does.
pub trait Piece<I: Isa> {
    /// Result of the piece.
    type Output;

    /// `#[inline(always)]`, like all hot functions in it.
    fn run(self, isa: I) -> Self::Output;
}

/// Appends rows and some lanes of rows to a list.
///
/// Room for all of them is reserved once; nothing is checked in between. Dropping the appender sets
/// the list's length.
pub trait Append<'a, I: Isa> {
    /// Reserves room for `words` words, and for the rest of a row behind them.
    fn onto(out: &'a mut Vec<u32>, words: usize) -> Self;

    /// Appends the words of `lanes`, lowest first.
    ///
    /// # Panics
    /// If there is no room for another row.
    fn push(&mut self, isa: I, row: &[u32; LANES], lanes: LaneMask);
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::kernel::{Kernel, Plain, Work};
    use proptest::prelude::*;
    use std::panic::{AssertUnwindSafe, catch_unwind};

    /// Every operation on the same lanes, as bits.
    struct All<'a> {
        a: &'a [f32; LANES],
        b: &'a [f32; LANES],
        words: &'a [u32; LANES],
        lanes: LaneMask,
    }

    impl Work for All<'_> {
        type Output = (Vec<u32>, [LaneMask; 5]);

        #[inline(always)]
        fn run<I: Isa>(self, isa: I) -> Self::Output {
            let (a, b) = (isa.load(self.a), isa.load(self.b));
            let [at, behind] = isa.pairs(&self.a[..5], self.words);
            let floats = [
                isa.add(a, b),
                isa.mul(a, isa.splat(self.b[3])),
                isa.min(a, b),
                isa.max(a, b),
                isa.sub_abs(a, b),
                at,
                behind,
            ];
            let bits = floats.map(|x| isa.to_array(x).map(canonical));
            let mut out: Vec<u32> = bits.as_flattened().to_vec();
            let words = isa.without(isa.words(self.words), a, b, 0b101);
            let all = [words, isa.iota(self.words[0]), isa.splat_word(7)];
            for words in all {
                let mut place = [0; LANES];
                isa.compress(&mut place, words, self.lanes);
                out.extend_from_slice(&place[..self.lanes.count_ones() as usize]);
            }
            // Between 0 and 2^31; all others are clamped.
            let least = isa.max(a, isa.splat(0.0));
            let whole = isa.whole(isa.min(least, isa.splat(2147483520.0)));
            out.extend(whole.map(|x| x as u32));
            isa.append(&mut out, self.words, self.lanes);
            isa.append(&mut out, self.words, !self.lanes);
            let masks = [
                isa.not_below(a, 0.0),
                isa.at_most(a, b),
                isa.equal(words, 0),
                isa.equal(words, 5),
                isa.kept(isa.keep(isa.keep(isa.keep_all(), a, b), b, isa.splat(0.0))),
            ];
            (out, masks)
        }
    }

    /// The bits of a number; all NaNs compare equal.
    fn canonical(x: f32) -> u32 {
        if x.is_nan() {
            f32::NAN.to_bits()
        } else {
            x.to_bits()
        }
    }

    /// Room for a number of words, then rows with their lanes to append.
    struct Packed<'a>(&'a mut Vec<u32>, usize, &'a [([u32; LANES], LaneMask)]);

    impl Work for Packed<'_> {
        type Output = ();

        #[inline(always)]
        fn run<I: Isa>(self, isa: I) {
            let mut appender = I::Appender::onto(self.0, self.1);
            for (row, lanes) in self.2 {
                appender.push(isa, row, *lanes);
            }
        }
    }

    /// Words that each instruction set packs behind a 1, and whether it panicked.
    fn packed(words: usize, rows: &[([u32; LANES], LaneMask)]) -> Vec<(Vec<u32>, bool)> {
        let pack = |run: &dyn Fn(Packed)| {
            // Enough memory, so that only the appender can refuse.
            let mut out = Vec::with_capacity(8 * LANES);
            out.push(1);
            let work = Packed(&mut out, words, rows);
            let ended = catch_unwind(AssertUnwindSafe(|| run(work)));
            (out, ended.is_err())
        };
        let kernels = Kernel::available();
        kernels
            .map(|kernel| pack(&|work| kernel.run(work)))
            .collect()
    }

    #[test]
    fn an_appender_has_room_for_the_last_row_whole() {
        let row = std::array::from_fn(|lane| lane as u32);
        for (out, panicked) in packed(LANES + 2, &[(row, LaneMask::MAX), (row, 0b10_0100)]) {
            assert!(!panicked);
            assert_eq!(out[..3], [1, 0, 1]);
            assert_eq!(out[LANES..], [15, 2, 5]);
        }
    }

    #[test]
    fn an_appender_that_is_full_takes_nothing_more_and_keeps_what_it_has() {
        for (out, panicked) in packed(LANES, &[([7; LANES], LaneMask::MAX); 3]) {
            assert!(panicked);
            assert_eq!(out[1..], [7; 2 * LANES]);
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
