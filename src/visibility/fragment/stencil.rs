//! The stencil-test: the samples on which a portal or a mirror is seen, and no
//! others, are drawn on in the pass that shows what is beyond it.

use super::canvas::Canvas;
use super::depth::DepthBuffer;
use crate::scene::WorldBox;

/// Some of the samples of an image.
#[derive(Clone, PartialEq, Eq, Debug)]
pub struct Stencil {
    marked: Vec<bool>,
    /// Number of samples whose rays were tested to mark it.
    pub tested: u64,
}

impl Stencil {
    /// The samples that see a flat rectangle (a box with no thickness along one axis)
    /// of several before the content of the depth buffer, or as near.
    pub fn of_rectangles(canvas: &Canvas, rectangles: &[WorldBox], depth: &DepthBuffer) -> Stencil {
        let mut stencil = Stencil {
            marked: vec![false; canvas.grid().samples()],
            tested: 0,
        };
        for rectangle in rectangles {
            let visited = canvas.meet(rectangle, None, |sample, at| {
                let before = |(front, _): (_, _)| canvas.probe(sample).compare(&at, &front).is_le();
                stencil.marked[sample] |= depth.front(sample).is_none_or(before);
            });
            stencil.tested += visited.tested;
        }
        stencil
    }

    /// Tests whether the sample may be drawn on.
    #[inline]
    pub fn holds(&self, sample: usize) -> bool {
        self.marked[sample]
    }

    /// Number of samples that may be drawn on. O(samples).
    pub fn count(&self) -> usize {
        self.marked.iter().filter(|marked| **marked).count()
    }
}
