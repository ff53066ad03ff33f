//! What proofs are held against, and which boxes hide in a view.

use super::super::certificate::{Corners, Hiders, PlanWall, View};
use super::ground::Ground;
use super::inside::is_inside;
use super::line::{Exact, corner, dot, exact};
use crate::query::ItemId;
use crate::scene::{SurfaceKind, Surfaces, WorldBox};

/// The items as they were written.
#[derive(Clone, Copy)]
pub struct Facts<'s> {
    /// Their boxes.
    pub boxes: &'s [WorldBox],
    /// Which of them have holes; empty if none has.
    pub cut_out: &'s [bool],
    /// Their triangles, if they are no solid boxes. There may be more, of no item, behind
    /// theirs.
    pub surfaces: Option<&'s Surfaces>,
    /// The walls of a map, by ascending item, where the eye and all that is before its near
    /// plane are in the map's regions; else none.
    pub walls: &'s [PlanWall],
}

impl<'s> Facts<'s> {
    /// Solid boxes.
    pub fn of_boxes(boxes: &'s [WorldBox]) -> Facts<'s> {
        Facts {
            boxes,
            cut_out: &[],
            surfaces: None,
            walls: &[],
        }
    }

    /// Triangles, with the boxes around them.
    pub fn of_surfaces(boxes: &'s [WorldBox], surfaces: &'s Surfaces) -> Facts<'s> {
        Facts {
            surfaces: Some(surfaces),
            ..Facts::of_boxes(boxes)
        }
    }

    /// The wall that an item is.
    pub fn wall(&self, item: ItemId) -> Option<&PlanWall> {
        let place = self.walls.binary_search_by_key(&item, |wall| wall.item);
        place.ok().map(|place| &self.walls[place])
    }

    /// Whether the item has holes.
    pub fn is_cut_out(&self, item: ItemId) -> bool {
        self.cut_out.get(item as usize).copied().unwrap_or(false)
    }
}

/// The boxes that proofs may name: those of the items, then those within them.
pub struct Named<'f> {
    facts: &'f Facts<'f>,
    within: Vec<WorldBox>,
    is_within: bool,
}

impl<'f> Named<'f> {
    /// Of what is said to hide, all that does not hold is refused.
    pub fn new(
        view: &View,
        hiders: &Hiders,
        facts: &'f Facts<'f>,
    ) -> Result<Named<'f>, &'static str> {
        let mut named = Named {
            facts,
            within: Vec::new(),
            is_within: false,
        };
        let has_holes = !facts.cut_out.is_empty();
        match (hiders, facts.surfaces) {
            (Hiders::Items, None) if !has_holes => {}
            (Hiders::Uncut(_), None) if has_holes => {}
            // A few an item: however many a file names, no triangle is looked at more often.
            (Hiders::Within(boxes), _) if !is_in_order(boxes) => {
                return Err(
                    "boxes are not by ascending item, those below the ground first, or too many of one",
                );
            }
            (Hiders::Within(boxes), Some(surfaces)) => {
                named.is_within = true;
                let is_below = |b: &(Option<ItemId>, Corners)| b.0.is_none();
                let (below, within) = boxes.split_at(boxes.partition_point(is_below));
                if !below.is_empty() {
                    let ground = Ground::of(surfaces, facts.boxes.len())?;
                    if !ground.is_below(view) {
                        return Err("the view does not begin above the ground");
                    }
                    for (_, corners) in below {
                        named.within.push(under(&ground, corners)?);
                    }
                }
                for (item, corners) in within {
                    let item = item.ok_or("a box within an item is none")?;
                    let found = inner(view, facts, surfaces, item, corners)?;
                    named.within.push(found);
                }
            }
            _ => return Err("what it says that hides is not what the items are"),
        }
        Ok(named)
    }

    /// A box by its number.
    pub fn get(&self, number: ItemId) -> Option<&WorldBox> {
        let (number, items) = (number as usize, self.facts.boxes.len());
        match number.checked_sub(items) {
            None => self.facts.boxes.get(number),
            Some(place) => self.within.get(place),
        }
    }

    /// A box that hides what is behind it.
    pub fn hider(&self, number: ItemId) -> Result<&WorldBox, &'static str> {
        let found = self.get(number).ok_or("there is no such box in front")?;
        let is_of_item = (number as usize) < self.facts.boxes.len();
        match is_of_item {
            true if self.is_within => Err("the box in front is one around triangles"),
            true if self.facts.is_cut_out(number) => Err("what is in front has holes"),
            _ => Ok(found),
        }
    }
}

/// Whether boxes are by ascending item, those of none first, and few of each.
fn is_in_order(boxes: &[(Option<ItemId>, Corners)]) -> bool {
    const MOST: [usize; 2] = [16, 1024];
    let below = boxes.partition_point(|b| b.0.is_none());
    let too_many = |run: &[(Option<ItemId>, Corners)]| run[0].0 == run[MOST[0]].0;
    boxes.is_sorted_by_key(|b| b.0)
        && below <= MOST[1]
        && !boxes[below..].windows(MOST[0] + 1).any(too_many)
}

/// A box of corners in order.
fn box_of([low, high]: &Corners) -> Option<WorldBox> {
    let ordered = (0..3).all(|k| low[k].is_finite() && high[k].is_finite() && low[k] < high[k]);
    ordered.then(|| WorldBox::new((*low).into(), (*high).into()))
}

/// A box below the ground.
fn under(ground: &Ground, corners: &Corners) -> Result<WorldBox, &'static str> {
    let found = box_of(corners).filter(|b| ground.holds(b));
    found.ok_or("a box is not below the ground")
}

/// A box inside a closed surface that begins beyond where boxes hide from. Whatever ray
/// of the view enters the box has entered the surface before, through a triangle that it
/// is in front of: so the box hides no more than the surface does.
fn inner(
    view: &View,
    facts: &Facts,
    surfaces: &Surfaces,
    item: ItemId,
    corners: &Corners,
) -> Result<WorldBox, &'static str> {
    let own = facts.boxes.get(item as usize);
    let own = own.filter(|_| (item as usize) < surfaces.items());
    let (own, b) = own
        .zip(box_of(corners))
        .ok_or("a box within an item is none")?;
    if surfaces.kinds[item as usize] != SurfaceKind::Opaque {
        return Err("a box is within an item that does not hide");
    }
    let (eye, forward) = (exact(view.eye), exact(view.forward));
    let is_deep = |k: u8| {
        let point = exact(corner(own, k));
        let from_eye = [0, 1, 2].map(|k: usize| &point[k] - &eye[k]);
        (&dot(&from_eye, &forward) - &Exact::from(view.hides_from)).sign() >= 0
    };
    if !(0..8).all(is_deep) {
        return Err("a box is within an item that reaches before the near plane");
    }
    match is_inside(surfaces, item as usize, own, &b) {
        true => Ok(b),
        false => Err("a box is not inside the triangles of its item"),
    }
}
