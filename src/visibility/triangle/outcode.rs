//! Triangles wholly outside one plane of the view: outcodes as clipping computes
//! them (Sproull and Sutherland 1968). What crosses the near plane is kept.

use super::super::guarantee::Guarantee;
use super::contract::{Criterion, TriangleRow};
use super::locals::{EIGHT, Points, Rule};
use super::screen::{Screen, Screened};

/// The row of this file.
pub const ROW: TriangleRow = TriangleRow {
    name: "outcode",
    summary: "Drops what has all corners outside one of the six planes of the view",
    guarantee: Guarantee::Conservative,
    criterion: Criterion::Window,
    build: |clusters| Box::new(Screened::of(clusters, Codes)),
};

struct Codes(Screen);

impl Rule for Codes {
    type Of = u8;

    #[inline(always)]
    fn of_points(&self, points: &Points) -> [u8; EIGHT] {
        self.0.outcodes(points)
    }

    /// What is outside a plane with all corners of its box is outside; what has no
    /// corner outside any plane is not worth a closer look.
    #[inline(always)]
    fn of_box(&self, codes: [u8; EIGHT]) -> Option<bool> {
        let (mut all, mut any) = (u8::MAX, 0);
        for code in codes {
            all &= code;
            any |= code;
        }
        match (all, any) {
            (0, 0) => Some(true),
            (0, _) => None,
            _ => Some(false),
        }
    }

    #[inline(always)]
    fn keep(&self, [a, b, c]: [u8; 3]) -> bool {
        a & b & c == 0
    }
}
