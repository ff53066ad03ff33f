//! The stencil-test: the samples on which a portal or a mirror is seen, and no
//! others, are drawn on in the pass that shows what is beyond it.

use super::canvas::Canvas;
use super::depth::DepthBuffer;
use crate::scene::WorldBox;

/// Some of the samples of an image.
#[derive(Clone, PartialEq, Eq, Debug)]
pub struct Stencil {
    marked: Vec<bool>,
    count: usize,
}

impl Stencil {
    /// The samples that see a flat rectangle (a box with no thickness along one
    /// axis) before what is in the depth buffer already, or as near.
    pub fn of_rectangle(canvas: &Canvas, rectangle: &WorldBox, depth: &DepthBuffer) -> Stencil {
        let mut marked = vec![false; canvas.grid().samples()];
        canvas.meet(rectangle, None, |sample, at| {
            let before = |(front, _): (_, _)| canvas.probe(sample).compare(&at, &front).is_le();
            marked[sample] = depth.front(sample).is_none_or(before);
        });
        let count = marked.iter().filter(|marked| **marked).count();
        Stencil { marked, count }
    }

    /// Whether the sample may be drawn on.
    #[inline]
    pub fn holds(&self, sample: usize) -> bool {
        self.marked[sample]
    }

    /// How many samples may be drawn on.
    pub fn count(&self) -> usize {
        self.count
    }
}
