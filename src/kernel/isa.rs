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
    /// Whether there are registers for the numbers of six planes and a block.
    const MANY_REGISTERS: bool = false;

    /// Sixteen f32.
    type Floats: Copy;
    /// Sixteen u32.
    type Words: Copy;
    /// Some of sixteen lanes, as comparisons leave them.
    type Kept: Copy;

    /// Does the piece in a function of its own, compiled for these instructions:
    /// a loop that is to keep its numbers in registers needs one.
    #[inline(always)]
    fn apart<P: Piece<Self>>(self, piece: P) -> P::Output {
        piece.run(self)
    }

    fn load(self, row: &[f32; LANES]) -> Self::Floats;
    fn to_array(self, floats: Self::Floats) -> [f32; LANES];
    fn splat(self, x: f32) -> Self::Floats;
    /// Of four numbers, for each lane the one that its two bits of `picks` say,
    /// lane 0 the lowest bits.
    fn pick(self, from: &[f32; 4], picks: u32) -> Self::Floats;
    fn add(self, a: Self::Floats, b: Self::Floats) -> Self::Floats;
    fn sub(self, a: Self::Floats, b: Self::Floats) -> Self::Floats;
    fn mul(self, a: Self::Floats, b: Self::Floats) -> Self::Floats;
    /// `a` where `a < b`, else `b`: of a NaN and a number in this order, the
    /// number.
    fn lower(self, a: Self::Floats, b: Self::Floats) -> Self::Floats;
    /// The lanes where `a < 0`.
    fn below_zero(self, a: Self::Floats) -> LaneMask;
    /// All lanes.
    fn keep_all(self) -> Self::Kept;
    /// Those of the lanes where not `values < least`: a NaN stays.
    fn keep(self, kept: Self::Kept, values: Self::Floats, least: Self::Floats) -> Self::Kept;
    fn kept(self, kept: Self::Kept) -> LaneMask;
    /// The lanes where `a <= b`.
    fn at_most(self, a: Self::Floats, b: Self::Floats) -> LaneMask;

    fn words(self, row: &[u32; LANES]) -> Self::Words;
    fn splat_word(self, x: u32) -> Self::Words;
    /// `first`, `first + 1` and so on.
    fn counting(self, first: u32) -> Self::Words;
    /// `words` without `bits` in the lanes where `values >= least`.
    fn without(
        self,
        words: Self::Words,
        values: Self::Floats,
        least: Self::Floats,
        bits: u32,
    ) -> Self::Words;
    /// The lanes that are zero.
    fn zeros(self, words: Self::Words) -> LaneMask;
    /// The lanes that are `x`.
    fn equal(self, words: Self::Words, x: u32) -> LaneMask;
    /// Moves the words of `lanes` together, lowest first, to the start of
    /// `place`; what the rest of it holds is nobody's business.
    #[inline(always)]
    fn pack(self, place: &mut [u32; LANES], words: Self::Words, lanes: LaneMask) {
        // SAFETY: sixteen words may be written.
        unsafe { self.pack_to(place.as_mut_ptr(), words, lanes) };
    }
    /// [`Isa::pack`] to memory that may not have been written yet.
    ///
    /// # Safety
    /// `place` is valid for writes of [`LANES`] words. As many words as there
    /// are lanes are written for certain, the others may be.
    unsafe fn pack_to(self, place: *mut u32, words: Self::Words, lanes: LaneMask);

    /// Appends the words of `lanes`, lowest first.
    #[inline(always)]
    fn append(self, out: &mut Vec<u32>, row: &[u32; LANES], lanes: LaneMask) {
        // Room first: a register would not outlive the call that makes it.
        out.reserve(LANES);
        let end = out.spare_capacity_mut().as_mut_ptr().cast();
        // SAFETY: there is room for sixteen words; so many are written.
        unsafe {
            self.pack_to(end, self.words(row), lanes);
            out.set_len(out.len() + lanes.count_ones() as usize);
        }
    }
}

/// A piece of a larger work: what [`Isa::apart`] does.
pub trait Piece<I: Isa> {
    type Output;

    /// `#[inline(always)]`, as all that is hot in it.
    fn run(self, isa: I) -> Self::Output;
}

/// Appends rows and some lanes of rows to a list that has room for all of them
/// from the start, so that nothing is asked in between.
pub struct Packer<'a> {
    out: &'a mut Vec<u32>,
    /// Where the next word goes; `room` words fit from there.
    end: *mut u32,
    room: usize,
    added: usize,
}

impl<'a> Packer<'a> {
    /// Room for so many words, and for the rest of a row behind them.
    #[inline(always)]
    pub fn onto(out: &'a mut Vec<u32>, words: usize) -> Self {
        let room = words + LANES;
        out.reserve(room);
        Packer {
            end: out.spare_capacity_mut().as_mut_ptr().cast(),
            room,
            added: 0,
            out,
        }
    }

