//! Triangles whose screen box holds no sample: between the rays, at this size of
//! image.

use super::super::guarantee::Guarantee;
use super::contract::{Criterion, TriangleRow};
use super::locals::{EIGHT, Points, Rule};
use super::screen::{PixelBox, Screen, Screened};

/// The row of this file.
pub const ROW: TriangleRow = TriangleRow {
    name: "below-a-sample",
    summary: "Drops what no sample of the image can meet: its screen box holds none",
    guarantee: Guarantee::SampleExact,
    criterion: Criterion::Samples,
    build: |clusters| Box::new(Screened::of(clusters, Pixels)),
};

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
