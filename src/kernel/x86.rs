//! The vectors of x86-64: SSE2, which every such processor has, AVX2 and
//! AVX-512. Unsafe because intrinsics are; sound because a value of each type
//! only exists where its instructions do.

use std::arch::x86_64::*;

use super::isa::{Isa, LANES, LaneMask, Piece, Plain};

/// Four 128-bit vectors. Part of x86-64.
#[derive(Clone, Copy, Debug)]
pub struct Sse2;

/// Two 256-bit vectors, with the bit instructions of the same generation.
#[derive(Clone, Copy, Debug)]
pub struct Avx2(());

/// One 512-bit vector.
#[derive(Clone, Copy, Debug)]
pub struct Avx512(());

impl Avx2 {
    /// Only for code that was compiled for these instructions.
    #[inline]
    #[target_feature(enable = "avx2,bmi1,bmi2,lzcnt,popcnt")]
    pub(super) fn here() -> Self {
        Avx2(())
    }
}

impl Avx512 {
    /// Only for code that was compiled for these instructions.
    #[inline]
    #[target_feature(enable = "avx512f,avx512vl,avx512bw,avx512dq,avx2,bmi1,bmi2,lzcnt,popcnt")]
    pub(super) fn here() -> Self {
        Avx512(())
    }
}

#[inline(never)]
#[target_feature(enable = "avx2,bmi1,bmi2,lzcnt,popcnt")]
fn apart_avx2<P: Piece<Avx2>>(isa: Avx2, piece: P) -> P::Output {
    piece.run(isa)
}

#[inline(never)]
#[target_feature(enable = "avx512f,avx512vl,avx512bw,avx512dq,avx2,bmi1,bmi2,lzcnt,popcnt")]
fn apart_avx512<P: Piece<Avx512>>(isa: Avx512, piece: P) -> P::Output {
    piece.run(isa)
}

/// Elementwise operations on an array of vectors.
macro_rules! each {
    ($count:literal, $op:expr) => {
        std::array::from_fn::<_, $count, _>($op)
    };
}

// SAFETY, of all blocks below: the receiver proves that the processor has the
// instructions (see above). Loads and stores are unaligned ones within the
// array, or within the room that `room` has made.

impl Isa for Sse2 {
    type Floats = [__m128; 4];
    type Words = [__m128i; 4];
    /// All bits where a lane is dropped.
    type Kept = [__m128; 4];

