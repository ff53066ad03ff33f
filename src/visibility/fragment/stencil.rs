//! The stencil-test: the samples on which a portal or a mirror is seen, and no
//! others, are drawn on in the pass that shows what is beyond it.

/// Some of the samples of an image.
#[derive(Clone, PartialEq, Eq, Debug)]
pub struct Stencil {
    marked: Vec<bool>,
    count: usize,
}

impl Stencil {
    /// The samples that are marked.
    pub fn of(marked: Vec<bool>) -> Stencil {
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
