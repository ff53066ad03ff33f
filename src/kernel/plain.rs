//! Sixteen lanes as plain arrays, which the compiler turns into vectors.
//!
//! For any processor, for interpreters, and for the tests of the other kernels. No
//! unsafe code.

use super::isa::{Append, Isa, LANES, LaneMask};

/// Plain arrays.
#[derive(Clone, Copy, Debug)]
pub struct Plain;

#[inline(always)]
fn lanes<T: Copy + Default>(of: impl Fn(usize) -> T) -> [T; LANES] {
    let mut lanes = [T::default(); LANES];
    for (lane, value) in lanes.iter_mut().enumerate() {
        *value = of(lane);
    }
    lanes
}

#[inline(always)]
fn lanes_where(holds: impl Fn(usize) -> bool) -> LaneMask {
    // A bit as wide as a float, so that the comparison's result stays in vector registers.
    let bits: [u32; LANES] = lanes(|lane| u32::from(holds(lane)) << lane);
    bits.iter().fold(0, |all, bit| all | bit) as LaneMask
}

type Floats = [f32; LANES];
type Words = [u32; LANES];

impl Isa for Plain {
    type Floats = Floats;
    type Words = Words;
    /// All bits where a lane is dropped.
    type Kept = Words;
    type Appender<'a> = PlainAppender<'a>;

    #[inline(always)]
    fn load(self, row: &Floats) -> Floats {
        *row
    }
    #[inline(always)]
    fn pairs(self, table: &[f32], places: &Words) -> [Floats; 2] {
        let last = table.len() - 2;
        let at = |side| lanes(|lane| table[(places[lane] as usize).min(last) + side]);
        [at(0), at(1)]
    }
    #[inline(always)]
    fn to_array(self, floats: Floats) -> Floats {
        floats
    }
    #[inline(always)]
    fn whole(self, floats: Floats) -> [i32; LANES] {
        lanes(|lane| floats[lane] as i32)
    }
    #[inline(always)]
    fn splat(self, x: f32) -> Floats {
        [x; LANES]
    }
    #[inline(always)]
    fn add(self, a: Floats, b: Floats) -> Floats {
        lanes(|lane| a[lane] + b[lane])
    }
    #[inline(always)]
    fn mul(self, a: Floats, b: Floats) -> Floats {
        lanes(|lane| a[lane] * b[lane])
    }
    #[inline(always)]
    fn min(self, a: Floats, b: Floats) -> Floats {
        lanes(|lane| if a[lane] < b[lane] { a[lane] } else { b[lane] })
    }
    #[inline(always)]
    fn max(self, a: Floats, b: Floats) -> Floats {
        lanes(|lane| if a[lane] > b[lane] { a[lane] } else { b[lane] })
    }
    #[inline(always)]
    fn sub_abs(self, a: Floats, b: Floats) -> Floats {
        lanes(|lane| a[lane] - b[lane].abs())
    }
    #[inline(always)]
    fn keep_all(self) -> Words {
        [0; LANES]
    }
    #[inline(always)]
    fn keep(self, kept: Words, values: Floats, least: Floats) -> Words {
        lanes(|lane| kept[lane] | if values[lane] < least[lane] { !0 } else { 0 })
    }
    #[inline(always)]
    fn kept(self, kept: Words) -> LaneMask {
        lanes_where(|lane| kept[lane] == 0)
    }
    #[inline(always)]
    fn at_most(self, a: Floats, b: Floats) -> LaneMask {
        lanes_where(|lane| a[lane] <= b[lane])
    }
    #[inline(always)]
    fn words(self, row: &Words) -> Words {
        *row
    }
    #[inline(always)]
    fn splat_word(self, x: u32) -> Words {
        [x; LANES]
    }
    #[inline(always)]
    fn iota(self, first: u32) -> Words {
        lanes(|lane| first.wrapping_add(lane as u32))
    }
    #[inline(always)]
    fn without(self, words: Words, values: Floats, least: Floats, bits: u32) -> Words {
        lanes(|lane| {
            let inside = values[lane] >= least[lane];
            words[lane] & !if inside { bits } else { 0 }
        })
    }
    #[inline(always)]
    fn equal(self, words: Words, x: u32) -> LaneMask {
        lanes_where(|lane| words[lane] == x)
    }
    #[inline(always)]
    fn compress(self, place: &mut Words, words: Words, lanes: LaneMask) {
        let mut left = lanes;
        for to in place.iter_mut().take(lanes.count_ones() as usize) {
            *to = words[left.trailing_zeros() as usize % LANES];
            left &= left - 1;
        }
    }
}

/// A list with the room that was reserved for it.
#[derive(Debug)]
pub struct PlainAppender<'a> {
    out: &'a mut Vec<u32>,
    room: usize,
}

impl<'a> Append<'a, Plain> for PlainAppender<'a> {
    #[inline(always)]
    fn onto(out: &'a mut Vec<u32>, words: usize) -> Self {
        let room = words + LANES;
        out.reserve(room);
        PlainAppender { out, room }
    }

    #[inline(always)]
    fn push(&mut self, isa: Plain, row: &[u32; LANES], lanes: LaneMask) {
        assert!(self.room >= LANES, "more words than there is room for");
        let mut place = [0; LANES];
        isa.compress(&mut place, *row, lanes);
        let count = lanes.count_ones() as usize;
        self.out.extend_from_slice(&place[..count]);
        self.room -= count;
    }
}