    #[inline(always)]
    fn load(self, row: &[f32; LANES]) -> [__m128; 4] {
        each!(4, |i| unsafe { _mm_loadu_ps(row[4 * i..].as_ptr()) })
    }
    #[inline(always)]
    fn to_array(self, floats: [__m128; 4]) -> [f32; LANES] {
        let mut row = [0.0; LANES];
        for (four, x) in row.chunks_exact_mut(4).zip(floats) {
            unsafe { _mm_storeu_ps(four.as_mut_ptr(), x) };
        }
        row
    }
    #[inline(always)]
    fn splat(self, x: f32) -> [__m128; 4] {
        [unsafe { _mm_set1_ps(x) }; 4]
    }
    #[inline(always)]
    fn pick(self, from: &[f32; 4], picks: u32) -> [__m128; 4] {
        each!(4, |i| unsafe {
            // The two bits of a lane, each as a mask.
            let here = _mm_set1_epi32((picks >> (8 * i)) as i32);
            let mask = |bits| _mm_castsi128_ps(_mm_cmpeq_epi32(_mm_and_si128(here, bits), bits));
            let odd = mask(_mm_setr_epi32(1, 4, 16, 64));
            let late = mask(_mm_setr_epi32(2, 8, 32, 128));
            let either = |mask, yes, no| _mm_or_ps(_mm_and_ps(mask, yes), _mm_andnot_ps(mask, no));
            let [a, b, c, d] = from.map(|x| _mm_set1_ps(x));
            either(late, either(odd, d, c), either(odd, b, a))
        })
    }
    #[inline(always)]
    fn add(self, a: [__m128; 4], b: [__m128; 4]) -> [__m128; 4] {
        each!(4, |i| unsafe { _mm_add_ps(a[i], b[i]) })
    }
    #[inline(always)]
    fn sub(self, a: [__m128; 4], b: [__m128; 4]) -> [__m128; 4] {
        each!(4, |i| unsafe { _mm_sub_ps(a[i], b[i]) })
    }
    #[inline(always)]
    fn mul(self, a: [__m128; 4], b: [__m128; 4]) -> [__m128; 4] {
        each!(4, |i| unsafe { _mm_mul_ps(a[i], b[i]) })
    }
    #[inline(always)]
    fn lower(self, a: [__m128; 4], b: [__m128; 4]) -> [__m128; 4] {
        each!(4, |i| unsafe { _mm_min_ps(a[i], b[i]) })
    }
    #[inline(always)]
    fn below_zero(self, a: [__m128; 4]) -> LaneMask {
        let below = each!(4, |i| unsafe { _mm_cmplt_ps(a[i], _mm_setzero_ps()) });
        signs_128(below)
    }
    #[inline(always)]
    fn keep_all(self) -> [__m128; 4] {
        self.splat(0.0)
    }
    #[inline(always)]
    fn keep(self, kept: [__m128; 4], values: [__m128; 4], least: [__m128; 4]) -> [__m128; 4] {
        each!(4, |i| unsafe {
            _mm_or_ps(kept[i], _mm_cmplt_ps(values[i], least[i]))
        })
    }
    #[inline(always)]
    fn kept(self, kept: [__m128; 4]) -> LaneMask {
        !signs_128(kept)
    }
    #[inline(always)]
    fn at_most(self, a: [__m128; 4], b: [__m128; 4]) -> LaneMask {
        signs_128(each!(4, |i| unsafe { _mm_cmple_ps(a[i], b[i]) }))
    }
    #[inline(always)]
    fn words(self, row: &[u32; LANES]) -> [__m128i; 4] {
        each!(4, |i| unsafe {
            _mm_loadu_si128(row[4 * i..].as_ptr().cast())
        })
    }
    #[inline(always)]
    fn splat_word(self, x: u32) -> [__m128i; 4] {
        [unsafe { _mm_set1_epi32(x as i32) }; 4]
    }
    #[inline(always)]
    fn counting(self, first: u32) -> [__m128i; 4] {
        each!(4, |i| unsafe {
            let from = _mm_set1_epi32(first.wrapping_add(4 * i as u32) as i32);
            _mm_add_epi32(from, _mm_setr_epi32(0, 1, 2, 3))
        })
    }
    #[inline(always)]
    fn without(
        self,
        words: [__m128i; 4],
        values: [__m128; 4],
        least: [__m128; 4],
        bits: u32,
    ) -> [__m128i; 4] {
        each!(4, |i| unsafe {
            let inside = _mm_castps_si128(_mm_cmpge_ps(values[i], least[i]));
            _mm_andnot_si128(_mm_and_si128(inside, _mm_set1_epi32(bits as i32)), words[i])
        })
    }
    #[inline(always)]
    fn zeros(self, words: [__m128i; 4]) -> LaneMask {
        signs_128(each!(4, |i| unsafe {
            _mm_castsi128_ps(_mm_cmpeq_epi32(words[i], _mm_setzero_si128()))
        }))
    }
    #[inline(always)]
    fn equal(self, words: [__m128i; 4], x: u32) -> LaneMask {
        signs_128(each!(4, |i| unsafe {
            _mm_castsi128_ps(_mm_cmpeq_epi32(words[i], _mm_set1_epi32(x as i32)))
        }))
    }
    #[inline(always)]
    unsafe fn pack_to(self, place: *mut u32, words: [__m128i; 4], lanes: LaneMask) {
        let mut row = [0; LANES];
        for (four, x) in row.chunks_exact_mut(4).zip(words) {
            unsafe { _mm_storeu_si128(four.as_mut_ptr().cast(), x) };
        }
        unsafe { Plain.pack_to(place, row, lanes) };
    }
}

#[inline(always)]
fn signs_128(x: [__m128; 4]) -> LaneMask {
    let signs = x.map(|x| unsafe { _mm_movemask_ps(x) } as LaneMask);
    signs[0] | signs[1] << 4 | signs[2] << 8 | signs[3] << 12
}

impl Isa for Avx2 {
    type Floats = [__m256; 2];
    type Words = [__m256i; 2];
    /// All bits where a lane is dropped.
    type Kept = [__m256; 2];

