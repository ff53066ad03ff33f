//! The stencil-test: the samples on which a portal or a mirror is seen, and no
//! others, are drawn on in the pass that shows what is beyond it.

/// Some of the samples of an image.
#[derive(Clone, PartialEq, Eq, Debug)]
pub struct Stencil {
    marked: Vec<bool>,
    /// Number of samples whose rays were tested to mark it.
    pub tested: u64,
}

impl Stencil {
    /// A stencil without marked samples.
    pub fn new(samples: usize) -> Stencil {
        Stencil {
            marked: vec![false; samples],
            tested: 0,
        }
    }

    /// Marks a sample.
    pub fn mark(&mut self, sample: usize) {
        self.marked[sample] = true;
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
