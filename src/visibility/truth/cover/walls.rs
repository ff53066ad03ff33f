//! The search for walls of a map that stand before an item: the nearest ones from the
//! eye, way after way. Rounded; what it finds is decided by `check`.

use std::f64::consts::PI;

use glam::DVec2;

use super::super::certificate::{PlanWall, View};
use super::super::check::{Facts, covers};
use crate::query::ItemId;
use crate::scene::WorldBox;

/// Most walls before an item.
const MOST_WALLS: usize = 64;

/// How far beyond a corner it is looked which wall is the nearest, radians.
const BEYOND: f64 = 1e-7;

/// A wall as far as it can be seen from the eye, between two ways.
struct Seen {
    ways: [f64; 2],
    from: DVec2,
    along: DVec2,
    item: ItemId,
}

impl Seen {
    /// How far the eye is from it along a way.
    fn distance(&self, way: f64) -> f64 {
        let way = DVec2::from_angle(way);
        self.from.perp_dot(self.along) / way.perp_dot(self.along)
    }

    fn is_met(&self, way: f64) -> bool {
        self.ways[0] <= way && way < self.ways[1]
    }
}

/// The solid walls before an item, if it is behind such; one after the other.
pub fn before(
    view: &View,
    boxes: &[WorldBox],
    walls: &[PlanWall],
    item: ItemId,
) -> Option<Vec<ItemId>> {
    if view.parallel || walls.is_empty() {
        return None;
    }
    let facts = Facts {
        walls,
        ..Facts::of_boxes(boxes)
    };
    let eye = DVec2::new(view.eye[0], view.eye[1]);
    let own = &boxes[item as usize];
    let corners = match facts.wall(item) {
        Some(wall) => wall.ends.map(DVec2::from).to_vec(),
        None => {
            let (low, high) = (own.min.truncate(), own.max.truncate());
            vec![
                low,
                high,
                DVec2::new(low.x, high.y),
                DVec2::new(high.x, low.y),
            ]
        }
    };
    let middle = corners.iter().sum::<DVec2>() / corners.len() as f64 - eye;
    // Ways are angles from the one to the item's middle.
    let way = |p: DVec2| middle.angle_to(p - eye);
    let ways = corners.iter().map(|p| way(*p));
    let first = ways.clone().fold(PI, f64::min);
    let last = ways.fold(-PI, f64::max);
    let mut seen = Vec::new();
    for wall in walls.iter().filter(|w| w.is_solid && w.item != item) {
        let [a, b] = wall.ends.map(DVec2::from);
        let turn = (a - eye).perp_dot(b - eye);
        let [a, b] = if turn < 0.0 { [b, a] } else { [a, b] };
        let [from, to] = [way(a), way(b)];
        let unturned = DVec2::from_angle(-middle.to_angle());
        let mut push = |ways: [f64; 2]| {
            if turn != 0.0 && ways[0] <= last && ways[1] >= first {
                seen.push(Seen {
                    ways,
                    from: unturned.rotate(a - eye),
                    along: unturned.rotate(b - a),
                    item: wall.item,
                });
            }
        };
        match from <= to {
            true => push([from, to]),
            // Behind the eye.
            false => [[from, PI], [-PI, to]].into_iter().for_each(&mut push),
        }
    }
    let mut found: Vec<ItemId> = Vec::new();
    let mut at = first;
    loop {
        let just_beyond = (at + BEYOND).min((at + last) / 2.0);
        let met = seen.iter().filter(|wall| wall.is_met(just_beyond));
        let nearest =
            met.min_by(|a, b| a.distance(just_beyond).total_cmp(&b.distance(just_beyond)))?;
        if found.last() != Some(&nearest.item) {
            found.push(nearest.item);
        }
        // Where it ends, or another one before it begins.
        let [_, end] = nearest.ways;
        let begins = seen.iter().filter(|wall| {
            let begin = wall.ways[0];
            begin > just_beyond
                && begin < end
                && wall.distance(begin + BEYOND) < nearest.distance(begin + BEYOND)
        });
        at = begins.map(|wall| wall.ways[0]).fold(end, f64::min);
        if at >= last {
            break;
        }
        if found.len() == MOST_WALLS {
            return None;
        }
    }
    covers(view, &facts, item, &found).ok().map(|_| found)
}
