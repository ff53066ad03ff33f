//! Error against run time: what each culling test, arithmetic and derivation
//! of the planes gets wrong, and what it costs on each structure. It owns the
//! points of that diagram and the two sweeps; the truth is the oracle's, the
//! clock is `measure`'s.

mod judged;
mod offset_sweep;
mod point;
mod points;
mod quantised;
mod size_sweep;
mod stability;

pub use offset_sweep::{OFFSETS, OffsetRow, offset_sweep};
pub use point::Point;
pub use points::{PointPlan, Precision, PrecisionInput, Prepared, measure_points, prepare, time};
pub use size_sweep::{SIZE_RATIOS, SizeRow, size_sweep};
pub use stability::StableAfter;
