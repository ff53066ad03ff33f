//! Error against run time: what each culling test, arithmetic and derivation
//! of the planes gets wrong, and what it costs on each structure. It owns the
//! points of that diagram and the two sweeps; the truth is the oracle's, the
//! clock is `measure`'s.

mod offset_sweep;
mod points;
mod size_sweep;

pub use offset_sweep::{OFFSETS, OffsetRow, offset_sweep};
pub use points::{Point, Precision, StableAfter, measure_points};
pub use size_sweep::{SIZE_RATIOS, SizeRow, size_sweep};