    #[inline(always)]
    fn apart<P: Piece<Self>>(self, piece: P) -> P::Output {
        unsafe { apart_avx2(self, piece) }
    }
    #[inline(always)]
    fn load(self, row: &[f32; LANES]) -> [__m256; 2] {
        each!(2, |i| unsafe { _mm256_loadu_ps(row[8 * i..].as_ptr()) })
    }
    #[inline(always)]
    fn to_array(self, floats: [__m256; 2]) -> [f32; LANES] {
        let mut row = [0.0; LANES];
        for (eight, x) in row.chunks_exact_mut(8).zip(floats) {
            unsafe { _mm256_storeu_ps(eight.as_mut_ptr(), x) };
        }
        row
    }
    #[inline(always)]
    fn splat(self, x: f32) -> [__m256; 2] {
        [unsafe { _mm256_set1_ps(x) }; 2]
    }
    #[inline(always)]
    fn pick(self, from: &[f32; 4], picks: u32) -> [__m256; 2] {
        each!(2, |i| unsafe {
            let four = _mm_loadu_ps(from.as_ptr());
            let four = _mm256_set_m128(four, four);
            let picks = _mm256_set1_epi32((picks >> (16 * i)) as i32);
            let shifts = _mm256_setr_epi32(0, 2, 4, 6, 8, 10, 12, 14);
            // Only the two lowest bits of a lane count.
            _mm256_permutevar_ps(four, _mm256_srlv_epi32(picks, shifts))
        })
    }
    #[inline(always)]
    fn add(self, a: [__m256; 2], b: [__m256; 2]) -> [__m256; 2] {
        each!(2, |i| unsafe { _mm256_add_ps(a[i], b[i]) })
    }
    #[inline(always)]
    fn sub(self, a: [__m256; 2], b: [__m256; 2]) -> [__m256; 2] {
        each!(2, |i| unsafe { _mm256_sub_ps(a[i], b[i]) })
    }
    #[inline(always)]
    fn mul(self, a: [__m256; 2], b: [__m256; 2]) -> [__m256; 2] {
        each!(2, |i| unsafe { _mm256_mul_ps(a[i], b[i]) })
    }
    #[inline(always)]
    fn lower(self, a: [__m256; 2], b: [__m256; 2]) -> [__m256; 2] {
        each!(2, |i| unsafe { _mm256_min_ps(a[i], b[i]) })
    }
    #[inline(always)]
    fn below_zero(self, a: [__m256; 2]) -> LaneMask {
        signs_256(each!(2, |i| unsafe {
            _mm256_cmp_ps::<_CMP_LT_OQ>(a[i], _mm256_setzero_ps())
        }))
    }
    #[inline(always)]
    fn keep_all(self) -> [__m256; 2] {
        self.splat(0.0)
    }
    #[inline(always)]
    fn keep(self, kept: [__m256; 2], values: [__m256; 2], least: [__m256; 2]) -> [__m256; 2] {
        each!(2, |i| unsafe {
            let dropped = _mm256_cmp_ps::<_CMP_LT_OQ>(values[i], least[i]);
            _mm256_or_ps(kept[i], dropped)
        })
    }
    #[inline(always)]
    fn kept(self, kept: [__m256; 2]) -> LaneMask {
        !signs_256(kept)
    }
    #[inline(always)]
    fn at_most(self, a: [__m256; 2], b: [__m256; 2]) -> LaneMask {
        signs_256(each!(2, |i| unsafe {
            _mm256_cmp_ps::<_CMP_LE_OQ>(a[i], b[i])
        }))
    }
    #[inline(always)]
    fn words(self, row: &[u32; LANES]) -> [__m256i; 2] {
        each!(2, |i| unsafe {
            _mm256_loadu_si256(row[8 * i..].as_ptr().cast())
        })
    }
    #[inline(always)]
    fn splat_word(self, x: u32) -> [__m256i; 2] {
        [unsafe { _mm256_set1_epi32(x as i32) }; 2]
    }
    #[inline(always)]
    fn counting(self, first: u32) -> [__m256i; 2] {
        each!(2, |i| unsafe {
            let from = _mm256_set1_epi32(first.wrapping_add(8 * i as u32) as i32);
            _mm256_add_epi32(from, _mm256_setr_epi32(0, 1, 2, 3, 4, 5, 6, 7))
        })
    }
    #[inline(always)]
    fn without(
        self,
        words: [__m256i; 2],
        values: [__m256; 2],
        least: [__m256; 2],
        bits: u32,
    ) -> [__m256i; 2] {
        each!(2, |i| unsafe {
            let inside = _mm256_cmp_ps::<_CMP_GE_OQ>(values[i], least[i]);
            let bits =
                _mm256_and_si256(_mm256_castps_si256(inside), _mm256_set1_epi32(bits as i32));
            _mm256_andnot_si256(bits, words[i])
        })
    }
    #[inline(always)]
    fn zeros(self, words: [__m256i; 2]) -> LaneMask {
        signs_256(each!(2, |i| unsafe {
            _mm256_castsi256_ps(_mm256_cmpeq_epi32(words[i], _mm256_setzero_si256()))
        }))
    }
    #[inline(always)]
    fn equal(self, words: [__m256i; 2], x: u32) -> LaneMask {
        signs_256(each!(2, |i| unsafe {
            _mm256_castsi256_ps(_mm256_cmpeq_epi32(words[i], _mm256_set1_epi32(x as i32)))
        }))
    }
    #[inline(always)]
    unsafe fn pack_to(self, place: *mut u32, words: [__m256i; 2], lanes: LaneMask) {
        // The first store is whole, and what it leaves behind its lanes the
        // second one covers; together they stay within sixteen places.
        let (low, high) = (lanes & 0xff, lanes >> 8);
        unsafe {
            _mm256_storeu_si256(place.cast(), packed_256(words[0], low));
            let behind = place.add(low.count_ones() as usize);
            _mm256_storeu_si256(behind.cast(), packed_256(words[1], high));
        }
    }
}

