//! Items as rays pick them, solid boxes or triangles: the back ends and the truth.

use std::rc::Rc;

use super::left_out::LeftOutRow;
use super::world::World;
use crate::kernel::Kernel;
use crate::query::ItemId;
use crate::scene::Surfaces;
use crate::visibility::pick::{BACK_ENDS, BackEnd, NotBuilt, Pick};
use crate::visibility::truth::{Boxes, Facets, RayIndex, SurfaceIndex};
use crate::visibility::{Guarantee, Ray, Solids};

/// Number of nearest items of a query.
pub const NEAREST: usize = 8;

/// The items as a ray meets them.
#[derive(Clone, Copy)]
pub enum Pickable<'w> {
    /// Solid boxes.
    Boxes(&'w Solids),
    /// Triangles, and how many of their first items count.
    Triangles(&'w Surfaces, usize),
}

/// A back end that was built.
pub struct Built {
    /// Name in the table of back ends.
    pub name: &'static str,
    /// One line about it.
    pub summary: &'static str,
    /// Guarantee of its answers.
    pub guarantee: Guarantee,
    /// Itself.
    pub pick: Rc<dyn Pick>,
}

impl<'w> Pickable<'w> {
    /// The items of a world.
    pub fn of(world: &'w World) -> Pickable<'w> {
        match (&world.solids, &world.surfaces) {
            (Some(solids), _) => Pickable::Boxes(solids),
            (None, Some(surfaces)) => Pickable::Triangles(surfaces, world.items()),
            (None, None) => unreachable!("items are boxes or triangles"),
        }
    }

    /// Every back end that can hold the items, and those that refuse them.
    ///
    /// The plain loop is built over at most `most_for_loop` boxes or triangles.
    pub fn back_ends(self, most_for_loop: usize, kernel: Kernel) -> (Vec<Built>, Vec<LeftOutRow>) {
        let count = match self {
            Pickable::Boxes(solids) => solids.boxes.len(),
            Pickable::Triangles(surfaces, _) => surfaces.triangles.len(),
        };
        type Build<'b> = Box<dyn Fn(&BackEnd) -> Result<Box<dyn Pick>, NotBuilt> + 'b>;
        let build: Build = match self {
            Pickable::Boxes(solids) => {
                let boxes = Boxes::of(solids);
                Box::new(move |row| (row.boxes)(&boxes, kernel))
            }
            Pickable::Triangles(surfaces, items) => {
                let facets = Facets::solid(surfaces, items);
                Box::new(move |row| (row.facets)(&facets, kernel))
            }
        };
        let (mut built, mut left_out) = (Vec::new(), Vec::new());
        let rows = BACK_ENDS
            .iter()
            .filter(|row| count <= most_for_loop || row.name != "linear");
        for row in rows {
            match build(row) {
                Err(reason) => left_out.push(LeftOutRow::of("picks", row.name, reason)),
                Ok(pick) => built.push(Built {
                    name: row.name,
                    summary: row.summary,
                    guarantee: row.guarantee,
                    pick: pick.into(),
                }),
            }
        }
        (built, left_out)
    }

    /// The exact answers.
    pub fn exactly(self) -> Exactly {
        Exactly(match self {
            Pickable::Boxes(solids) => Box::new(RayIndex::build(solids)),
            Pickable::Triangles(surfaces, items) => {
                Box::new(SurfaceIndex::of(&Facets::solid(surfaces, items)))
            }
        })
    }
}

/// The exact answers.
pub struct Exactly(Box<dyn Pick>);

impl Exactly {
    /// The first item along a ray.
    pub fn first(&self, ray: &Ray) -> Option<ItemId> {
        self.0.first(ray).map(|hit| hit.item)
    }

    /// The nearest `count` items along a ray, and all as near as the last of them.
    pub fn nearest(&self, ray: &Ray, count: usize) -> Vec<ItemId> {
        let mut hits = Vec::new();
        self.0.nearest(ray, count, &mut hits);
        hits.into_iter().map(|hit| hit.item).collect()
    }
}
