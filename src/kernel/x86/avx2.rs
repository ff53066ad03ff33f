//! Two 256-bit vectors, with the bit instructions of the same generation.

use std::arch::x86_64::*;

use super::appender::{Appender, CompressTo};
use crate::kernel::Work;
use crate::kernel::isa::{Isa, LANES, LaneMask, Piece};

instruction_set! {
    /// A value is the proof that the processor has AVX2, BMI1, BMI2, LZCNT and POPCNT.
    Avx2, "avx2,bmi1,bmi2,lzcnt,popcnt"
}

type Floats = [__m256; 2];
type Words = [__m256i; 2];

// SAFETY, of all blocks below: the receiver proves that the processor has the
// instructions.
// Loads and stores are unaligned ones within their arrays.

/// Elementwise operations on two vectors, written out.
///
/// `array::from_fn`, `map` and closures called twice become functions. A build without link-time
/// optimisation leaves those outside the kernel, compiled without its instructions (seen: a scan 65
/// times slower).
macro_rules! each {
    (|$i:ident| $op:expr) => {
        [
            {
                let $i = 0_usize;
                $op
            },
            {
                let $i = 1_usize;
                $op
            },
        ]
    };
}

/// Methods of [`Isa`] that are one instruction per vector.
macro_rules! lanewise {
    ($($name:ident: $instruction:ident),+) => {$(
        #[inline(always)]
        fn $name(self, a: Floats, b: Floats) -> Floats {
            each!(|i| unsafe { $instruction(a[i], b[i]) })
        }
    )+};
}

impl Isa for Avx2 {
    type Floats = Floats;
    type Words = Words;
    /// All bits where a lane is dropped.
    type Kept = Floats;
    type Appender<'a> = Appender<'a>;

    #[inline(always)]
    fn run_outlined<P: Piece<Self>>(self, piece: P) -> P::Output {
        unsafe { run_outlined(self, piece) }
    }
    #[inline(always)]
    fn load(self, row: &[f32; LANES]) -> Floats {
        each!(|i| unsafe { _mm256_loadu_ps(row[8 * i..].as_ptr()) })
    }
    #[inline(always)]
    fn pairs(self, table: &[f32], places: &[u32; LANES]) -> [Floats; 2] {
        let [low, high] = halves_of_pairs(table, places);
        each!(|side| [low[side], high[side]])
    }
    #[inline(always)]
    fn to_array(self, floats: Floats) -> [f32; LANES] {
        let mut row = [0.0; LANES];
        for (eight, x) in row.chunks_exact_mut(8).zip(floats) {
            unsafe { _mm256_storeu_ps(eight.as_mut_ptr(), x) };
        }
        row
    }
    #[inline(always)]
    fn whole(self, floats: Floats) -> [i32; LANES] {
        let mut row = [0; LANES];
        for (i, x) in floats.iter().enumerate() {
            let eight = &mut row[8 * i..8 * i + 8];
            unsafe { _mm256_storeu_si256(eight.as_mut_ptr().cast(), _mm256_cvttps_epi32(*x)) };
        }
        row
    }
    #[inline(always)]
    fn splat(self, x: f32) -> Floats {
        [unsafe { _mm256_set1_ps(x) }; 2]
    }
    lanewise!(add: _mm256_add_ps, mul: _mm256_mul_ps, min: _mm256_min_ps, max: _mm256_max_ps);
    #[inline(always)]
    fn sub_abs(self, a: Floats, b: Floats) -> Floats {
        each!(|i| unsafe { _mm256_sub_ps(a[i], _mm256_andnot_ps(_mm256_set1_ps(-0.0), b[i])) })
    }
    #[inline(always)]
    fn keep_all(self) -> Floats {
        self.splat(0.0)
    }
    #[inline(always)]
    fn keep(self, kept: Floats, values: Floats, least: Floats) -> Floats {
        each!(|i| unsafe {
            let dropped = _mm256_cmp_ps::<_CMP_LT_OQ>(values[i], least[i]);
            _mm256_or_ps(kept[i], dropped)
        })
    }
    #[inline(always)]
    fn kept(self, kept: Floats) -> LaneMask {
        !signs_256(kept)
    }
    #[inline(always)]
    fn at_most(self, a: Floats, b: Floats) -> LaneMask {
        signs_256(each!(|i| unsafe {
            _mm256_cmp_ps::<_CMP_LE_OQ>(a[i], b[i])
        }))
    }
    #[inline(always)]
    fn words(self, row: &[u32; LANES]) -> Words {
        each!(|i| unsafe { _mm256_loadu_si256(row[8 * i..].as_ptr().cast()) })
    }
    #[inline(always)]
    fn splat_word(self, x: u32) -> Words {
        [unsafe { _mm256_set1_epi32(x as i32) }; 2]
    }
    #[inline(always)]
    fn iota(self, first: u32) -> Words {
        each!(|i| unsafe {
            let from = _mm256_set1_epi32(first.wrapping_add(8 * i as u32) as i32);
            _mm256_add_epi32(from, _mm256_setr_epi32(0, 1, 2, 3, 4, 5, 6, 7))
        })
    }
    #[inline(always)]
    fn without(self, words: Words, values: Floats, least: Floats, bits: u32) -> Words {
        each!(|i| unsafe {
            let inside = _mm256_cmp_ps::<_CMP_GE_OQ>(values[i], least[i]);
            let bits =
                _mm256_and_si256(_mm256_castps_si256(inside), _mm256_set1_epi32(bits as i32));
            _mm256_andnot_si256(bits, words[i])
        })
    }
    #[inline(always)]
    fn equal(self, words: Words, x: u32) -> LaneMask {
        signs_256(each!(|i| unsafe {
            _mm256_castsi256_ps(_mm256_cmpeq_epi32(words[i], _mm256_set1_epi32(x as i32)))
        }))
    }
    #[inline(always)]
    fn compress(self, place: &mut [u32; LANES], words: Words, lanes: LaneMask) {
        // SAFETY: sixteen words may be written.
        unsafe { self.compress_to(place.as_mut_ptr(), words, lanes) };
    }
}

