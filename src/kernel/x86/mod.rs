//! Kernels for x86-64 with AVX2 or AVX-512; other processors use plain arrays.
//!
//! The only folder of the crate with unsafe code. Intrinsics are unsafe; they
//! are sound because a value of each set's type only exists where its
//! instructions do.
#![allow(unsafe_code)]

/// The proof of an instruction set, and work that is compiled for it.
macro_rules! instruction_set {
    ($(#[$about:meta])* $Set:ident, $features:literal) => {
        $(#[$about])*
        #[derive(Clone, Copy, Debug)]
        pub struct $Set(());

        impl $Set {
            /// Does the work with these instructions.
            #[target_feature(enable = $features)]
            pub(super) fn run<W: Work>(work: W) -> W::Output {
                work.run($Set(()))
            }
        }

        #[inline(never)]
        #[target_feature(enable = $features)]
        fn run_outlined<P: Piece<$Set>>(isa: $Set, piece: P) -> P::Output {
            piece.run(isa)
        }
    };
}

mod appender;
mod avx2;
mod avx512;

pub use appender::{extend, extend_from_range};

use super::{Kernel, Plain, Work};

/// Returns whether this processor and operating system run the kernel.
pub fn detect(kernel: Kernel) -> bool {
    macro_rules! all {
        ($($feature:tt),*) => { true $(&& std::arch::is_x86_feature_detected!($feature))* };
    }
    // The features of `Avx2` and `Avx512`, each by name.
    let avx2 = || all!("avx2", "bmi1", "bmi2", "lzcnt", "popcnt");
    match kernel {
        Kernel::Portable => true,
        Kernel::Avx2 => avx2(),
        Kernel::Avx512 => avx2() && all!("avx512f", "avx512vl", "avx512bw", "avx512dq"),
    }
}

/// Does the work with this instruction set.
///
/// With the portable one if the processor lacks it.
// Inlined: a call would store the work word by word and load it by vectors, which stalls.
#[inline(always)]
pub fn run<W: Work>(kernel: Kernel, work: W) -> W::Output {
    match kernel {
        Kernel::Avx512 if kernel.is_available() => {
            // SAFETY: `detect` has found every feature that `Avx512` is
            // compiled for on this processor.
            unsafe { avx512::Avx512::run(work) }
        }
        Kernel::Avx2 if kernel.is_available() => {
            // SAFETY: as above, for the features of `Avx2`.
            unsafe { avx2::Avx2::run(work) }
        }
        _ => work.run(Plain),
    }
}

/// Prefetches the cache line at the start of `place`, without effect on values.
#[inline(always)]
pub fn prefetch<T>(place: &T) {
    use std::arch::x86_64::{_MM_HINT_T0, _mm_prefetch};
    // SAFETY: SSE is part of every x86-64, and a prefetch never faults.
    unsafe { _mm_prefetch::<_MM_HINT_T0>(std::ptr::from_ref(place).cast()) };
}
