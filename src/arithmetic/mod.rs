//! Arithmetic whose error is known: directed rounding, error-free
//! transformations, products that do not cancel, and expansions (sums of
//! doubles without any error). It
//! knows no geometry.

mod cross;
mod expansion;
pub mod rounding;

pub use cross::cross;
pub use expansion::{Expansion, two_product, two_sum, upper_half};
