//! Memory and rows that are missing, with the reason.

use serde::Serialize;

use crate::input::InputError;
use crate::scene::memory::{available_bytes, fits_into};
use crate::visibility::SampleGrid;
use crate::visibility::fragment::Rectangle;

/// Refuses a step that needs more memory than is free.
pub(crate) fn check_memory(step: &str, needed: u64) -> Result<(), InputError> {
    let told = [step, "", "fewer items or views"];
    fits_into(available_bytes(), told, needed)
}

/// A row that is left out of a section of the report.
#[derive(Clone, Debug, Serialize)]
pub struct LeftOutRow {
    /// The section: `stages` or `picks`.
    pub section: &'static str,
    /// A back end, a structure, a stage without any, or `all` of the section.
    pub name: String,
    /// The reason, as a sentence without its period.
    pub reason: String,
}

impl LeftOutRow {
    pub(super) fn new(section: &'static str, name: &str, reason: impl ToString) -> LeftOutRow {
        LeftOutRow {
            section,
            name: name.to_owned(),
            reason: reason.to_string(),
        }
    }
}

/// Mean layers of a large image that are drawn at most; of smaller images more.
const MOST_LAYERS: u64 = 16;
/// Samples of a large image.
const LARGE: u64 = 1 << 20;

/// Most samples that are drawn in an image, those of each item counted.
pub fn most_drawn(grid: SampleGrid) -> u64 {
    MOST_LAYERS * (grid.samples() as u64).max(LARGE)
}

/// Refuses to draw items that cover too many samples of an image.
pub fn fits_drawing(
    grid: SampleGrid,
    rectangles: impl Iterator<Item = Rectangle>,
) -> Result<(), String> {
    let most = most_drawn(grid);
    let samples: u64 = rectangles.map(|rectangle| rectangle.samples()).sum();
    match samples > most {
        true => Err(format!(
            "{samples} samples drawn in a view, summed over its items; expected at most {most}: \
             fewer samples or fewer items"
        )),
        false => Ok(()),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn items_may_cover_sixteen_layers_of_a_large_image() {
        let grid = SampleGrid::new(1500, 1000);
        let full = Rectangle {
            columns: 0..1500,
            rows: 0..1000,
        };
        let of = |items| fits_drawing(grid, std::iter::repeat_n(full.clone(), items));
        assert_eq!(of(16), Ok(()));
        let refused = of(17).unwrap_err();
        assert!(
            refused.starts_with("25500000 samples drawn in a view"),
            "{refused}"
        );
    }
}
