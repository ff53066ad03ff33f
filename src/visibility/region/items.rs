//! From regions to items: those whose boxes meet a part of a region.

use super::answer::{Marks, RegionId};
use super::graph::RegionGraph;
use super::locate::{BoxGrid, covers};
use crate::query::ItemId;
use crate::scene::{Scene, WorldBox};

/// The items of each region.
#[derive(Clone, Debug)]
pub struct RegionItems {
    starts: Vec<u32>,
    lists: Vec<ItemId>,
    /// Items that no region holds wholly, and so may be seen from outside of all.
    loose: Vec<ItemId>,
    items: usize,
}

impl RegionItems {
    /// Items and regions are closed: an item that touches a region's box is listed.
    /// Where regions have no height of their own (a map's), boxes of regions are taken
    /// to go on for ever up and down. O(n log n) for items much smaller than regions.
    pub fn of(graph: &RegionGraph, scene: &Scene) -> RegionItems {
        let mut owners = Vec::new();
        let mut parts = Vec::new();
        for region in 0..graph.len() as u32 {
            for part in graph.parts(region) {
                owners.push(region);
                parts.push(*part);
            }
        }
        let grid = BoxGrid::new(parts);
        let mut pairs: Vec<(RegionId, ItemId)> = Vec::new();
        let mut loose = Vec::new();
        let (mut met, mut boxes) = (Vec::new(), Vec::new());
        for (id, item) in (0..).zip(&scene.items) {
            let b = WorldBox::of(item, scene.origin);
            met.clear();
            grid.meeting(&b, |part| met.push(part));
            met.sort_unstable();
            met.dedup();
            boxes.clear();
            boxes.extend(met.iter().map(|&part| grid.boxes()[part as usize]));
            if !covers(&boxes, &b) {
                loose.push(id);
            }
            pairs.extend(met.iter().map(|&part| (owners[part as usize], id)));
        }
        pairs.sort_unstable();
        pairs.dedup();
        let mut starts = vec![0; graph.len() + 1];
        pairs
            .iter()
            .for_each(|(region, _)| starts[*region as usize + 1] += 1);
        for i in 1..starts.len() {
            starts[i] += starts[i - 1];
        }
        RegionItems {
            starts,
            lists: pairs.into_iter().map(|(_, item)| item).collect(),
            loose,
            items: scene.items.len(),
        }
    }

    /// The items that meet a region, ascending.
    pub fn of_region(&self, region: RegionId) -> &[ItemId] {
        let at = region as usize;
        &self.lists[self.starts[at] as usize..self.starts[at + 1] as usize]
    }

    /// Items that are not wholly in regions, ascending: to be added wherever the eye
    /// is not inside ([`super::EyePlace::Outside`]).
    pub fn loose(&self) -> &[ItemId] {
        &self.loose
    }

    /// Replaces `out` by the items of the regions, ascending. All regions together
    /// are all items, the loose ones too. O(items of the regions + n / 64).
    pub fn of_regions(&self, regions: &[RegionId], marks: &mut Marks, out: &mut Vec<ItemId>) {
        if regions.len() + 1 == self.starts.len() {
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
