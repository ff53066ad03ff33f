//! Instruction sets, selected at run time.
//!
//! One source is compiled once per instruction set; results are bit-identical. Unsafe code
//! is in the folder `x86` and nowhere else in the crate. Builds whose vectors are plain
//! arrays (other architectures, interpreters, `--cfg plain_vectors`) omit that folder, and
//! the compiler forbids unsafe code in them.
//!
//! Products and sums are never fused: Rust does not do it implicitly on any instruction set,
//! and the plane test relies on it. [`Isa::near_mul_add`] alone may fuse, for sums whose error
//! a bound covers.

mod inlined;
mod isa;
mod plain;

#[cfg(not(all(target_arch = "x86_64", not(any(miri, plain_vectors)))))]
#[path = "arrays.rs"]
mod machine;
#[cfg(all(target_arch = "x86_64", not(any(miri, plain_vectors))))]
#[path = "x86/mod.rs"]
mod machine;

use std::fmt;
use std::sync::OnceLock;

pub(crate) use inlined::{each, pairs};
pub(crate) use isa::first_lanes;
pub use isa::{Append, Isa, LANES, LaneMask, Piece};
pub(crate) use machine::{extend, extend_from_range, prefetch};
pub use plain::Plain;

named! {
    /// An instruction set that queries are compiled for, from smallest to largest.
    #[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, Debug)]
    pub enum Kernel, KERNELS {
        Portable = "portable",
            "Plain arrays: whatever vectors the compiler makes of them, SSE2 or NEON.";
        Avx2 = "avx2", "256-bit vectors and the bit instructions of the same generation.";
        Avx512 = "avx512", "512-bit vectors: a block of sixteen boxes is one register a row.";
    }
}

/// A piece of work that [`Kernel::run`] compiles for each instruction set.
///
/// `run` and all hot functions in it must be `#[inline(always)]`: a function that is not inlined is
/// compiled for the portable set.
pub trait Work {
    /// Result of the work.
    type Output;

    /// Does the work with these instructions.
    fn run<I: Isa>(self, isa: I) -> Self::Output;
}

impl Kernel {
    /// Returns whether this processor and operating system run it; detected once.
    #[inline]
    pub fn is_available(self) -> bool {
        static AVAILABLE: OnceLock<[bool; 3]> = OnceLock::new();
        AVAILABLE.get_or_init(|| Kernel::ALL.map(machine::detect))[self as usize]
    }

    /// The kernels of this machine, [`Kernel::Portable`] first.
    pub fn available() -> impl Iterator<Item = Kernel> {
        let all = Kernel::ALL.into_iter();
        all.filter(|kernel| kernel.is_available())
    }

    /// The largest instruction set of this machine.
    pub fn best() -> Kernel {
        Kernel::available().last().unwrap_or(Kernel::Portable)
    }

    /// Does the work with this instruction set.
    ///
    /// With the portable one if the processor lacks it. The result is the same.
    #[inline(always)]
    pub fn run<W: Work>(self, work: W) -> W::Output {
        machine::run(self, work)
    }
}

impl fmt::Display for Kernel {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.name())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn portable_is_everywhere() {
        assert_eq!(Kernel::available().next(), Some(Kernel::Portable));
        assert!(Kernel::best().is_available());
    }

    #[test]
    fn lists_are_extended_as_by_std() {
        let words: Vec<u32> = (1..=700).collect();
        for start in [0, 1, 15, 16, 300, 680, 700] {
            for length in [0, 1, 2, 7, 15, 16, 17, 32, 33, 255, 256, 257, 400] {
                let places = start..(start + length).min(words.len());
                for held in [0, 5, 40] {
                    let std: Vec<u32> = (0..held).chain(words[places.clone()].to_vec()).collect();
                    let mut out: Vec<u32> = (0..held).collect();
                    extend(&mut out, &words[places.clone()]);
                    assert_eq!(out, std, "{places:?}");
                    out.truncate(held as usize);
                    extend_from_range(&mut out, &words, places.clone());
                    assert_eq!(out, std, "{places:?}");
                }
            }
        }
        assert!((0..40).all(|count| first_lanes(count).count_ones() as usize == count.min(LANES)));
    }

    #[test]
    #[should_panic(expected = "out of range")]
    fn places_that_are_not_there_panic() {
        extend_from_range(&mut Vec::new(), &[1, 2, 3], 2..4);
    }

    /// Sixteen products and sums, which a fused multiply-add would round once.
    struct MulAdd<'a>(&'a [f32; 16], &'a [f32; 16], &'a [f32; 16]);

    impl Work for MulAdd<'_> {
        type Output = [f32; 16];

        #[inline(always)]
        fn run<I: Isa>(self, isa: I) -> [f32; 16] {
            let product = isa.mul(isa.load(self.0), isa.load(self.1));
            let sum = isa.to_array(isa.add(product, isa.load(self.2)));
            let plain: [f32; 16] =
                std::array::from_fn(|lane| self.0[lane] * self.1[lane] + self.2[lane]);
            assert_eq!(sum.map(f32::to_bits), plain.map(f32::to_bits));
            sum
        }
    }

    #[test]
    fn no_kernel_fuses_a_product_and_a_sum() {
        let x: [f32; 16] = std::array::from_fn(|i| 1.0 + (i + 1) as f32 * 2f32.powi(-12));
        let minus_square = x.map(|x| -(x * x));
        let fused = x[0].mul_add(x[0], minus_square[0]);
        assert_ne!(fused, 0.0, "the premise: fused, something is left");
        for kernel in Kernel::available() {
            let (x, y) = (std::hint::black_box(x), std::hint::black_box(minus_square));
            assert_eq!(kernel.run(MulAdd(&x, &x, &y)), [0.0; 16], "{kernel}");
        }
    }
}
