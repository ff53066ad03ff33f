//! What is under the cursor: the first item along rays of every view, the nearest few, by
//! every back end of picking; and everything through the cursor's own frustum, by every
//! structure of the object stage. All held against the exact answer.

use std::rc::Rc;

use serde::{Serialize, Serializer};

use super::left_out::LeftOutRow;
use super::pickable::{Built, Exactly, NEAREST, Pickable};
use super::stage::by_name;
use super::times::Times;
use super::world::World;
use crate::camera::Surroundings;
use crate::index::{DynIndex, caught};
use crate::query::ItemId;
use crate::visibility::pick::{CursorRectangle, Hit, NotBuilt, Pick};
use crate::visibility::{Guarantee, Ray, Rays, SampleGrid};

/// Cursor places of a view.
const CURSORS: SampleGrid = SampleGrid::new(16, 9);
/// Items of which every one is looked at for each ray, or each cursor's frustum, at most.
const MOST_FOR_LOOP: usize = 20_000;
/// The cursor's frustum reaches so many pixels to each side.
const REACH: f64 = 4.0;

named! {
    /// What is asked at a cursor.
    #[derive(Clone, Copy, PartialEq, Eq, Hash, Debug)]
    #[non_exhaustive]
    pub enum PickQuestion {
        /// The first item along the ray.
        First = "first item",
        /// The nearest few along the ray, and what is as near as the last of them.
        Nearest = "nearest 8",
        /// Every item in the frustum of a small rectangle about the cursor.
        Through = "all within 4 pixels",
    }
}

impl Serialize for PickQuestion {
    fn serialize<S: Serializer>(&self, out: S) -> Result<S::Ok, S::Error> {
        out.serialize_str(self.name())
    }
}

/// A back end of picking over all views.
#[derive(Clone, Debug, Serialize)]
#[non_exhaustive]
pub struct PickRow {
    /// What is asked.
    pub question: PickQuestion,
    /// As in the table of back ends, or the structure.
    pub name: String,
    /// One line about it.
    pub summary: &'static str,
    /// What it promises.
    #[serde(serialize_with = "by_name")]
    pub guarantee: Guarantee,
    /// Cursor places that were asked about, over all views.
    pub ray_count: usize,
    /// Of them those for which the answer was not the exact one.
    pub wrong_count: usize,
    /// Thread CPU time of all places of a view.
    #[serde(flatten)]
    pub times: Times,
    /// The same per place.
    pub ns_per_ray: Option<f64>,
}

/// What answers a question.
enum By<'w> {
    First(Rc<dyn Pick>),
    Nearest(Rc<dyn Pick>),
    Through(&'w dyn DynIndex),
}

impl By<'_> {
    fn question(&self) -> PickQuestion {
        match self {
            By::First(_) => PickQuestion::First,
            By::Nearest(_) => PickQuestion::Nearest,
            By::Through(_) => PickQuestion::Through,
        }
    }
}

/// A question with what answers it.
struct Picker<'w> {
    name: String,
    summary: &'static str,
    guarantee: Guarantee,
    by: By<'w>,
}

/// A cursor: its ray and its rectangle of the image.
struct Cursor {
    ray: Ray,
    rectangle: CursorRectangle,
}

/// The cursors of a view, and the rays of its whole image.
struct Cursors {
    rays: Rays,
    places: Vec<Cursor>,
}

/// Everything that answers, and the cursors of every view.
pub struct Picks<'w> {
    world: &'w World<'w>,
    around: Surroundings,
    pickable: Pickable<'w>,
    pickers: Vec<Picker<'w>>,
    cursors: Vec<Cursors>,
    /// Back ends that refuse the scene.
    pub left_out: Vec<LeftOutRow>,
}

impl<'w> Picks<'w> {
    /// Cursor places of a view.
    pub const RAYS_PER_VIEW: f64 = (CURSORS.width * CURSORS.height) as f64;

