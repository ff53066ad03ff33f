//! Error against run time of culling tests, arithmetic and plane derivations.
//!
//! Errors of each, and its time on each structure. Owns the points of that diagram
//! and the sweeps; the truth is the oracle's, the clock is `measure`'s.

mod judged;
mod point;
mod points;
mod sweeps;

pub use judged::Names;
pub use point::Point;
pub use points::{Precision, prepare, time};
pub use sweeps::{SWEEPS, Sweep, SweepRow, sweep};
