//! Exact clipped portals.
//!
//! An opening is cut, as a convex polygon, by the half-spaces through the eye and the edges of all openings before it. Exact up to a slack of
//! some 1e-11 of the distance, which is given away so that rounding loses nothing.
//!
//! A window keeps half-spaces of the openings' own edges only; none is ever made from
//! a corner that was computed by cutting, so errors do not build up from opening to
//! opening (the proof is at the slack, in `view`).

use super::opening::Opening;
use super::search::Windows;
use super::view::{HalfSpace, MOST_PLANES, Polygon, View, through_edge};

/// Sets of half-spaces. A window is the range of its half-spaces in `planes`.
#[derive(Clone, Default, Debug)]
pub struct PortalClip {
    /// The half-spaces of all windows, the sides of the image first.
    planes: Vec<HalfSpace>,
    /// The current window: the opening as it is seen, and the half-spaces about it.
    polygon: Polygon,
    current: Vec<HalfSpace>,
}

impl Windows for PortalClip {
    type Window = [u32; 2];

    fn begin(&mut self, view: &View) -> [u32; 2] {
        self.planes.clear();
        self.planes.extend_from_slice(&view.sides);
        [0, view.sides.len() as u32]
    }

    fn narrow(&mut self, view: &View, (exit, opening): (u32, &Opening), window: [u32; 2]) -> bool {
        let before = &self.planes[window[0] as usize..window[1] as usize];
        let Some((corners, reach)) = self.polygon.see(view, opening, before) else {
            return false;
        };
        let edges = (0u32..4)
            .filter_map(|edge| through_edge(&corners, edge as usize, reach, 4 + 4 * exit + edge));
        // A half-space that holds all of the polygon follows from the others.
        let needed = |plane: &HalfSpace| !self.polygon.is_within(plane);
        let all = before.iter().copied().chain(edges);
        self.current.clear();
        self.current.extend(all.filter(needed).take(MOST_PLANES));
        true
    }

    /// Each half-space of an earlier window is one of the current or holds its polygon.
    fn is_within(&self, [first, end]: [u32; 2]) -> bool {
        let implied = |old: &HalfSpace| {
            let shared = self.current.iter().any(|plane| plane.number == old.number);
            shared || self.polygon.is_within(old)
        };
        self.planes[first as usize..end as usize]
            .iter()
            .all(implied)
    }

    fn keep(&mut self) -> [u32; 2] {
        let first = self.planes.len() as u32;
        self.planes.extend_from_slice(&self.current);
        [first, self.planes.len() as u32]
    }
}