// SAFETY: one word per lane is written, never more than a row.
unsafe impl CompressTo for Avx2 {
    #[inline(always)]
    unsafe fn compress_to(self, place: *mut u32, words: Words, lanes: LaneMask) {
        // Each store is a whole vector: the second one overwrites what the first left behind its
        // lanes. Together they stay within sixteen places.
        let (low, high) = (lanes & 0xff, lanes >> 8);
        unsafe {
            _mm256_storeu_si256(place.cast(), packed_256(words[0], low));
            let behind = place.add(low.count_ones() as usize);
            _mm256_storeu_si256(behind.cast(), packed_256(words[1], high));
        }
    }
}

#[inline(always)]
fn signs_256(x: Floats) -> LaneMask {
    let signs = each!(|i| unsafe { _mm256_movemask_ps(x[i]) } as LaneMask);
    signs[0] | signs[1] << 8
}

/// The words of eight lanes moved together.
#[inline(always)]
fn packed_256(words: __m256i, lanes: LaneMask) -> __m256i {
    unsafe {
        // A byte per lane, those of `lanes` moved together, and widened to the indices of a
        // permutation.
        let bytes = _pdep_u64(u64::from(lanes), 0x0101_0101_0101_0101).wrapping_mul(0xff);
        let order = _pext_u64(0x0706_0504_0302_0100, bytes);
        let order = _mm256_cvtepu8_epi32(_mm_cvtsi64_si128(order as i64));
        _mm256_permutevar8x32_epi32(words, order)
    }
}

/// [`Isa::pairs`] of lanes 0 to 7 and 8 to 15: one load for both numbers of each.
///
/// On Zen 4 a tenth faster than AVX-512's gather, which loads each number by itself.
/// Only for code that was compiled for AVX2.
#[inline(always)]
pub(super) fn halves_of_pairs(table: &[f32], places: &[u32; LANES]) -> [[__m256; 2]; 2] {
    let fours: &[[u32; 4]] = places.as_chunks().0;
    each!(|half| {
        let [a, b] = each!(|i| four_pairs(table, &fours[2 * half + i]));
        each!(|side| unsafe { _mm256_set_m128(b[side], a[side]) })
    })
}

#[inline(always)]
fn four_pairs(table: &[f32], [p, q, r, s]: &[u32; 4]) -> [__m128; 2] {
    let [a, b] = [two_pairs(table, [p, q]), two_pairs(table, [r, s])];
    unsafe {
        [
            _mm_shuffle_ps::<0b10_00_10_00>(a, b),
            _mm_shuffle_ps::<0b11_01_11_01>(a, b),
        ]
    }
}

#[inline(always)]
fn two_pairs(table: &[f32], [a, b]: [&u32; 2]) -> __m128 {
    let last = table.len().checked_sub(2).expect("two numbers");
    let [a, b] = [(*a as usize).min(last), (*b as usize).min(last)];
    // Places up to the last but one: both numbers are within the table.
    unsafe {
        let from = table.as_ptr();
        let low = _mm_castsi128_ps(_mm_loadl_epi64(from.add(a).cast()));
        let high = _mm_castsi128_ps(_mm_loadl_epi64(from.add(b).cast()));
        _mm_movelh_ps(low, high)
    }
}