    /// Builds every back end that can hold the scene.
    pub fn of(world: &'w World<'w>) -> Picks<'w> {
        let suits = |name: &str| name != "linear" || world.items() <= MOST_FOR_LOOP;
        let pickable = Pickable::of(world);
        let views = 0..world.views();
        let cursors: Vec<Cursors> = views.map(|view| Cursors::of(world, view)).collect();
        let (mut built, mut left_out) = pickable.back_ends(MOST_FOR_LOOP, world.kernel);
        built.retain(|back_end| {
            let refused = answers(back_end, &cursors).err();
            let row = |reason| LeftOutRow::of("picks", back_end.name, reason);
            let is_there = refused.is_none();
            left_out.extend(refused.map(row));
            is_there
        });
        let by_rays = |ask: fn(Rc<dyn Pick>) -> By<'w>| {
            let pickers = built.iter().map(move |back_end| Picker {
                name: back_end.name.to_owned(),
                summary: back_end.summary,
                guarantee: back_end.guarantee,
                by: ask(back_end.pick.clone()),
            });
            pickers.collect::<Vec<_>>()
        };
        let structures = world.structures().filter(|(label, _)| suits(label));
        let through = structures.map(|(label, index)| Picker {
            name: label.to_owned(),
            summary: "the six-plane test of the cursor's frustum by a structure",
            guarantee: Guarantee::Conservative,
            by: By::Through(index),
        });
        let pickers = by_rays(By::First).into_iter().chain(by_rays(By::Nearest));
        Picks {
            world,
            around: world.scene.surroundings(),
            pickable,
            left_out,
            pickers: pickers.chain(through).collect(),
            cursors,
        }
    }

    /// How many rows there are.
    pub fn count(&self) -> usize {
        self.pickers.len()
    }

    /// The answers at all cursors of a view, one after the other.
    pub fn ask(&self, picker: usize, view: usize, out: &mut Vec<ItemId>) {
        let by = &self.pickers[picker].by;
        let Cursors { rays, places } = &self.cursors[view];
        let mut hits = Vec::new();
        for cursor in places {
            self.answer(by, rays, cursor, &mut hits, out);
        }
    }

    /// Appends the answer at a cursor.
    fn answer(
        &self,
        by: &By,
        rays: &Rays,
        cursor: &Cursor,
        hits: &mut Vec<Hit>,
        out: &mut Vec<ItemId>,
    ) {
        match by {
            By::First(pick) => out.extend(pick.first(&cursor.ray).map(|hit| hit.item)),
            By::Nearest(pick) => {
                pick.nearest(&cursor.ray, NEAREST, hits);
                out.extend(hits.iter().map(|hit| hit.item));
            }
            // A rectangle that f64 cannot tell from a point holds nothing.
            By::Through(index) => {
                if let Ok(volume) = cursor.rectangle.volume(rays, &self.around) {
                    index.visible(&volume, out);
                }
            }
        }
    }

    /// Every row against the exact answer.
    pub fn judged(&self) -> Vec<PickRow> {
        let exactly = self.pickable.exactly();
        let rows = self.pickers.iter().map(|picker| PickRow {
            question: picker.by.question(),
            name: picker.name.clone(),
            summary: picker.summary,
            guarantee: picker.guarantee,
            ray_count: 0,
            wrong_count: 0,
            times: Times::default(),
            ns_per_ray: None,
        });
        let mut rows: Vec<PickRow> = rows.collect();
        let (mut hits, mut answer) = (Vec::new(), Vec::new());
        for Cursors { rays, places } in &self.cursors {
            for cursor in places {
                let truth = self.truth(&exactly, rays, cursor);
                for (row, picker) in rows.iter_mut().zip(&self.pickers) {
                    answer.clear();
                    self.answer(&picker.by, rays, cursor, &mut hits, &mut answer);
                    row.ray_count += 1;
                    row.wrong_count += usize::from(!truth.agrees(row.question, &mut answer));
                }
            }
        }
        rows
    }

    fn truth(&self, exactly: &Exactly, rays: &Rays, cursor: &Cursor) -> Truth {
        let volume = cursor.rectangle.volume(rays, &self.around).ok();
        let items = &self.world.scene.items;
        let volume = volume.filter(|_| items.len() <= MOST_FOR_LOOP);
        let in_planes = volume.map(|volume| {
            let ids = (0..).zip(items);
            ids.filter(|(_, b)| volume.sees(b))
                .map(|(id, _)| id)
                .collect()
        });
        Truth {
            first: exactly.first(&cursor.ray).into_iter().collect(),
            nearest: exactly.nearest(&cursor.ray, NEAREST),
            met: met_within(exactly, rays, &cursor.rectangle),
            in_planes,
        }
    }
}

