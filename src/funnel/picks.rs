//! What is under the cursor: the first item along rays of every view, by every back end
//! of picking, held against the exact one.

use serde::{Serialize, Serializer};

use super::times::Times;
use super::world::World;
use crate::query::ItemId;
use crate::visibility::pick::{BACK_ENDS, BackEnd, Pick};
use crate::visibility::truth::RayIndex;
use crate::visibility::{Guarantee, Ray, SampleGrid, Solids};

/// Cursor places of a view.
const CURSORS: SampleGrid = SampleGrid::new(16, 9);
/// Items that the plain loop is asked about at most: it looks at each for each ray.
const MOST_FOR_LOOP: usize = 20_000;

/// A back end of picking over all views.
#[derive(Clone, Debug, Serialize)]
#[non_exhaustive]
pub struct PickRow {
    /// As in the table of back ends.
    pub name: &'static str,
    /// One line about it.
    pub summary: &'static str,
    /// What it promises.
    #[serde(serialize_with = "by_name")]
    pub guarantee: Guarantee,
    /// Rays that were asked, over all views.
    pub ray_count: usize,
    /// Of them those for which it named another item than the first, or missed it.
    pub wrong_count: usize,
    /// Thread CPU time of all rays of a view.
    #[serde(flatten)]
    pub times: Times,
    /// The same per ray.
    pub ns_per_ray: Option<f64>,
}

fn by_name<S: Serializer>(guarantee: &Guarantee, out: S) -> Result<S::Ok, S::Error> {
    out.serialize_str(guarantee.name())
}

/// Every back end that can hold the scene, and the rays of every view.
pub struct Picks {
    picks: Vec<(&'static BackEnd, Box<dyn Pick>)>,
    rays: Vec<Vec<Ray>>,
}

impl Picks {
    /// Rays of a view.
    pub const RAYS_PER_VIEW: f64 = (CURSORS.width * CURSORS.height) as f64;

    /// Builds all.
    pub fn of(world: &World, solids: &Solids) -> Picks {
        let suits = |row: &&BackEnd| row.about.name != "linear" || world.items() <= MOST_FOR_LOOP;
        let built = BACK_ENDS.iter().filter(suits);
        let picks = built.filter_map(|row| Some((row, (row.build)(solids).ok()?)));
        let of_view = |view: usize| {
            let rays = world.rays(view);
            let places =
                (0..CURSORS.height).flat_map(|row| (0..CURSORS.width).map(move |c| (c, row)));
            places
                .map(|(column, row)| rays.sample(CURSORS, column, row))
                .collect()
        };
        Picks {
            picks: picks.collect(),
            rays: (0..world.views()).map(of_view).collect(),
        }
    }

    /// How many back ends there are.
    pub fn count(&self) -> usize {
        self.picks.len()
    }

    /// The first item along each ray of a view that meets one.
    pub fn first(&self, back_end: usize, view: usize, out: &mut Vec<ItemId>) {
        let pick = &self.picks[back_end].1;
        out.extend(
            self.rays[view]
                .iter()
                .filter_map(|ray| Some(pick.first(ray)?.item)),
        );
    }

    /// Every back end against the exact answer.
    pub fn judged(&self, index: &RayIndex) -> Vec<PickRow> {
        let rays: Vec<&Ray> = self.rays.iter().flatten().collect();
        let first = |ray: &&Ray| index.front_of(ray).map(|front| front.item());
        let truth: Vec<Option<ItemId>> = rays.iter().map(first).collect();
        let rows = self.picks.iter().map(|(row, pick)| {
            let found = rays.iter().map(|ray| pick.first(ray).map(|hit| hit.item));
            PickRow {
                name: row.about.name,
                summary: row.about.summary,
                guarantee: row.about.guarantee,
                ray_count: rays.len(),
                wrong_count: found
                    .zip(&truth)
                    .filter(|(found, truth)| found != *truth)
                    .count(),
                times: Times::default(),
                ns_per_ray: None,
            }
        });
        rows.collect()
    }
}
