//! Cells of structures, for pictures: bounds, levels and items, and the verdicts of a
//! query about them.

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

/// Verdicts about cells in depth-first order by a query with a volume of planes; `None`
/// for a cell that it does not test because the cell around it is outside or inside.
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::index::Registry;
    use crate::path::{self, LensDefaults};
    use crate::query::QueryCost;
    use crate::scene;

    /// Costs of a query as the cells show it: nodes tested and rejected, items tested and
    /// accepted untested.
    fn shown(cells: &[TreeCell<'_>], volume: AnyVolume<'_>) -> [usize; 4] {
        let (mut cost, mut inside) = ([0; 4], None);
        for (cell, verdict) in cells.iter().zip(verdicts(cells, volume)) {
            inside = inside.filter(|level| *level < cell.level);
            match verdict {
                Some(Containment::Inside) => inside = Some(cell.level),
                Some(Containment::Outside) => cost[1] += 1,
                Some(Containment::Straddles) => cost[2] += cell.items.len(),
                None => {}
            }
            cost[0] += usize::from(verdict.is_some());
            cost[3] += inside.map_or(0, |_| cell.items.len());
        }
        cost
    }

    #[test]
    fn cells_hold_each_item_once_and_show_what_a_query_counts() {
        let scene = scene::load("city:n=3000", &Default::default()).expect("a scene");
        let cameras = path::load("flythrough:frames=6", &scene, &LensDefaults::default());
        let cameras = cameras.expect("a path").cameras;
        let mut drawn = Vec::new();
        for spec in Registry::builtin().structures("all").expect("names") {
            let index = spec.build(&scene.items).expect("a structure");
            let cells = index.cells();
            if cells.is_empty() {
                continue;
            }
            drawn.push(spec.info().name);
            let mut ids: Vec<ItemId> = Vec::new();
            for cell in &cells {
                let within = |id: &ItemId| cell.bounds.contains(&scene.items[*id as usize]);
                assert!(cell.items.iter().all(within), "{}: {cell:?}", spec.label);
                ids.extend(cell.items);
            }
            ids.sort_unstable();
            assert!(ids.iter().copied().eq(0..3000), "{}", spec.label);
            for camera in &cameras {
                let volume = camera.volume(&Default::default(), &scene.surroundings());
                let volume = volume.expect("a frustum");
                let (mut seen, mut cost) = (Vec::new(), QueryCost::default());
                index.query_counted((&volume).into(), &mut seen, &mut cost);
                let nodes = [cost.nodes_tested, cost.subtrees_rejected];
                let items = [cost.items_tested, cost.items_accepted_untested];
                let counted = [nodes, items].concat().into_iter().map(|n| n as usize);
                let shown = shown(&cells, (&volume).into());
                assert_eq!(counted.collect::<Vec<_>>(), shown, "{}", spec.label);
            }
        }
        assert!(drawn.len() >= 8, "{drawn:?}");
    }
}
