//! Error against run time of culling tests, arithmetic and plane derivations.
//!
//! Contains the points of that diagram (the errors of each, and its time on each structure) and the
//! sweeps; the truth comes from the oracle, the clock from `measure`.

mod culling_result;
mod point;
mod points;
mod sweeps;

pub use culling_result::Names;
pub use point::Point;
pub use points::{Precision, prepare, time};
pub use sweeps::{SWEEPS, Sweep, SweepRow, sweep};
