//! Memory checks, and missing rows with their reasons.

use serde::Serialize;

use crate::input::InputError;
use crate::scene::memory::{available_bytes, fits_into};
use crate::visibility::SampleGrid;
use crate::visibility::fragment::Rectangle;

/// Rejects a step that needs more memory than is free.
pub(crate) fn check_memory(step: &str, needed: u64) -> Result<(), InputError> {
    let told = [step, "", "fewer items or views"];
    fits_into(available_bytes(), told, needed)
}

/// A row that is missing from a section of the report.
#[derive(Clone, Debug, Serialize)]
pub struct LeftOutRow {
    /// Section of the report: `stages` or `picks`.
    pub section: &'static str,
    /// Name of a back end or structure, of a stage, or `all` of the section.
    pub name: String,
    /// Reason, as a sentence without a period.
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

/// Most layers drawn over a large image, on average; smaller images may have more.
const MOST_LAYERS: u64 = 16;
/// Number of samples of a large image.
const LARGE: u64 = 1 << 20;

/// Most samples drawn in an image, summed over the items.
pub fn most_drawn(grid: SampleGrid) -> u64 {
    MOST_LAYERS * (grid.samples() as u64).max(LARGE)
}

/// Rejects items that cover too many samples of an image in total.
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