#[inline(always)]
fn signs_256(x: [__m256; 2]) -> LaneMask {
    let signs = x.map(|x| unsafe { _mm256_movemask_ps(x) } as LaneMask);
    signs[0] | signs[1] << 8
}

/// The words of eight lanes moved together.
#[inline(always)]
fn packed_256(words: __m256i, lanes: LaneMask) -> __m256i {
    unsafe {
        // A byte for each lane, those that count moved together, and widened
        // to the indices of a permutation.
        let bytes = _pdep_u64(u64::from(lanes), 0x0101_0101_0101_0101).wrapping_mul(0xff);
        let order = _pext_u64(0x0706_0504_0302_0100, bytes);
        let order = _mm256_cvtepu8_epi32(_mm_cvtsi64_si128(order as i64));
        _mm256_permutevar8x32_epi32(words, order)
    }
}

impl Isa for Avx512 {
    const MANY_REGISTERS: bool = true;

    type Floats = __m512;
    type Words = __m512i;
    type Kept = LaneMask;

    #[inline(always)]
    fn apart<P: Piece<Self>>(self, piece: P) -> P::Output {
        unsafe { apart_avx512(self, piece) }
    }
    #[inline(always)]
    fn load(self, row: &[f32; LANES]) -> __m512 {
        unsafe { _mm512_loadu_ps(row.as_ptr()) }
    }
    #[inline(always)]
    fn to_array(self, floats: __m512) -> [f32; LANES] {
        let mut row = [0.0; LANES];
        unsafe { _mm512_storeu_ps(row.as_mut_ptr(), floats) };
        row
    }
    #[inline(always)]
    fn splat(self, x: f32) -> __m512 {
        unsafe { _mm512_set1_ps(x) }
    }
    #[inline(always)]
    fn pick(self, from: &[f32; 4], picks: u32) -> __m512 {
        unsafe {
            let four = _mm512_broadcast_f32x4(_mm_loadu_ps(from.as_ptr()));
            let lanes =
                _mm512_setr_epi32(0, 2, 4, 6, 8, 10, 12, 14, 16, 18, 20, 22, 24, 26, 28, 30);
            // Only the two lowest bits of a lane count.
            let picks = _mm512_srlv_epi32(_mm512_set1_epi32(picks as i32), lanes);
            _mm512_permutevar_ps(four, picks)
        }
    }
    #[inline(always)]
    fn add(self, a: __m512, b: __m512) -> __m512 {
        unsafe { _mm512_add_ps(a, b) }
    }
    #[inline(always)]
    fn sub(self, a: __m512, b: __m512) -> __m512 {
        unsafe { _mm512_sub_ps(a, b) }
    }
    #[inline(always)]
    fn mul(self, a: __m512, b: __m512) -> __m512 {
        unsafe { _mm512_mul_ps(a, b) }
    }
    #[inline(always)]
    fn lower(self, a: __m512, b: __m512) -> __m512 {
        unsafe { _mm512_min_ps(a, b) }
    }
    #[inline(always)]
    fn below_zero(self, a: __m512) -> LaneMask {
        unsafe { _mm512_cmp_ps_mask::<_CMP_LT_OQ>(a, _mm512_setzero_ps()) }
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
    fn counting(self, first: u32) -> __m512i {
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
    fn zeros(self, words: __m512i) -> LaneMask {
        unsafe { _mm512_testn_epi32_mask(words, words) }
    }
    #[inline(always)]
    fn equal(self, words: __m512i, x: u32) -> LaneMask {
        unsafe { _mm512_cmpeq_epi32_mask(words, _mm512_set1_epi32(x as i32)) }
    }
    #[inline(always)]
    unsafe fn pack_to(self, place: *mut u32, words: __m512i, lanes: LaneMask) {
        // Packed in a register and stored whole: a masked store is slower, on
        // some processors very much so.
        unsafe {
            let packed = _mm512_maskz_compress_epi32(lanes, words);
            _mm512_storeu_si512(place.cast(), packed);
        }
    }
}
