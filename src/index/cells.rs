//! Cells of structures, for pictures, and the verdicts of a query about them.

use crate::geometry::{Aabb, Plane};
use crate::query::{AnyVolume, Containment, ItemId, NoRecorder, Predicate, each_volume};

/// A node of a tree, or of any other nested division.
#[derive(Clone, Copy, Debug)]
pub struct TreeCell<'a> {
    /// Number of cells around it: 0 for a root.
    pub level: u32,
    /// Closed bounds of all items of the cell, as a query tests them.
    pub bounds: Aabb,
    /// Half-space of the cell within the cell around it, if a plane divides that.
    pub half_space: Option<Plane>,
    /// Items that the cell keeps itself, without those of the cells in it.
    pub items: &'a [ItemId],
}

/// Verdicts about cells in depth-first order by a query with a volume of planes.
///
/// `None` for a cell that is not tested because the cell around it is outside or inside.
pub fn verdicts(cells: &[TreeCell<'_>], volume: AnyVolume<'_>) -> Vec<Option<Containment>> {
    each_volume!(volume, volume => {
        // Open planes of the cells of a level, as long as the cells around straddle.
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
