//! Arithmetic whose error is known: directed rounding, error-free
//! transformations, and expansions (sums of doubles without any error). It
//! knows no geometry.

mod expansion;
pub mod rounding;

pub use expansion::{Expansion, two_product, two_sum, upper_half};
