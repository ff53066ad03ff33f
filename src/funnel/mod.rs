//! The funnel of a scene and a path: level, region, object, occlusion, triangle,
//! fragment, each stage with interchangeable back ends, held against the truth and
//! timed. How a stage works is in [`crate::visibility`]; this is what is read off it.
//!
//! A [`Chain`] names a back end for each stage. The study compares it with every chain
//! that differs from it in one stage: [`prepare`] judges, [`time`] measures in each
//! process, [`Prepared::conclude`] puts both together.

mod back_ends;
mod bounds;
mod chain;
mod conclusions;
mod error;
mod faces;
mod fragment_rows;
mod fragments;
mod hiding;
mod judged;
mod left_out;
mod mirror;
mod orders;
mod pass;
mod pickable;
mod picks;
mod plan;
mod plan_view;
mod regions;
mod report;
mod seen;
mod stage;
mod study;
mod sweep;
mod times;
mod triangle_rows;
mod truth;
mod walks;
mod world;

pub use back_ends::{back_ends, left_out_of};
pub use bounds::BoundRow;
pub use chain::Chain;
pub use error::FunnelError;
pub use faces::BYTES_PER_TRIANGLE;
pub use fragments::FragmentCounts;
pub use judged::Errors;
pub use left_out::{LeftOutRow, Reason};
pub use mirror::MirrorRow;
pub use orders::OrderRow;
pub use picks::{PickQuestion, PickRow};
pub use plan::FunnelPlan;
pub use plan_view::{Fate, PlanView};
pub use report::{CutOutRow, FunnelReport, Gain, LevelRow, StageRow};
pub use stage::{BackEnd, NONE, StageKind};
pub use study::{Prepared, failure, prepare, time};
pub use sweep::{PreparedSweep, StageSweep, SweepPoint, prepare_sweep, time_sweep};
pub use times::Times;
pub use world::FunnelInput;
