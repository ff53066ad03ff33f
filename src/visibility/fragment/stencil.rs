//! The stencil-test: the samples on which a portal or a mirror is seen, and no
//! others, are drawn on in the pass that shows what is beyond it.

/// Some of the samples of an image.
#[derive(Clone, PartialEq, Eq, Debug)]
pub struct Stencil {
    marked: Vec<bool>,
    count: usize,
    /// Samples whose rays were asked to mark it.
    pub(super) asked: u64,
}

impl Stencil {
    /// The samples that are marked.
    pub fn of(marked: Vec<bool>) -> Stencil {
        let count = marked.iter().filter(|marked| **marked).count();
        Stencil {
            marked,
            count,
            asked: 0,
        }
    }

    /// Marks what another of the same image marks as well.
    pub fn add(&mut self, other: &Stencil) {
        let pairs = self.marked.iter_mut().zip(&other.marked);
        pairs.for_each(|(own, other)| *own |= other);
        self.count = self.marked.iter().filter(|marked| **marked).count();
        self.asked += other.asked;
    }

    /// How many samples' rays were asked to mark it.
    pub fn asked(&self) -> u64 {
        self.asked
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
