//! Arithmetic with a known error, or none.
//!
//! Directed rounding, error-free sums and products, cross products without cancellation, and
//! expansions (exact sums of doubles).

mod combinations;
mod cross;
pub mod exact;
mod expansion;
pub mod rounding;

pub use combinations::combinations;
pub use cross::{cross, cross_sizes};
pub use expansion::{Expansion, two_product, two_sum};
