//! Error against run time: what each culling test, arithmetic and derivation
//! of the planes gets wrong, and what it costs on each structure. It owns the
//! points of that diagram and the sweeps; the truth is the oracle's, the clock is
//! `measure`'s.

mod judged;
mod point;
mod points;
mod size;
mod sweeps;

pub use judged::Names;
pub use point::Point;
pub use points::{Precision, prepare, time};
pub use sweeps::{SWEEPS, Sweep, SweepRow, sweep};
