//! Where visibility is resolved, stage by stage: level, region, object, occlusion,
//! triangle, fragment; and picking. One folder a stage, one file a back end; the
//! object stage is [`crate::index`]. The truth that all are held against is in
//! `truth`. It knows scenes and cameras, not how anything is timed or shown.

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
pub use level::{Level, LevelMap, MapFile};
pub use rays::{NoRays, Ray, Rays, SampleGrid};
pub use solids::Solids;

#[cfg(test)]
mod tests_extremes;
