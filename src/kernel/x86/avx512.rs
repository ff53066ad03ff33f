//! One 512-bit vector: a row of a block is one register.

use std::arch::x86_64::*;

use super::appender::{Appender, CompressTo};
use super::avx2::halves_of_pairs;
use crate::kernel::Work;
use crate::kernel::isa::{Isa, LANES, LaneMask, Piece};

instruction_set! {
    /// Proof that the processor has AVX-512 (F, VL, BW, DQ) and the AVX2 set.
    Avx512, "avx512f,avx512vl,avx512bw,avx512dq,avx2,bmi1,bmi2,lzcnt,popcnt"
}

// SAFETY, of all blocks below: the receiver proves that the processor has the
// instructions.
// Loads and stores are unaligned ones within their arrays.

/// Methods of [`Isa`] that are one instruction.
macro_rules! lanewise {
    ($($name:ident: $instruction:ident),+) => {$(
        #[inline(always)]
        fn $name(self, a: __m512, b: __m512) -> __m512 {
            unsafe { $instruction(a, b) }
        }
    )+};
}

impl Isa for Avx512 {
    const MANY_REGISTERS: bool = true;

    type Floats = __m512;
    type Words = __m512i;
    type Kept = LaneMask;
    type Appender<'a> = Appender<'a>;

    #[inline(always)]
    fn run_outlined<P: Piece<Self>>(self, piece: P) -> P::Output {
        unsafe { run_outlined(self, piece) }
    }
    #[inline(always)]
    fn load(self, row: &[f32; LANES]) -> __m512 {
        unsafe { _mm512_loadu_ps(row.as_ptr()) }
    }
    #[inline(always)]
    fn pairs(self, table: &[f32], places: &[u32; LANES]) -> [__m512; 2] {
        let [low, high] = halves_of_pairs(table, places);
        let joined = |side| unsafe {
            _mm512_insertf32x8::<1>(_mm512_castps256_ps512(low[side]), high[side])
        };
        [joined(0), joined(1)]
    }
    #[inline(always)]
    fn to_array(self, floats: __m512) -> [f32; LANES] {
        let mut row = [0.0; LANES];
        unsafe { _mm512_storeu_ps(row.as_mut_ptr(), floats) };
        row
    }
    #[inline(always)]
    fn whole(self, floats: __m512) -> [i32; LANES] {
        let mut row = [0; LANES];
        unsafe { _mm512_storeu_si512(row.as_mut_ptr().cast(), _mm512_cvttps_epi32(floats)) };
        row
    }
    #[inline(always)]
    fn splat(self, x: f32) -> __m512 {
        unsafe { _mm512_set1_ps(x) }
    }
    lanewise!(add: _mm512_add_ps, mul: _mm512_mul_ps, min: _mm512_min_ps, max: _mm512_max_ps);
    #[inline(always)]
    fn near_mul_add(self, a: __m512, b: __m512, c: __m512) -> __m512 {
        unsafe { _mm512_fmadd_ps(a, b, c) }
    }
    #[inline(always)]
    fn sub_abs(self, a: __m512, b: __m512) -> __m512 {
        unsafe { _mm512_sub_ps(a, _mm512_abs_ps(b)) }
    }
    #[inline(always)]
    fn keep_all(self) -> LaneMask {
        LaneMask::MAX
    }
    #[inline(always)]
    fn keep(self, kept: LaneMask, values: __m512, least: __m512) -> LaneMask {
        unsafe { _mm512_mask_cmp_ps_mask::<_CMP_NLT_UQ>(kept, values, least) }
    }
    #[inline(always)]
    fn kept(self, kept: LaneMask) -> LaneMask {
        kept
    }
    #[inline(always)]
    fn at_most(self, a: __m512, b: __m512) -> LaneMask {
        unsafe { _mm512_cmp_ps_mask::<_CMP_LE_OQ>(a, b) }
    }
    #[inline(always)]
    fn words(self, row: &[u32; LANES]) -> __m512i {
        unsafe { _mm512_loadu_si512(row.as_ptr().cast()) }
    }
    #[inline(always)]
    fn splat_word(self, x: u32) -> __m512i {
        unsafe { _mm512_set1_epi32(x as i32) }
    }
    #[inline(always)]
    fn iota(self, first: u32) -> __m512i {
        unsafe {
            let lanes = _mm512_setr_epi32(0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12, 13, 14, 15);
            _mm512_add_epi32(_mm512_set1_epi32(first as i32), lanes)
        }
    }
    #[inline(always)]
    fn without(self, words: __m512i, values: __m512, least: __m512, bits: u32) -> __m512i {
        unsafe {
            let inside = _mm512_cmp_ps_mask::<_CMP_GE_OQ>(values, least);
            let bits = _mm512_set1_epi32(bits as i32);
            _mm512_mask_andnot_epi32(words, inside, bits, words)
        }
    }
    #[inline(always)]
    fn equal(self, words: __m512i, x: u32) -> LaneMask {
        unsafe { _mm512_cmpeq_epi32_mask(words, _mm512_set1_epi32(x as i32)) }
    }
    #[inline(always)]
    fn compress(self, place: &mut [u32; LANES], words: __m512i, lanes: LaneMask) {
        // SAFETY: sixteen words may be written.
        unsafe { self.compress_to(place.as_mut_ptr(), words, lanes) };
    }
}

// SAFETY: one word per lane is written, never more than a row.
unsafe impl CompressTo for Avx512 {
    #[inline(always)]
    unsafe fn compress_to(self, place: *mut u32, words: __m512i, lanes: LaneMask) {
        // Compressed in a register and stored whole: a masked store is slower, far slower on some
        // processors.
        unsafe {
            let packed = _mm512_maskz_compress_epi32(lanes, words);
            _mm512_storeu_si512(place.cast(), packed);
        }
    }
}