/// Has code of others answer at every cursor once, so that a panic is known before any row.
fn answers(back_end: &Built, cursors: &[Cursors]) -> Result<(), NotBuilt> {
    if back_end.guarantee != Guarantee::Unproven {
        return Ok(());
    }
    let (name, mut hits) = (back_end.name, Vec::new());
    let ask = || {
        for cursor in cursors.iter().flat_map(|of_view| &of_view.places) {
            back_end.pick.first(&cursor.ray);
            back_end.pick.nearest(&cursor.ray, NEAREST, &mut hits);
        }
    };
    caught(ask).map_err(|message| NotBuilt::Panicked { name, message })
}

impl Cursors {
    fn of(world: &World, view: usize) -> Cursors {
        let rays = *world.rays(view);
        let grid = world.samples;
        let size = [grid.width, grid.height].map(f64::from);
        let rows = 0..CURSORS.height;
        let places = rows.flat_map(|row| (0..CURSORS.width).map(move |column| (column, row)));
        let cursor = |(column, row): (u32, u32)| {
            let part = |index: u32, of: u32| (f64::from(index) + 0.5) / f64::from(of);
            let (x, y) = (part(column, CURSORS.width), part(row, CURSORS.height));
            Cursor {
                ray: rays.through(x, y),
                rectangle: CursorRectangle::around([x * size[0], y * size[1]], REACH, size),
            }
        };
        Cursors {
            rays,
            places: places.map(cursor).collect(),
        }
    }
}

/// What is true at a cursor.
struct Truth {
    first: Vec<ItemId>,
    /// In the order of depth, then of ids.
    nearest: Vec<ItemId>,
    /// Items that some rays through the rectangle meet, ascending: none may be missing.
    met: Vec<ItemId>,
    /// What no plane of the rectangle's frustum excludes, ascending; `None` where there
    /// are too many items to look at each.
    in_planes: Option<Vec<ItemId>>,
}

impl Truth {
    /// Whether an answer is the exact one; a set is put in order.
    fn agrees(&self, question: PickQuestion, answer: &mut [ItemId]) -> bool {
        match question {
            PickQuestion::First => *answer == self.first[..],
            PickQuestion::Nearest => *answer == self.nearest[..],
            PickQuestion::Through => {
                answer.sort_unstable();
                let has = |item: &ItemId| answer.binary_search(item).is_ok();
                let same = self.in_planes.as_ref().is_none_or(|all| *answer == all[..]);
                same && self.met.iter().all(has)
            }
        }
    }
}

/// Every item that the rays through corners, edges and middle of a rectangle meet.
fn met_within(exactly: &Exactly, rays: &Rays, rectangle: &CursorRectangle) -> Vec<ItemId> {
    let CursorRectangle { min, max } = rectangle;
    let middle = [0, 1].map(|axis| (min[axis] + max[axis]) / 2.0);
    let mut met = Vec::new();
    for x in [min[0], middle[0], max[0]] {
        for y in [min[1], middle[1], max[1]] {
            met.extend(exactly.nearest(&rays.through(x, y), usize::MAX));
        }
    }
    met.sort_unstable();
    met.dedup();
    met
}

#[cfg(test)]
mod tests {
    use super::*;

    /// An answer that lacks one item, has one too many or another order is wrong.
    #[test]
    fn answers_are_held_against_the_exact_ones() {
        let truth = Truth {
            first: vec![4],
            nearest: vec![4, 2, 9],
            met: vec![2, 4],
            in_planes: Some(vec![2, 4, 9]),
        };
        let agrees = |question, answer: &[ItemId]| truth.agrees(question, &mut answer.to_vec());
        assert!(agrees(PickQuestion::First, &[4]));
        assert!(!agrees(PickQuestion::First, &[2]) && !agrees(PickQuestion::First, &[]));
        assert!(agrees(PickQuestion::Nearest, &[4, 2, 9]));
        assert!(!agrees(PickQuestion::Nearest, &[2, 4, 9]));
        assert!(!agrees(PickQuestion::Nearest, &[4, 2]));
        assert!(agrees(PickQuestion::Through, &[9, 4, 2]));
        assert!(!agrees(PickQuestion::Through, &[4, 2]));
        let large = Truth {
            in_planes: None,
            ..truth
        };
        let through = |answer: &[ItemId]| large.agrees(PickQuestion::Through, &mut answer.to_vec());
        assert!(through(&[9, 4, 2, 7]) && through(&[4, 2]) && !through(&[4]));
    }
}
