//! Picking at the cursors of every view.
//!
//! Every back end finds the first item along rays; every structure of the object stage finds
//! everything in the frustum of a cursor. All answers are compared with the exact ones.

use serde::Serialize;

use super::error::LeftOutRow;
use super::setup::{Setup, Shape};
use super::task::{FunnelKey, KeyedTask, PickQuestion};
use crate::camera::Surroundings;
use crate::geometry::ConvexVolume;
use crate::index::Kind;
use crate::measure::QueryFn;
use crate::query::{ItemId, distinct};
use crate::shown::{count, counted};
use crate::statistics::{Estimate, flat};
use crate::visibility::pick::{CursorRectangle, PickTruth};
use crate::visibility::truth::{Bodies, Body, Boxes, Facets, RayIndex, SurfaceIndex};
use crate::visibility::{Guarantee, Ray, Rays, SampleGrid};

/// Grid of cursors of a view.
const CURSORS: SampleGrid = SampleGrid::new(16, 9);
/// Most bodies for linear search, per ray or per cursor's frustum.
const MOST_FOR_LOOP: usize = 20_000;
/// Half width of a cursor's frustum, pixels.
const REACH: f64 = 4.0;

/// Results of one picking back end over all views.
#[derive(Clone, Default, Debug, Serialize)]
pub struct PickRow {
    /// Question that the back end answers.
    pub question: PickQuestion,
    /// Name of the back end in its table, or label of the structure.
    pub name: String,
    /// One-line description.
    pub summary: &'static str,
    /// Declared guarantee of its answers.
    pub guarantee: Guarantee,
    /// Number of cursors in all views.
    pub ray_count: usize,
    /// Number of cursors with a wrong answer.
    pub wrong_count: usize,
    /// Thread CPU time per view, for all cursors.
    #[serde(flatten, serialize_with = "flat::stage_ns")]
    pub time: Option<Estimate>,
    /// Thread CPU time per cursor.
    pub ns_per_ray: Option<f64>,
}

impl PickRow {
    pub(super) fn key(&self) -> FunnelKey {
        FunnelKey::Pick(self.question, self.name.clone())
    }

    pub(super) fn set(&mut self, time: Option<Estimate>) {
        self.time = time;
        self.ns_per_ray = time.map(|time| time.value / CURSORS.samples() as f64);
    }
}

/// Appends the answer at a cursor of a view.
type PickAnswer<'w> = Box<dyn Fn(&Cursor, &mut Vec<ItemId>) + 'w>;

/// A cursor: its ray, and a small rectangle of the image around it.
struct Cursor {
    ray: Ray,
    rectangle: CursorRectangle,
    /// Frustum of the rectangle.
    ///
    /// `None` if f64 cannot distinguish the rectangle from a point, which contains nothing.
    volume: Option<ConvexVolume>,
}

/// Every back end with its row, and the cursors of every view.
pub struct Picks<'w> {
    setup: &'w Setup<'w>,
    pickers: Vec<(PickRow, PickAnswer<'w>)>,
    cursors: Vec<Vec<Cursor>>,
    /// Linear searches left out because they have too many bodies.
    pub left_out: Vec<LeftOutRow>,
}

