//! Why there is no funnel of a scene.

use super::stage::StageKind;
use crate::index::BuildError;
use crate::input::{InputError, gigabytes};
use crate::measure::WorkloadError;
use crate::query::ItemId;
use crate::scene::{Dispute, ItemShape};
use crate::visibility::{NoRays, SampleGrid};

/// Why there is no funnel.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum FunnelError {
    /// A structure that refuses the scene.
    #[error(transparent)]
    Build(#[from] BuildError),
    /// A camera without a frustum.
    #[error(transparent)]
    View(#[from] WorkloadError),
    /// A camera without rays.
    #[error("{place}: {error}")]
    Rays {
        /// Its place in the path.
        place: String,
        /// Why.
        error: NoRays,
    },
    /// The scene's file, read a second time.
    #[error(transparent)]
    Input(#[from] InputError),
    /// Holes and mirrors are made of solid boxes, boxes looked for inside triangles.
    #[error(
        "the items of '{scene}' are {}; expected a scene of {} for {option}",
        shape.name(),
        expected.name()
    )]
    Shape {
        /// Its name.
        scene: String,
        /// What its items are.
        shape: ItemShape,
        /// What they would have to be.
        expected: ItemShape,
        /// What was asked for.
        option: &'static str,
    },
    /// Images that would not fit into memory; sizes in bytes.
    #[error(
        "--samples {}x{}: images need about {}, {} are free; expected fewer samples",
        grid.width,
        grid.height,
        gigabytes(*needed),
        gigabytes(*available)
    )]
    TooManySamples {
        /// What was asked for.
        grid: SampleGrid,
        /// Bytes that are needed.
        needed: u64,
        /// Bytes that are free.
        available: u64,
    },
    /// Items that are in front at the same samples, as those with a common face are.
    #[error(
        "camera {place}: about {in_front} items in front at the samples, those of each sample \
         counted; expected at most {most}: fewer --samples or fewer items with a common face"
    )]
    TooManyTies {
        /// The camera's index in the path.
        place: usize,
        /// Estimated number.
        in_front: u64,
        /// Most of them.
        most: u64,
    },
    /// A mirror that is no item.
    #[error("--mirror {item}: '{scene}' has {items} items; expected one from 0 to {}", items - 1)]
    NoMirror {
        /// What was asked for.
        item: ItemId,
        /// The scene's name.
        scene: String,
        /// How many items it has.
        items: usize,
    },
    /// A claim of what is seen from where, about a scene without regions.
    #[error("'{scene}' has no rooms or sectors; expected some for --pvs")]
    NoRegions {
        /// Its name.
        scene: String,
    },
    /// The same, about a map whose sectors are no regions.
    #[error("'{scene}': {dispute}; expected sectors that divide the map for --pvs")]
    Disputed {
        /// Its name.
        scene: String,
        /// A place of no known sector.
        dispute: Dispute,
    },
    /// What is claimed to be seen from where is of other regions.
    #[error(
        "the claim of what is seen from where is of {claimed} regions; expected the scene's {regions}"
    )]
    Claim {
        /// Regions of the claim.
        claimed: usize,
        /// Regions of the scene.
        regions: usize,
    },
    /// A back end that the scene has no data for.
    #[error("{stage} '{name}' needs what the scene does not have; expected one of {known}", stage = stage.name())]
    Absent {
        /// The stage.
        stage: StageKind,
        /// What was asked for.
        name: String,
        /// What there is.
        known: String,
    },
}
