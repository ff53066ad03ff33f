//! From regions to items: those whose boxes meet a part of a region.

use super::csr::Csr;
use super::graph::RegionGraph;
use super::id_set::{IdSet, RegionId};
use super::locate::BoxGrid;
use crate::query::ItemId;
use crate::scene::{Scene, WorldBox};

/// The items of each region.
#[derive(Clone, Debug)]
pub struct RegionItems {
    lists: Csr<ItemId>,
    items: usize,
}

impl RegionItems {
    /// The items that touch or meet each region; both are closed.
    ///
    /// An item that touches a region's box is listed, and one that [meets](super::Ground::more_at) the region elsewhere.
    /// Where regions have no height of their own (a map's), boxes of regions are taken
    /// to extend without end up and down. O(n log n) for items much smaller than regions.
    pub fn of(graph: &RegionGraph, scene: &Scene) -> RegionItems {
        let regions = 0..graph.len() as u32;
        let owners = regions.flat_map(|region| graph.parts(region).iter().map(move |_| region));
        let owners: Vec<RegionId> = owners.collect();
        let grid = BoxGrid::new(graph.parts.all.clone());
        let mut lists = vec![Vec::new(); graph.len()];
        let mut met = Vec::new();
        for (id, item) in (0..).zip(&scene.items) {
            let b = WorldBox::of(item, scene.origin);
            met.clear();
            grid.meeting(&b, |part| met.push(owners[part as usize]));
            graph.ground().more_at(&b, &mut met);
            met.sort_unstable();
            met.dedup();
            met.iter().for_each(|&owner| lists[owner as usize].push(id));
        }
        RegionItems {
            lists: Csr::of(&lists),
            items: scene.items.len(),
        }
    }

    /// The items that meet a region, ascending.
    pub fn of_region(&self, region: RegionId) -> &[ItemId] {
        self.lists.list(region)
    }

    /// Replaces `out` by the items of the regions, ascending. All regions together
    /// are all items. O(items of the regions + n / 64).
    pub fn of_regions(&self, regions: &[RegionId], marks: &mut IdSet, out: &mut Vec<ItemId>) {
        if regions.len() == self.lists.count() {
            out.clear();
            out.extend(0..self.items as u32);
            return;
        }
        marks.clear(self.items);
        for &region in regions {
            for &item in self.of_region(region) {
                marks.insert(item);
            }
        }
        marks.list(out);
    }
}