impl<'w> Picks<'w> {
    /// Builds all back ends, except linear searches over too many bodies.
    pub fn new(setup: &'w Setup<'w>) -> Picks<'w> {
        let around = setup.scene.surroundings();
        let of_view = |view| cursors(setup.rays(view), setup.samples, &around);
        let mut picks = Picks {
            setup,
            pickers: Vec::new(),
            cursors: setup.views().map(of_view).collect(),
            left_out: Vec::new(),
        };
        match &setup.shape {
            Shape::Boxes(solids) => picks.add_rays(&Boxes::of(solids), "item"),
            Shape::Triangles(surfaces) => {
                let facets = Facets::solid(surfaces, setup.items());
                picks.add_rays(&facets, "triangle");
            }
        }
        picks.add_frusta();
        picks
    }

    /// Adds the ray back ends.
    fn add_rays<B: Body>(&mut self, all: &Bodies<B>, one: &str) {
        let bodies = all.all.len();
        for row in Bodies::<B>::BACK_ENDS {
            if row.name == "linear" && bodies > MOST_FOR_LOOP {
                self.leave_out(row.name, bodies, one, "for each ray");
                continue;
            }
            let pick = (row.build)(all, self.setup.kernel);
            let first: PickAnswer =
                Box::new(move |cursor, out| out.extend(pick.first(&cursor.ray)));
            let declared = PickRow {
                question: PickQuestion::First,
                name: row.name.to_owned(),
                summary: row.summary,
                guarantee: row.guarantee,
                ..PickRow::default()
            };
            self.pickers.push((declared, first));
        }
    }

    /// Adds the structures of the object stage, queried with the cursors' frusta.
    fn add_frusta(&mut self) {
        let setup = self.setup;
        for (spec, index) in &setup.structures {
            let is_loop = spec.row.info.kind == Kind::Scan;
            if is_loop && setup.items() > MOST_FOR_LOOP {
                let when = "for each cursor's frustum";
                self.leave_out(&spec.label, setup.items(), "item", when);
                continue;
            }
            let through: PickAnswer = Box::new(move |cursor, out| {
                if let Some(volume) = &cursor.volume {
                    index.visible(volume, out);
                }
            });
            let declared = PickRow {
                question: PickQuestion::Through,
                name: spec.label.clone(),
                summary: "the six-plane test of the cursor's frustum by a structure",
                guarantee: Guarantee::Conservative,
                ..PickRow::default()
            };
            self.pickers.push((declared, through));
        }
    }

    /// Leaves out a linear search over too many bodies.
    fn leave_out(&mut self, name: &str, bodies: usize, one: &str, when: &str) {
        let (found, most) = (counted(bodies, one), count(MOST_FOR_LOOP));
        let reason = format!("{found} to test {when}; expected at most {most}");
        self.left_out.push(LeftOutRow::new("picks", name, reason));
    }

    /// Tasks of all rows; a task answers all cursors of a view in turn.
    pub fn tasks(&self) -> impl Iterator<Item = KeyedTask<'_>> {
        self.pickers.iter().map(move |(row, answer)| {
            let ask: QueryFn = Box::new(move |view, out| {
                for cursor in &self.cursors[view] {
                    answer(cursor, out);
                }
            });
            (row.key(), ask)
        })
    }

    /// Compares all rows with the exact answers.
    ///
    /// The exact answers come from the tree that wide-ray searches too; in small enough scenes,
    /// linear, which shares nothing with that tree, is compared as well.
    pub fn compared(&self) -> Vec<PickRow> {
        let exact: Box<dyn PickTruth> = match &self.setup.shape {
            Shape::Boxes(solids) => Box::new(RayIndex::build(solids)),
            Shape::Triangles(surfaces) => {
                let facets = Facets::solid(surfaces, self.setup.items());
                Box::new(SurfaceIndex::of(&facets, self.setup.kernel))
            }
        };
        let mut rows: Vec<PickRow> = self.pickers.iter().map(|(row, _)| row.clone()).collect();
        let mut found = Vec::new();
        for (cursors, view) in self.cursors.iter().zip(self.setup.views()) {
            let rays = self.setup.rays(view);
            for cursor in cursors {
                let truth = self.truth(&*exact, rays, cursor);
                for (row, (_, answer)) in rows.iter_mut().zip(&self.pickers) {
                    found.clear();
                    answer(cursor, &mut found);
                    row.ray_count += 1;
                    row.wrong_count += usize::from(!truth.agrees(row.question, &mut found));
                }
            }
        }
        rows
    }

    fn truth(&self, exact: &dyn PickTruth, rays: &Rays, cursor: &Cursor) -> CursorTruth {
        let scene = self.setup.scene;
        let is_small = scene.items.len() <= MOST_FOR_LOOP;
        let in_planes = cursor.volume.as_ref().filter(|_| is_small).map(|volume| {
            let ids = (0..).zip(&scene.items).filter(|(_, b)| volume.sees(b));
            ids.map(|(id, _)| id).collect()
        });
        CursorTruth {
            first: exact.first(&cursor.ray),
            met: met_within(exact, rays, &cursor.rectangle),
            in_planes,
        }
    }
}

/// Cursors at the cell centres of a grid over the image.
fn cursors(rays: &Rays, image: SampleGrid, around: &Surroundings) -> Vec<Cursor> {
    let size = [image.width, image.height].map(f64::from);
    let cursor = |[x, y]: [f64; 2]| {
        let rectangle = CursorRectangle::around([x * size[0], y * size[1]], REACH, size);
        Cursor {
            ray: rays.through(x, y),
            rectangle,
            volume: rectangle.volume(rays, around).ok(),
        }
    };
    CURSORS.centres().map(cursor).collect()
}

/// Exact answers at a cursor.
struct CursorTruth {
    first: Option<ItemId>,
    /// Items met by sample rays through the rectangle, ascending: a lower bound.
    met: Vec<ItemId>,
    /// Items that no plane of the rectangle's frustum excludes, ascending.
    ///
    /// `None` if there are too many items to test each.
    in_planes: Option<Vec<ItemId>>,
}

impl CursorTruth {
    /// Returns `true` if an answer is exact; sorts an answer that is a set.
    fn agrees(&self, question: PickQuestion, answer: &mut [ItemId]) -> bool {
        match question {
            PickQuestion::First => *answer == *self.first.as_slice(),
            PickQuestion::Through => {
                answer.sort_unstable();
                let has = |item: &ItemId| answer.binary_search(item).is_ok();
                let same = self.in_planes.as_ref().is_none_or(|all| *answer == all[..]);
                same && self.met.iter().all(has)
            }
        }
    }
}

/// Items met by rays through corners, edge midpoints and centre of a rectangle.
fn met_within(exact: &dyn PickTruth, rays: &Rays, rectangle: &CursorRectangle) -> Vec<ItemId> {
    let CursorRectangle { min, max } = rectangle;
    let middle = [0, 1].map(|axis| (min[axis] + max[axis]) / 2.0);
    let mut met = Vec::new();
    for x in [min[0], middle[0], max[0]] {
        for y in [min[1], middle[1], max[1]] {
            met.extend(exact.met(&rays.through(x, y)));
        }
    }
    distinct(met)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A missing item, an extra item or a different order makes an answer wrong.
    #[test]
    fn answers_are_held_against_the_exact_ones() {
        let truth = CursorTruth {
            first: Some(4),
            met: vec![2, 4],
            in_planes: Some(vec![2, 4, 9]),
        };
        let agrees = |question, answer: &[ItemId]| truth.agrees(question, &mut answer.to_vec());
        assert!(agrees(PickQuestion::First, &[4]));
        assert!(!agrees(PickQuestion::First, &[2]) && !agrees(PickQuestion::First, &[]));
        assert!(agrees(PickQuestion::Through, &[9, 4, 2]));
        assert!(!agrees(PickQuestion::Through, &[4, 2]));
        let large = CursorTruth {
            in_planes: None,
            ..truth
        };
        let through = |answer: &[ItemId]| large.agrees(PickQuestion::Through, &mut answer.to_vec());
        assert!(through(&[9, 4, 2, 7]) && through(&[4, 2]) && !through(&[4]));
    }
}
