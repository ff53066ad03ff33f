//! The portable kernel alone, for any machine.

use std::ops::Range;

use super::plain::Plain;
use super::{Kernel, Work};

/// Returns whether this processor runs the kernel.
pub fn detect(kernel: Kernel) -> bool {
    kernel == Kernel::Portable
}

/// Does the work with the portable kernel.
#[inline]
pub fn run<W: Work>(_: Kernel, work: W) -> W::Output {
    work.run(Plain)
}

/// `out.extend_from_slice(words)`.
#[inline(always)]
pub fn extend(out: &mut Vec<u32>, words: &[u32]) {
    out.extend_from_slice(words);
}

/// `extend(out, &words[places])`.
#[inline(always)]
pub fn extend_from_range(out: &mut Vec<u32>, words: &[u32], places: Range<usize>) {
    out.extend_from_slice(&words[places]);
}

/// Does nothing: there is no instruction for it.
#[inline(always)]
pub fn prefetch<T>(_: &T) {}
