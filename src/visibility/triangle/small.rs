//! Triangles whose screen box holds no sample: between the rays, at this size of
//! image.

use super::super::guarantee::Guarantee;
use super::contract::{Criterion, TriangleCull, TriangleRow};
use super::locals::{EIGHT, Locals, Points, Rule};
use super::screen::{PixelBox, Screen};
use super::selection::Selection;
use super::view::View;
use crate::kernel::{Isa, Kernel, Work};

/// The row of this file.
pub const ROW: TriangleRow = TriangleRow {
    name: "below-a-sample",
    summary: "Drops what no sample of the image can meet: its screen box holds none",
    guarantee: Guarantee::SampleExact,
    criterion: Criterion::Samples,
    build: |clusters| Box::new(Small(Locals::of(clusters))),
};

struct Small(Locals);

impl TriangleCull for Small {
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
        self.locals.retain(self.kept, &Pixels(self.screen));
    }
}

struct Pixels(Screen);

impl Rule for Pixels {
    type Of = PixelBox;

    #[inline(always)]
    fn of_points(&self, points: &Points) -> [PixelBox; EIGHT] {
        self.0.pixels(points)
    }

    /// In front of the eye the image of a box is within that of its corners.
    #[inline(always)]
    fn of_box(&self, corners: [PixelBox; EIGHT]) -> Option<bool> {
        let mut all = corners[0];
        for corner in corners {
            all = all.union(corner);
        }
        (!all.has_sample()).then_some(false)
    }

    #[inline(always)]
    fn keep(&self, [a, b, c]: [PixelBox; 3]) -> bool {
        a.union(b).union(c).has_sample()
    }
}
