//! A node of the packed tree, and the stack of a depth-first traversal.

use std::ops::Range;

use crate::geometry::Aabb;

/// A node: the exact union of its items' bounds and the position of its subtree.
#[derive(Clone, Copy, Default, Debug)]
#[repr(C)]
pub struct TreeNode {
    /// Exact union of its items' bounds; closed.
    pub bounds: Aabb,
    /// First item of the subtree in tree order.
    pub first: u32,
    /// Number of items of the subtree.
    pub count: u32,
    /// The node after this subtree in depth-first order.
    ///
    /// For a leaf, the next node.
    pub after: u32,
}

impl TreeNode {
    /// Positions of the subtree's items in tree order.
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

/// Returns whether the node at this index has no children.
#[inline(always)]
pub fn is_leaf(nodes: &[TreeNode], node: usize) -> bool {
    nodes[node].after() == node + 1
}

/// Indices of a node's children, ascending.
#[inline(always)]
pub fn children(nodes: &[TreeNode], node: usize) -> impl Iterator<Item = usize> {
    let end = nodes[node].after();
    let mut child = node + 1;
    std::iter::from_fn(move || {
        let this = (child < end).then_some(child)?;
        child = nodes[this].after();
        Some(this)
    })
}

/// Open subtrees kept without the heap: enough for any balanced tree.
pub const NEAR: usize = 48;

/// Stack of open nodes of a traversal.
pub struct Stack<T = u32> {
    pub near: [T; NEAR],
    pub used: usize,
    /// Overflow for degenerate trees.
    pub far: Vec<T>,
}

impl<T: Copy> Stack<T> {
    #[inline(always)]
    pub fn new(root: T) -> Self {
        Stack {
            near: [root; NEAR],
            used: 1,
            far: Vec::new(),
        }
    }

    #[inline(always)]
    pub fn pop(&mut self) -> Option<T> {
        if let Some(top) = self.far.pop() {
            return Some(top);
        }
        self.used = self.used.checked_sub(1)?;
        Some(self.near[self.used])
    }

    #[inline(always)]
    pub fn push(&mut self, node: T) {
        if let Some(slot) = self.near.get_mut(self.used) {
            *slot = node;
            self.used += 1;
        } else {
            self.far.push(node);
        }
    }
}
