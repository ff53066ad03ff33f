//! A node of the packed trees: nodes lie in depth-first order, items in tree
//! order, so that every subtree is one slice of either.

use std::ops::Range;

use crate::geometry::Aabb;

/// A node: the exact union of its items' bounds and where they lie.
#[derive(Clone, Copy, Debug)]
#[repr(C)]
pub struct TreeNode {
    /// Exact union of its items' bounds; closed.
    pub bounds: Aabb,
    /// First item of the subtree in tree order.
    pub first: u32,
    /// Number of items of the subtree.
    pub count: u32,
    /// The node after this subtree in depth-first order. A leaf's is its own
    /// successor.
    pub after: u32,
}

impl TreeNode {
    /// The places of the subtree's items in tree order.
    #[inline(always)]
    pub fn items(&self) -> Range<usize> {
        self.first as usize..(self.first + self.count) as usize
    }

    /// The node after this subtree in depth-first order.
    #[inline(always)]
    pub fn after(&self) -> usize {
        self.after as usize
    }
}
