//! What is true of picking by triangles, as [`Facets`](super::Facets) says: by the tree of
//! the truth of samples, which shares nothing with the back ends but the exact test.

use super::contract::{Hit, Pick};
use super::exactly;
use crate::query::ItemId;
use crate::scene::{SurfaceKind, Surfaces};
use crate::visibility::Ray;
use crate::visibility::truth::{Meeting, SurfaceIndex, TriangleProbe};
use glam::DVec3;

/// The triangles of a scene with every item solid: the exact answers.
pub struct SolidSurfaces {
    index: SurfaceIndex,
    origin: DVec3,
    items: usize,
}

impl SolidSurfaces {
    /// Of which the first so many items count.
    pub fn of(surfaces: &Surfaces, items: usize) -> SolidSurfaces {
        let mut solid = surfaces.clone();
        solid.kinds.fill(SurfaceKind::Opaque);
        SolidSurfaces {
            index: SurfaceIndex::build(&solid),
            origin: surfaces.origin,
            items,
        }
    }

    /// Every item that the ray meets, ascending.
    pub fn met(&self, ray: &Ray) -> Vec<ItemId> {
        let mut met: Vec<ItemId> = self.along(ray).map(|(item, _)| item).collect();
        met.sort_unstable();
        met.dedup();
        met
    }

    fn along(&self, ray: &Ray) -> impl Iterator<Item = (ItemId, Meeting)> {
        let all = self.index.all_along(ray).into_iter();
        all.filter(|(item, _)| (*item as usize) < self.items)
    }
}

impl Pick for SolidSurfaces {
    fn first(&self, ray: &Ray) -> Option<Hit> {
        let found = self.index.front_of(ray);
        let item = *found.front.first()?;
        let depth = found.meeting?.depth;
        Hit { item, depth }.counted(self.items)
    }

    fn nearest(&self, ray: &Ray, count: usize, hits: &mut Vec<Hit>) {
        let probe = TriangleProbe::new(*ray, self.origin);
        exactly::nearest_meetings(&probe, self.along(ray).collect(), count, hits);
    }
}
