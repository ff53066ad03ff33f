//! Rows that a study leaves out, each with its reason.

use serde::{Serialize, Serializer};

use crate::scene::Dispute;
use crate::visibility::SampleGrid;
use crate::visibility::fragment::{Rectangle, TooManyPairs};
use crate::visibility::pick::NotBuilt;

/// Why rows are left out.
#[derive(Clone, PartialEq, Debug, thiserror::Error)]
#[non_exhaustive]
pub enum Reason {
    /// A map whose sectors do not divide the plane.
    #[error(transparent)]
    Disputed(#[from] Dispute),
    /// A back end of picking that refuses the items.
    #[error(transparent)]
    NotBuilt(#[from] NotBuilt),
    /// Items that cover more samples than are drawn.
    #[error(
        "{samples} samples to be drawn in a view, those of each item counted; \
         expected at most {most}: fewer --samples or fewer items"
    )]
    TooMuchDrawn {
        /// Samples of the rectangles about all of them.
        samples: u64,
        /// Most samples.
        most: u64,
    },
    /// Items of which too many lie behind each other.
    #[error(transparent)]
    TooManyPairs(#[from] TooManyPairs),
}

/// What is left out of a section of the report.
#[derive(Clone, Debug, Serialize)]
#[non_exhaustive]
pub struct LeftOutRow {
    /// The section: `stages`, `mirror`, `orders` or `picks`.
    pub section: &'static str,
    /// The back end, the stage of which all are left out, or `all` of the section.
    pub name: &'static str,
    /// Why.
    #[serde(serialize_with = "as_text")]
    pub reason: Reason,
}

impl LeftOutRow {
    /// A back end of a section.
    pub fn of(section: &'static str, name: &'static str, reason: impl Into<Reason>) -> Self {
        let reason = reason.into();
        LeftOutRow {
            section,
            name,
            reason,
        }
    }
}

fn as_text<S: Serializer>(reason: &Reason, out: S) -> Result<S::Ok, S::Error> {
    out.collect_str(reason)
}

/// Mean layers of a large image that are drawn at most; of smaller images more.
const MOST_LAYERS: u64 = 16;
/// Samples of a large image.
const LARGE: u64 = 1 << 20;

/// Samples that may be drawn in an image, those of each item counted.
pub fn most_drawn(grid: SampleGrid) -> u64 {
    MOST_LAYERS * (grid.samples() as u64).max(LARGE)
}

/// Refuses to draw what covers too many samples of an image.
pub fn fits_drawing(
    grid: SampleGrid,
    rectangles: impl Iterator<Item = Rectangle>,
) -> Result<(), Reason> {
    let most = most_drawn(grid);
    let samples = rectangles.map(|rectangle| rectangle.samples()).sum();
    match samples > most {
        true => Err(Reason::TooMuchDrawn { samples, most }),
        false => Ok(()),
    }
}