    /// Appends the words of `lanes`, lowest first.
    ///
    /// # Panics
    /// If no row fits any more.
    #[inline(always)]
    pub fn push<I: Isa>(&mut self, isa: I, row: &[u32; LANES], lanes: LaneMask) {
        assert!(self.room >= LANES, "more words than there is room for");
        // SAFETY: a row fits.
        unsafe { isa.pack_to(self.end, isa.words(row), lanes) };
        self.skip(lanes.count_ones() as usize);
    }

    /// So many words have been written.
    #[inline(always)]
    fn skip(&mut self, count: usize) {
        // SAFETY: no more than there was room for.
        self.end = unsafe { self.end.add(count) };
        self.room -= count;
        self.added += count;
    }
}

impl Drop for Packer<'_> {
    #[inline(always)]
    fn drop(&mut self) {
        // SAFETY: so many words have been written behind the old end, and room
        // for them was made.
        unsafe { self.out.set_len(self.out.len() + self.added) };
    }
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
    /// All bits where a lane is dropped.
    type Kept = [u32; LANES];

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
    fn pick(self, from: &[f32; 4], picks: u32) -> [f32; LANES] {
        std::array::from_fn(|lane| from[(picks >> (2 * lane) & 3) as usize])
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
    fn keep_all(self) -> [u32; LANES] {
        [0; LANES]
    }
    #[inline(always)]
    fn keep(self, kept: [u32; LANES], values: [f32; LANES], least: [f32; LANES]) -> [u32; LANES] {
        std::array::from_fn(|lane| kept[lane] | if values[lane] < least[lane] { !0 } else { 0 })
    }
    #[inline(always)]
    fn kept(self, kept: [u32; LANES]) -> LaneMask {
        lanes_where(|lane| kept[lane] == 0)
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
    fn without(
        self,
        words: [u32; LANES],
        values: [f32; LANES],
        least: [f32; LANES],
        bits: u32,
    ) -> [u32; LANES] {
        std::array::from_fn(|lane| {
            let inside = values[lane] >= least[lane];
            words[lane] & !if inside { bits } else { 0 }
        })
    }
    #[inline(always)]
    fn zeros(self, words: [u32; LANES]) -> LaneMask {
        lanes_where(|lane| words[lane] == 0)
    }
    #[inline(always)]
    fn equal(self, words: [u32; LANES], x: u32) -> LaneMask {
        lanes_where(|lane| words[lane] == x)
    }
    #[inline(always)]
    unsafe fn pack_to(self, place: *mut u32, words: [u32; LANES], lanes: LaneMask) {
        let (mut left, mut count) = (lanes, 0);
        while left != 0 {
            // SAFETY: there are at most sixteen lanes.
            unsafe { *place.add(count) = words[left.trailing_zeros() as usize % LANES] };
            count += 1;
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
        type Output = (Vec<u32>, [LaneMask; 5]);

        #[inline(always)]
        fn run<I: Isa>(self, isa: I) -> Self::Output {
            let (a, b) = (isa.load(self.a), isa.load(self.b));
            let floats = [
                isa.add(a, b),
                isa.sub(a, b),
                isa.mul(a, isa.splat(self.b[3])),
                isa.lower(a, b),
                isa.pick(&std::array::from_fn(|i| self.a[i]), self.b[5].to_bits()),
            ];
            let bits = floats.map(|x| isa.to_array(x).map(canonical));
            let mut out: Vec<u32> = bits.as_flattened().to_vec();
            let words = isa.without(isa.words(self.words), a, b, 0b101);
            let all = [words, isa.counting(self.words[0]), isa.splat_word(7)];
            for words in all {
                let mut place = [0; LANES];
                isa.pack(&mut place, words, self.lanes);
                out.extend_from_slice(&place[..self.lanes.count_ones() as usize]);
            }
            isa.append(&mut out, self.words, self.lanes);
            isa.append(&mut out, self.words, !self.lanes);
            let masks = [
                isa.below_zero(a),
                isa.at_most(a, b),
                isa.zeros(words),
                isa.equal(words, 5),
                isa.kept(isa.keep(isa.keep(isa.keep_all(), a, b), b, isa.splat(0.0))),
            ];
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

    #[test]
    fn a_packer_has_room_for_the_last_row_whole() {
        let mut out = vec![1];
        let row: [u32; LANES] = std::array::from_fn(|lane| lane as u32);
        let mut packer = Packer::onto(&mut out, LANES + 2);
        packer.push(Plain, &row, LaneMask::MAX);
        packer.push(Plain, &row, 0b10_0100);
        drop(packer);
        assert_eq!(out[..3], [1, 0, 1]);
        assert_eq!(out[LANES..], [15, 2, 5]);
    }

    #[test]
    #[should_panic(expected = "more words than there is room for")]
    fn a_packer_that_is_full_takes_nothing_more() {
        // Memory enough, so that it is the packer that refuses.
        let mut out = Vec::with_capacity(4 * LANES);
        let mut packer = Packer::onto(&mut out, LANES);
        for _ in 0..3 {
            packer.push(Plain, &[7; LANES], LaneMask::MAX);
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
