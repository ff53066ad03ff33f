//! Cells of structures, for pictures, and how a query classifies them.

use crate::geometry::{Aabb, Plane};
use crate::query::{AnyVolume, Containment, ItemId, NoRecorder, Predicate, each_volume};

/// A node of a tree, or of any other nested division.
#[derive(Clone, Copy, Debug)]
pub struct TreeCell<'a> {
    /// Number of cells around it: 0 for a root.
    pub level: u32,
    /// Closed bounds of all items of the cell; queries test these.
    pub bounds: Aabb,
    /// Half-space of the cell within its parent, if a plane divides the parent.
    pub half_space: Option<Plane>,
    /// Items of the cell itself, without those of its child cells.
    pub items: &'a [ItemId],
}

/// Classifies cells in depth-first order against a volume of planes.
///
/// `None` for a cell that is not tested because its parent is outside or inside.
pub fn verdicts(cells: &[TreeCell<'_>], volume: AnyVolume<'_>) -> Vec<Option<Containment>> {
    each_volume!(volume, volume => {
        // Open planes of the cells of a level, as long as their parents straddle.
        let mut masks = vec![volume.mask()];
        let verdict = |cell: &TreeCell<'_>| {
            let level = cell.level as usize;
            masks.truncate(level.saturating_add(1));
            let &mask = masks.get(level)?;
            let (verdict, open) = volume.classify(&cell.bounds, mask, &mut NoRecorder);
            if verdict == Containment::Straddles {
                masks.push(open);
            }
            Some(verdict)
        };
        cells.iter().map(verdict).collect()
    })
}
