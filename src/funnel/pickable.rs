//! What is picked from: the items as solid boxes, or as triangles; who answers, and what
//! is true.

use std::rc::Rc;

use super::left_out::LeftOutRow;
use super::world::World;
use crate::kernel::Kernel;
use crate::query::ItemId;
use crate::scene::Surfaces;
use crate::visibility::pick::{BACK_ENDS, BackEnd, Facets, Pick, SolidSurfaces};
use crate::visibility::truth::{Probe, RayIndex};
use crate::visibility::{Guarantee, Ray, Solids};

/// How many of the nearest items are asked for.
pub const NEAREST: usize = 8;

/// The items as a ray meets them.
#[derive(Clone, Copy)]
pub enum Pickable<'w> {
    /// Solid boxes.
    Boxes(&'w Solids),
    /// Triangles, of which the first so many items count.
    Triangles(&'w Surfaces, usize),
}

/// A back end that was built.
pub struct Built {
    /// As in its table.
    pub name: &'static str,
    /// One line about it.
    pub summary: &'static str,
    /// What it promises.
    pub guarantee: Guarantee,
    /// Itself.
    pub pick: Rc<dyn Pick>,
}

impl<'w> Pickable<'w> {
    /// Of a world, whose items are one or the other.
    pub fn of(world: &'w World) -> Pickable<'w> {
        match (&world.solids, &world.surfaces) {
            (Some(solids), _) => Pickable::Boxes(solids),
            (None, Some(surfaces)) => Pickable::Triangles(surfaces, world.items()),
            (None, None) => unreachable!("items are boxes or triangles"),
        }
    }

    /// Every back end that can hold the items, and those that refuse them; the one that
    /// looks at each box or triangle only up to so many.
    pub fn back_ends(self, most_for_loop: usize, kernel: Kernel) -> (Vec<Built>, Vec<LeftOutRow>) {
        let count = match self {
            Pickable::Boxes(solids) => solids.boxes.len(),
            Pickable::Triangles(surfaces, _) => surfaces.triangles.len(),
        };
        let facets = match self {
            Pickable::Boxes(_) => None,
            Pickable::Triangles(surfaces, items) => Some(Facets::of(surfaces, items)),
        };
        let build = |row: &BackEnd| match (self, &facets) {
            (Pickable::Boxes(solids), _) => Some((row.build)(solids, kernel)),
            (_, Some(facets)) => Some(row.build_triangles?(facets, kernel)),
            (_, None) => None,
        };
        let (mut built, mut left_out) = (Vec::new(), Vec::new());
        let rows = BACK_ENDS
            .iter()
            .filter(|row| count <= most_for_loop || row.name != "linear");
        for row in rows {
            match build(row) {
                None => {}
                Some(Err(reason)) => left_out.push(LeftOutRow::of("picks", row.name, reason)),
                Some(Ok(pick)) => built.push(Built {
                    name: row.name,
                    summary: row.summary,
                    guarantee: row.guarantee,
                    pick: pick.into(),
                }),
            }
        }
        (built, left_out)
    }

    /// What is true of it.
    pub fn exactly(self) -> Exactly {
        match self {
            Pickable::Boxes(solids) => Exactly::Boxes(RayIndex::build(solids)),
            Pickable::Triangles(surfaces, items) => {
                Exactly::Triangles(SolidSurfaces::of(surfaces, items))
            }
        }
    }
}

/// The exact answers.
pub enum Exactly {
    /// Of solid boxes.
    Boxes(RayIndex),
    /// Of triangles.
    Triangles(SolidSurfaces),
}

impl Exactly {
    /// The first item along a ray.
    pub fn first(&self, ray: &Ray) -> Option<ItemId> {
        match self {
            Exactly::Boxes(index) => index.front_of(ray).map(|front| front.item()),
            Exactly::Triangles(all) => all.first(ray).map(|hit| hit.item),
        }
    }

    /// The nearest items along a ray, and all that are as near as the last of them.
    pub fn nearest(&self, ray: &Ray) -> Vec<ItemId> {
        let index = match self {
            Exactly::Boxes(index) => index,
            Exactly::Triangles(all) => {
                let mut hits = Vec::new();
                all.nearest(ray, NEAREST, &mut hits);
                return hits.into_iter().map(|hit| hit.item).collect();
            }
        };
        let probe = Probe::new(*ray);
        let mut met = index.all_along(ray, f64::INFINITY);
        met.sort_unstable_by(|(a, at_a), (b, at_b)| probe.compare(at_a, at_b).then(a.cmp(b)));
        if let Some((_, last)) = met.get(NEAREST - 1).copied() {
            let kept = met.partition_point(|(_, at)| probe.compare(at, &last).is_le());
            met.truncate(kept);
        }
        met.into_iter().map(|(item, _)| item).collect()
    }

    /// Every item that a ray meets.
    pub fn met(&self, ray: &Ray) -> Vec<ItemId> {
        match self {
            Exactly::Boxes(index) => {
                let along = index.all_along(ray, f64::INFINITY);
                along.into_iter().map(|(item, _)| item).collect()
            }
            Exactly::Triangles(all) => all.met(ray),
        }
    }
}
