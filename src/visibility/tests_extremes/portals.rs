//! Rooms in a row, seen through slits around one line of sight.
//!
//! The eye is as close to the first opening as f64 allows.

use glam::DVec3;

use super::case::looking;
use crate::camera::Lens;
use crate::scene::{SeededRng, WorldBox};
use crate::visibility::Rays;
use crate::visibility::region::{
    Opening, OpeningPlane, RegionGraph, Scratch, leads_through, rectangle,
};

/// A chain of rooms along x, and a line of sight from the first to the last.
pub struct Chain {
    rooms: Vec<WorldBox>,
    openings: Vec<Opening>,
    ends: [DVec3; 2],
    rays: Rays,
}

/// A chain of `length` rooms, near the origin or far from it.
///
/// The eye is `ahead` room lengths before the first opening, or one ulp if that is more.
pub fn chain(rng: &mut SeededRng, length: u32, ahead: f64) -> Chain {
    let base = [DVec3::ZERO, DVec3::new(1e7, -3e6, 12_345.678)][rng.below(2)];
    let ulp = f64::EPSILON * (1.0 + base.abs().max_element());
    let direction = DVec3::new(1.0, rng.normal() * 2e-3, rng.normal() * 2e-3);
    let border = |number: u32| base.x + f64::from(number);
    let mut eye = base;
    eye.x = (border(1) - ahead).min(border(1).next_down());
    let on_line = |x: f64| eye + direction * (x - eye.x);
    let room = |number: u32| {
        let (mut low, mut high) = (base - 2.0, base + 2.0);
        (low.x, high.x) = (border(number), border(number + 1));
        WorldBox::new(low, high)
    };
    let openings = (1..length).map(|number| {
        let at = border(number);
        let mut margin = || [1e-2, 1e-5, 1e-8, 8.0 * ulp][rng.below(4)] * (0.5 + rng.unit());
        let low = on_line(at) - DVec3::new(0.0, margin(), margin());
        let high = on_line(at) + DVec3::new(0.0, margin(), margin());
        Opening {
            sides: [number, number - 1],
            corners: rectangle(0, low, high),
            plane: OpeningPlane::Axis { axis: 0, at },
        }
    });
    let openings = openings.collect();
    let forward = direction + (rng.point() - 0.5) * 0.4;
    let lens = Lens::perspective(60.0, 1.3, 1e-4, Some(1e3)).expect("a lens");
    let rays = Rays::of(&looking(eye, forward, lens)).expect("a lens with rays");
    Chain {
        rooms: (0..length).map(room).collect(),
        openings,
        ends: [eye, on_line(border(length) - 0.5)],
        rays,
    }
}

impl Chain {
    /// Rooms on the line of sight that the search misses, with the search's name.
    ///
    /// The search's openings are narrower than the real ones by `shrink` on each side. `None` if
    /// exact arithmetic does not confirm that the line of sight passes the openings.
    pub fn lost(&self, shrink: f64) -> Option<(&'static str, Vec<u32>)> {
        let graph = RegionGraph::of_boxes(self.rooms.clone(), self.openings.clone());
        let last = self.rooms.len() as u32 - 1;
        if !leads_through(&graph, [0, last], self.ends) {
            return None;
        }
        let narrow = self
            .openings
            .iter()
            .map(|opening| narrower(*opening, shrink));
        let narrow = RegionGraph::of_boxes(self.rooms.clone(), narrow.collect());
        let mut listed = Vec::new();
        narrow.seen_by(&self.rays, None, &mut Scratch::default(), &mut listed);
        let is_lost = |room: &u32| listed.binary_search(room).is_err();
        Some(("portal-rect", (0..=last).filter(is_lost).collect()))
    }
}

fn narrower(opening: Opening, by: f64) -> Opening {
    let [low, ..] = opening.corners;
    let (low, high) = opening
        .corners
        .iter()
        .fold((low, low), |(low, high), corner| {
            (low.min(*corner), high.max(*corner))
        });
    let aside = DVec3::new(0.0, by, by);
    let middle = (low + high) / 2.0;
    Opening {
        corners: rectangle(0, (low + aside).min(middle), (high - aside).max(middle)),
        ..opening
    }
}
