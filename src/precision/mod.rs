//! Error against run time: what each culling test, arithmetic and derivation
//! of the planes gets wrong, and what it costs on each structure. It owns the
//! points of that diagram and of region search's, and the sweeps; the truth is the
//! oracle's, the clock is `measure`'s.

mod judged;
mod point;
mod points;
mod region_search;
mod size_sweep;
mod stability;
mod sweeps;

pub use judged::{CullingErrors, Names};
pub use point::{Point, Times};
pub use points::{PointPlan, Precision, PrecisionInput, Prepared, prepare, time};
pub use region_search::{POINTS_PER_CAMERA, RegionErrors};
pub use size_sweep::{SIZE_RATIOS, SizeError, SizeRow, size_sweep};
pub use stability::StableAfter;
pub use sweeps::{SWEEPS, Sweep, SweepRow, sweep};
