//! Region search made exact: a point as it was written, as indexes are asked for
//! it, and the second look at what they find.

use glam::{DVec3, Vec3};

use super::originals::Originals;
use super::side::side;
use super::{Regions, Scene};
use crate::query::ItemId;

/// A point to search for: as it was written, and as indexes are asked.
///
/// Rounding to nearest loses no box: a bound is an f32 number, and what lies
/// beyond it is rounded beyond it or onto it. It can only find too many.
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct Sought {
    /// World coordinates, in f64.
    pub world: DVec3,
    /// Scene coordinates, rounded to the nearest f32.
    pub local: Vec3,
}

impl Scene {
    /// A point of the world as this scene's indexes are asked for it. A planar
    /// BSP ignores the height.
    #[inline]
    pub fn sought(&self, world: DVec3) -> Sought {
        let mut local = (world - self.origin).as_vec3();
        if let Regions::Bsp(_) = self.regions {
            local.z = 0.0;
        }
        Sought { world, local }
    }

    /// Region search: `ask` appends what an index finds, and left is what holds the
    /// point exactly.
    #[inline]
    pub fn search(
        &self,
        p: &Sought,
        out: &mut Vec<ItemId>,
        ask: impl FnOnce(Vec3, &mut Vec<ItemId>),
    ) {
        let first = out.len();
        ask(p.local, out);
        self.refine(p, out, first);
    }

    /// Whether what an index finds for a point must still be looked at by
    /// [`Scene::refine`].
    pub fn is_refined(&self, p: &Sought) -> bool {
        match &self.regions {
            Regions::Bsp(_) => true,
            regions => {
                let is_rounded = |k| side(p.world[k], self.origin[k], p.local[k]) != 0;
                self.originals_of(regions).boxes().is_some() || (0..3).any(is_rounded)
            }
        }
    }

    /// Keeps of the boxes that an index found, those from `first` on, the regions that
    /// hold the point exactly.
    #[inline]
    pub fn refine(&self, p: &Sought, found: &mut Vec<ItemId>, first: usize) {
        if found.len() > first && self.is_refined(p) {
            self.keep_holding(p, found, first);
        }
    }

    fn keep_holding(&self, p: &Sought, found: &mut Vec<ItemId>, first: usize) {
        match &self.regions {
            Regions::Bsp(bsp) => {
                let at = (p.world - self.origin).truncate();
                let covers = bsp.covers(at);
                retain_from(first, found, |region| covers && bsp.holds(region, at));
            }
            _ => retain_from(first, found, |id| self.holds(id, p.world)),
        }
    }

    /// Whether a region that is a box holds a point of the world, exactly.
    fn holds(&self, id: ItemId, p: DVec3) -> bool {
        let id = id as usize;
        if let Some(boxes) = self.originals_of(&self.regions).boxes() {
            return p.cmpge(boxes[id].min).all() && p.cmple(boxes[id].max).all();
        }
        let b = &self.regions.boxes(&self.items)[id];
        (0..3).all(|k| {
            let origin = self.origin[k];
            side(p[k], origin, b.min[k]) >= 0 && side(p[k], origin, b.max[k]) <= 0
        })
    }

    /// The reference answer, by the simplest method: the map's own
    /// descent, or an exact look at every box. Ascending ids.
    pub fn holding(&self, p: &Sought) -> Vec<ItemId> {
        if let Regions::Bsp(bsp) = &self.regions {
            let at = (p.world - self.origin).truncate();
            return bsp.descend(at).into_iter().collect();
        }
        let count = self.regions.boxes(&self.items).len() as ItemId;
        (0..count).filter(|&id| self.holds(id, p.world)).collect()
    }

    fn originals_of<'a>(&'a self, regions: &'a Regions) -> &'a Originals {
        match regions {
            Regions::Tiling(tiling) => &tiling.originals,
            _ => &self.originals,
        }
    }
}

/// `Vec::retain` of the ids from `first` on.
fn retain_from(first: usize, ids: &mut Vec<ItemId>, keep: impl Fn(ItemId) -> bool) {
    let mut kept = first;
    for at in first..ids.len() {
        let id = ids[at];
        if keep(id) {
            ids[kept] = id;
            kept += 1;
        }
    }
    ids.truncate(kept);
}
