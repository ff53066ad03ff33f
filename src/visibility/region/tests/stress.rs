//! Chains of slits around one line of sight, near and far from the origin.
//!
//! Eyes are on and next to openings.

use glam::DVec3;

use super::super::*;
use crate::camera::{Camera, Frame, Lens};
use crate::scene::{SeededRng, WorldBox};
use crate::visibility::Rays;

/// Rooms in a row along an axis, with slits around one line of sight.
///
/// The slits extend by a margin on each side of the line. `ends` are the eye in the first
/// room and a point in the last one, both on the line.
struct Chain {
    rooms: Vec<WorldBox>,
    openings: Vec<Opening>,
    ends: [DVec3; 2],
}

fn chain(rng: &mut SeededRng, base: DVec3, length: usize, shrink: f64, margins: &[f64]) -> Chain {
    let axis = rng.below(3);
    let flip = rng.below(2) == 1;
    let mut direction = DVec3::new(rng.normal(), rng.normal(), rng.normal()) * 0.002;
    direction[axis] = if flip { -1.0 } else { 1.0 };
    let ahead = [0.5, 1e-3, 1e-9, f64::EPSILON][rng.below(4)];
    let mut eye = base;
    let step = direction[axis];
    // The first border is at base + step.
    eye[axis] = base[axis] + step * (1.0 - ahead);
    let border = |i: usize| base[axis] + step * i as f64;
    let mut rooms = Vec::new();
    let mut openings = Vec::new();
    for i in 0..length {
        let (mut low, mut high) = (base - 2.0, base + 2.0);
        let (a, b) = (border(i), border(i + 1));
        (low[axis], high[axis]) = (a.min(b), a.max(b));
        rooms.push(WorldBox::new(low, high));
        if i + 1 == length {
            break;
        }
        let at = border(i + 1);
        let centre = eye + direction * ((at - eye[axis]) / step);
        let mut margin = || margins[rng.below(margins.len())] * (0.5 + rng.unit()) - shrink;
        let low = centre - DVec3::new(margin(), margin(), margin());
        let high = centre + DVec3::new(margin(), margin(), margin());
        let (mut low, mut high) = (low, high);
        (low[axis], high[axis]) = (at, at);
        let (here, next) = (i as u32, i as u32 + 1);
        openings.push(Opening {
            sides: if flip { [here, next] } else { [next, here] },
            corners: rectangle(axis, low.min(high), high.max(low)),
            plane: OpeningPlane::Axis { axis, at },
        });
    }
    let last = border(length) - step * 0.5;
    Chain {
        rooms,
        openings,
        ends: [eye, eye + direction * ((last - eye[axis]) / step)],
    }
}

/// Number of accepted lines of sight whose last room the search loses.
///
/// Also returns the number of accepted lines.
fn lost(shrink: f64) -> (usize, usize) {
    let (mut lost, mut accepted) = (0, 0);
    for round in 0..400u64 {
        let base = [DVec3::ZERO, DVec3::new(1e7, -3e6, 12_345.678)][round as usize % 2];
        let length = 2 + round as usize % 63;
        // The finest margins are some units in the last place.
        let last_place = f64::EPSILON * (1.0 + base.abs().max_element());
        let margins = [1e-3, 1e-7, 8.0 * last_place, 2.0 * last_place];
        // The same random numbers for the truth and for the input of the search.
        let truth = chain(&mut SeededRng::new(round), base, length, 0.0, &margins);
        let told = chain(&mut SeededRng::new(round), base, length, shrink, &margins);
        let graph = RegionGraph::of_boxes(truth.rooms, truth.openings);
        if !leads_through(&graph, [0, length as u32 - 1], truth.ends) {
            continue;
        }
        accepted += 1;
        let told = RegionGraph::of_boxes(told.rooms, told.openings);
        let mut rng = SeededRng::new(round);
        let noise = DVec3::new(rng.unit(), rng.unit(), rng.unit()) * 0.3;
        let [eye, end] = truth.ends;
        let forward = (end - eye).normalize() + noise;
        let up = DVec3::new(0.3, 0.5, 0.7);
        let frame = Frame::looking_along(eye, forward, up).unwrap();
        let lens = Lens::perspective(60.0, 1.3, 1e-4, Some(1e3)).unwrap();
        let rays = Rays::of(&Camera { frame, lens }).unwrap();
        let (mut scratch, mut out) = (Scratch::default(), Vec::new());
        told.seen_by(&rays, None, &mut scratch, &mut out);
        lost += usize::from(out.binary_search(&(length as u32 - 1)).is_err());
    }
    (lost, accepted)
}

#[test]
fn lines_through_chains_of_slits_are_not_lost() {
    let (lost, accepted) = lost(0.0);
    assert_eq!(lost, 0);
    assert!(accepted > 100, "{accepted}");
}

#[test]
fn openings_that_are_told_too_small_are_noticed() {
    let (lost, accepted) = lost(1e-5);
    assert!(lost * 20 > accepted, "{lost} of {accepted}");
}

#[test]
fn an_orthographic_camera_and_one_with_a_far_plane() {
    let chain = chain(&mut SeededRng::new(3), DVec3::ZERO, 40, 0.0, &[1e-2]);
    let graph = RegionGraph::of_boxes(chain.rooms, chain.openings);
    let [eye, end] = chain.ends;
    let frame = Frame::looking_along(eye, end - eye, DVec3::new(0.3, 0.5, 0.7)).unwrap();
    let answer = |lens: Lens| {
        let rays = Rays::of(&Camera { frame, lens }).unwrap();
        let mut out = Vec::new();
        let inside = graph.seen_by(&rays, None, &mut Scratch::default(), &mut out);
        (inside, out.len())
    };
    let level = Lens::orthographic(1.0, 1.0, 0.1, 50.0).unwrap();
    assert_eq!(answer(level), (false, 40));
    // The last opening that is not beyond the far plane leads one room further.
    let near = Lens::perspective(60.0, 1.0, 1e-4, Some(9.9)).unwrap();
    let (inside, count) = answer(near);
    assert!(inside);
    assert!((10..=12).contains(&count), "{count}");
}
