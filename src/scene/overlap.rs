//! Boxes to search by: which items overlap a box, exactly. It defines the comparison
//! of boxes as they were written; searching is left to the indexes.

use super::side::side;
use super::{Scene, WorldBox};
use crate::geometry::{Aabb, ConvexVolume};
use crate::query::ItemId;

/// A box to search by: as it was written, and as indexes are asked.
#[derive(Clone, Debug)]
pub struct SoughtBox {
    /// World coordinates, in f64.
    pub world: WorldBox,
    /// The planes of the smallest f32 box that holds it. Indexes may find too
    /// many items by it, never too few.
    pub volume: ConvexVolume,
}

impl Scene {
    /// A box of the world as this scene's indexes are asked for it.
    pub fn sought_box(&self, world: WorldBox) -> SoughtBox {
        let local = Aabb::rounded_outward(world.min, world.max, self.origin);
        SoughtBox {
            volume: ConvexVolume::of_box(&local),
            world,
        }
    }

    /// Keeps of what an index found the items that overlap the box exactly:
    /// closed boxes that have a point in common.
    pub fn refine_overlapping(&self, sought: &SoughtBox, found: &mut Vec<ItemId>) {
        found.retain(|&id| self.overlaps(id, &sought.world));
    }

    /// The reference answer: an exact look at every item. Ascending ids.
    pub fn overlapping(&self, sought: &SoughtBox) -> Vec<ItemId> {
        let all = 0..self.items.len() as ItemId;
        all.filter(|&id| self.overlaps(id, &sought.world)).collect()
    }

    fn overlaps(&self, id: ItemId, by: &WorldBox) -> bool {
        let id = id as usize;
        if let Some(boxes) = self.originals.boxes() {
            let b = &boxes[id];
            return b.min.cmple(b.max).all()
                && b.min.cmple(by.max).all()
                && b.max.cmpge(by.min).all();
        }
        let b = &self.items[id];
        !b.is_empty()
            && (0..3).all(|k| {
                let origin = self.origin[k];
                side(by.max[k], origin, b.min[k]) >= 0 && side(by.min[k], origin, b.max[k]) <= 0
            })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::DVec3;

    #[test]
    fn boxes_beyond_f32_are_searched_by_what_lies_within() {
        let unit = WorldBox::new(DVec3::ZERO, DVec3::ONE);
        let scene = Scene::from_boxes("one", &[unit]).expect("a box");
        let found = |min: f64, max: f64| {
            let by = WorldBox::new(DVec3::splat(min), DVec3::splat(max));
            let sought = scene.sought_box(by);
            let found = scene.overlapping(&sought).len();
            // What the planes admit may be too much, never too little.
            assert!(scene.items.iter().filter(|b| sought.volume.sees(b)).count() >= found);
            found
        };
        assert_eq!(found(-1e300, 1e300), 1);
        // Touching, from either side, and not quite.
        assert_eq!(found(1.0, 1e300), 1);
        assert_eq!(found(-1e300, 0.0), 1);
        assert_eq!(found(1.0f64.next_up(), 1e300), 0);
        assert_eq!(found(1e299, 1e300), 0);
        assert_eq!(found(-1e300, -1e299), 0);
    }
}
