//! Triangles wholly outside one plane of the view: outcodes as clipping computes
//! them (Sproull and Sutherland 1968). What crosses the near plane is kept.

use glam::Vec3;

use super::super::guarantee::Guarantee;
use super::contract::{Criterion, TriangleCull, TriangleRow};
use super::locals::{EIGHT, Locals, Points, Rule, in_rows};
use super::screen::Screen;
use super::selection::Selection;
use super::view::View;
use crate::kernel::{Isa, Kernel, Work};

/// The row of this file.
pub const ROW: TriangleRow = TriangleRow {
    name: "outcode",
    summary: "Drops what has all corners outside one of the six planes of the view",
    guarantee: Guarantee::Conservative,
    criterion: Criterion::Window,
    build: |clusters| Box::new(Outcodes(Locals::of(clusters))),
};

named! {
    /// What a clipper has to do with a triangle.
    #[derive(Clone, Copy, PartialEq, Eq, Hash, Debug)]
    #[non_exhaustive]
    pub enum Clipping {
        /// Nothing: it is wholly outside one plane.
        Outside = "outside",
        /// Nothing: it is wholly inside.
        Inside = "inside",
        /// Nothing: it crosses sides of the window, but stays within the guard band,
        /// where a rasteriser's coordinates still hold.
        GuardBand = "guard band",
        /// To cut it: it crosses near or far, or leaves the guard band.
        Clip = "clip",
    }
}

/// What a clipper has to do with a triangle whose guard band is `band` times as wide
/// and high as the window (1 is none). `Outside` is proven; the others are rounded.
pub fn clipping(screen: &Screen, corners: [Vec3; 3], band: f64) -> Clipping {
    let codes = screen.outcodes(&in_rows(&corners));
    let outside = [codes[0], codes[1], codes[2]];
    if outside[0] & outside[1] & outside[2] != 0 {
        return Clipping::Outside;
    }
    let any = outside[0] | outside[1] | outside[2];
    if any == 0 {
        return Clipping::Inside;
    }
    let in_band = any & Screen::DEPTH == 0 && corners.iter().all(|p| screen.is_within(*p, band));
    match in_band {
        true => Clipping::GuardBand,
        false => Clipping::Clip,
    }
}

struct Outcodes(Locals);

impl TriangleCull for Outcodes {
    fn cull(&self, view: &View, kernel: Kernel, kept: &mut Selection) {
        if let Some(screen) = Screen::of(view) {
            let locals = &self.0;
            kernel.run(Query {
                locals,
                screen,
                kept,
            });
        }
    }

    fn bytes(&self) -> usize {
        self.0.bytes()
    }
}

struct Query<'a> {
    locals: &'a Locals,
    screen: Screen,
    kept: &'a mut Selection,
}

impl Work for Query<'_> {
    type Output = ();

    #[inline(always)]
    fn run<I: Isa>(self, _: I) {
        self.locals.retain(self.kept, &Codes(self.screen));
    }
}

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
