//! The stages of visibility, and picking.
//!
//! Level, region, object, occlusion, triangle and fragment: one folder per stage, one file per
//! back end; the object stage is [`crate::index`]. All are compared with the exact answers of
//! `truth`. Nothing here is timed or printed.

pub mod fragment;
mod guarantee;
pub mod hiders;
pub mod inscribed;
mod items;
mod level;
pub mod occlusion;
pub mod pick;
mod rays;
pub mod region;
mod sah;
mod solids;
pub mod triangle;
pub mod truth;

pub use guarantee::Guarantee;
pub use items::{holes_of, surfaces_of};
pub use level::{Level, LevelMap};
pub use rays::{Ray, Rays, SampleGrid};
pub use solids::Solids;

#[cfg(test)]
mod tests_extremes;
