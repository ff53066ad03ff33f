//! Culling funnel of a scene and a path: stages with interchangeable back ends.
//!
//! Level, region, object, occlusion, triangle and fragment, each compared with the exact truth and
//! timed. The back ends are in [`crate::visibility`]; this module measures them.
//!
//! A [`Chain`] names a back end for each stage. The study compares it with every chain that differs
//! from it in one stage: [`prepare`] counts, [`time`] measures in each process,
//! [`UntimedFunnel::conclude`] combines both.

mod error;
mod fragment_stage;
mod item_stages;
mod picks;
mod report;
mod setup;
mod stage;
mod study;
mod task;
mod triangle_stage;
mod visible_items;

pub(crate) use error::check_memory;
pub use item_stages::ItemOutcome;
pub use picks::PickRow;
pub use report::{FunnelReport, Gain, StageRow};
pub use setup::FunnelInput;
pub(crate) use setup::Shape;
pub use stage::{Chain, NEEDS, NONE, StageKind, back_ends, left_out_of};
pub use study::{UntimedFunnel, failure, prepare, time};
pub use task::FunnelPlan;
pub use triangle_stage::BYTES_PER_TRIANGLE;
pub(crate) use visible_items::RayTargets;

#[cfg(test)]
pub(crate) use stage::BackEnd;
#[cfg(test)]
pub(crate) use visible_items::Errors;
