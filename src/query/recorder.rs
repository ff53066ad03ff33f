//! Counters of a query, and the recorder that counts nothing.

use serde::{Deserialize, Serialize};

/// Counts the steps of a query.
///
/// The calls of [`NoRecorder`] compile to nothing; queries are never timed with counters on.
pub trait Recorder {
    /// The bounds of nodes were classified.
    #[inline(always)]
    fn nodes_tested(&mut self, _count: u32) {}
    /// Planes were evaluated against nodes or items.
    #[inline(always)]
    fn planes_tested(&mut self, _count: u32) {}
    /// Bounds of items were tested.
    #[inline(always)]
    fn items_tested(&mut self, _count: u32) {}
    /// A subtree was accepted whole: `items` ids without a test of their own.
    #[inline(always)]
    fn subtree_accepted(&mut self, _items: usize) {}
    /// Subtrees were rejected whole.
    #[inline(always)]
    fn subtrees_rejected(&mut self, _count: u32) {}
}

/// Records nothing.
#[derive(Clone, Copy, Default, Debug)]
pub struct NoRecorder;

impl Recorder for NoRecorder {}

/// Cost of one query, or of a sum of queries.
#[derive(Clone, Copy, Default, PartialEq, Eq, Debug, Serialize, Deserialize)]
pub struct QueryCost {
    /// Node bounds that were classified.
    pub nodes_tested: u64,
    /// Plane tests, of nodes and items.
    pub planes_tested: u64,
    /// Item bounds that were tested.
    pub items_tested: u64,
    /// Items that were reported with a whole subtree, untested.
    pub items_accepted_untested: u64,
    /// Subtrees that were wholly inside.
    pub subtrees_accepted: u64,
    /// Subtrees that were wholly outside.
    pub subtrees_rejected: u64,
}

impl QueryCost {
    /// Bounds tested, of nodes and items together.
    ///
    /// The "compares" of the lecture's O(n) against O(log n).
    pub fn comparisons(&self) -> u64 {
        self.nodes_tested + self.items_tested
    }
}

impl Recorder for QueryCost {
    #[inline(always)]
    fn nodes_tested(&mut self, count: u32) {
        self.nodes_tested += u64::from(count);
    }
    #[inline(always)]
    fn planes_tested(&mut self, count: u32) {
        self.planes_tested += u64::from(count);
    }
    #[inline(always)]
    fn items_tested(&mut self, count: u32) {
        self.items_tested += u64::from(count);
    }
    #[inline(always)]
    fn subtree_accepted(&mut self, items: usize) {
        self.subtrees_accepted += 1;
        self.items_accepted_untested += items as u64;
    }
    #[inline(always)]
    fn subtrees_rejected(&mut self, count: u32) {
        self.subtrees_rejected += u64::from(count);
    }
}
