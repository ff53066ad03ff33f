//! Triangles whose screen box holds no sample: between the rays, at this size of
//! image.

use super::super::guarantee::Guarantee;
use super::contract::{Criterion, TriangleCull, TriangleRow};
use super::locals::{Locals, Points};
use super::screen::{PixelBox, Screen};
use super::selection::Selection;
use super::view::View;
use crate::kernel::{Isa, Kernel, Work};

/// The row of this file.
pub const ROW: TriangleRow = TriangleRow {
    name: "smaller than a sample",
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
        let screen = &self.screen;
        let pixels = |points: &Points| screen.pixels(points);
        // In front of the eye the image of a box is within that of its corners.
        let of_box = |corners: [PixelBox; 8]| {
            let all = corners.iter().skip(1);
            let all = all.fold(corners[0], |all, corner| all.union(*corner));
            (!screen.has_sample(&all)).then_some(false)
        };
        let keep = |[a, b, c]: [PixelBox; 3]| screen.has_sample(&a.union(b).union(c));
        self.locals.retain(self.kept, pixels, of_box, keep);
    }
}
