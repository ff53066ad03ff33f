//! The machinery that tree structures share: nodes in depth-first order over
//! items in tree order, so that every subtree is one slice of ids, and one
//! traversal with plane masks for every kind of region. How the tree came to
//! be is each structure's own business.

use std::ops::ControlFlow;

use crate::geometry::Aabb;
use crate::query::{Containment, ItemId, Recorder, Region, Sink};

use super::MemoryUsage;

/// A node: the exact union of its items' bounds and where they lie.
#[derive(Clone, Copy, Debug)]
#[repr(C)]
pub struct TreeNode {
    pub bounds: Aabb,
    /// First item of the subtree in tree order.
    first: u32,
    /// Number of items of the subtree.
    count: u32,
    /// The node after this subtree in depth-first order. A leaf's is its own
    /// successor.
    after: u32,
}

/// A tree packed for querying: 36 bytes a node, 28 an item.
#[derive(Default)]
pub struct PackedTree {
    nodes: Vec<TreeNode>,
    boxes: Vec<Aabb>,
    ids: Vec<ItemId>,
    depth: usize,
}

/// What a builder knows of one of its nodes.
pub enum Step {
    /// Children, in the order in which they are to be laid out.
    Inner([u32; 2]),
    /// The items of a leaf: a range of the builder's own item list.
    Leaf(std::ops::Range<usize>),
}

/// Subtrees whose traversal may be open at once: one per level. Trees deeper
/// than this spill to the heap.
const STACK: usize = 64;

impl PackedTree {
    /// Packs a binary tree given as a function from node numbers to steps.
    /// `order` lists item ids as the leaves' ranges refer to them; an id that
    /// comes again (a builder that splits items) is kept once.
    ///
    /// Iterative, so that a degenerate tree cannot overflow the stack. O(n).
    pub fn pack(items: &[Aabb], root: u32, order: &[ItemId], step: impl Fn(u32) -> Step) -> Self {
        enum Task {
            Enter(u32, usize),
            Leave(usize),
        }
        let mut tree = PackedTree {
            boxes: Vec::with_capacity(order.len()),
            ids: Vec::with_capacity(order.len()),
            ..PackedTree::default()
        };
        let mut packed = vec![false; items.len()];
        let mut open = vec![Task::Enter(root, 1)];
        while let Some(task) = open.pop() {
            match task {
                Task::Enter(source, depth) => {
                    let at = tree.nodes.len();
                    tree.depth = tree.depth.max(depth);
                    tree.nodes.push(TreeNode {
                        bounds: Aabb::EMPTY,
                        first: tree.ids.len() as u32,
                        count: 0,
                        after: 0,
                    });
                    open.push(Task::Leave(at));
                    match step(source) {
                        Step::Inner([left, right]) => {
                            open.push(Task::Enter(right, depth + 1));
                            open.push(Task::Enter(left, depth + 1));
                        }
                        Step::Leaf(range) => {
                            for &id in &order[range] {
                                if !std::mem::replace(&mut packed[id as usize], true) {
                                    tree.ids.push(id);
                                    tree.boxes.push(items[id as usize]);
                                }
                            }
                        }
                    }
                }
                Task::Leave(at) => tree.close(at),
            }
        }
        tree.nodes.shrink_to_fit();
        tree.boxes.shrink_to_fit();
        tree.ids.shrink_to_fit();
        tree
    }

    /// Fixes what is known of a node only after its whole subtree: one pass
    /// over its children, not over its items.
    fn close(&mut self, at: usize) {
        let after = self.nodes.len();
        let first = self.nodes[at].first as usize;
        let mut bounds = Aabb::EMPTY;
        if after == at + 1 {
            bounds = Aabb::union_of(&self.boxes[first..]);
        }
        let mut child = at + 1;
        while child < after {
            bounds = bounds.union(&self.nodes[child].bounds);
            child = self.nodes[child].after as usize;
        }
        let node = &mut self.nodes[at];
        node.bounds = bounds;
        node.count = (self.ids.len() - first) as u32;
        node.after = after as u32;
    }

    /// Levels from the root to the deepest leaf; 0 for no items.
    pub fn depth(&self) -> usize {
        self.depth
    }

    pub fn memory(&self) -> MemoryUsage {
        MemoryUsage {
            node_bytes: size_of_val(&self.nodes[..]),
            item_bytes: size_of_val(&self.boxes[..]) + size_of_val(&self.ids[..]),
        }
    }

    /// Hands every item that the region admits to the sink, in tree order.
    ///
    /// Depth-first: a rejected subtree is skipped, an accepted one is a single
    /// slice, and a straddling one passes its memo (for a frustum the mask of
    /// planes still open) to its children.
    pub fn query<G: Region, S: Sink, R: Recorder>(
        &self,
        region: &G,
        sink: &mut S,
        recorder: &mut R,
    ) -> ControlFlow<()> {
        if self.ids.is_empty() {
            return ControlFlow::Continue(());
        }
        let mut open: Stack<G::Memo> = Stack::new(region.start());
        while let Some((at, memo)) = open.pop() {
            let node = &self.nodes[at as usize];
            recorder.node_tested();
            let (verdict, memo) = region.classify(&node.bounds, memo, recorder);
            let (first, end) = (node.first as usize, (node.first + node.count) as usize);
            match verdict {
                Containment::Outside => recorder.subtree_rejected(),
                Containment::Inside => {
                    recorder.subtree_accepted(end - first);
                    sink.accept(&self.ids[first..end])?;
                }
                Containment::Straddles if node.after == at + 1 => {
                    self.test_leaf(first, end, region, memo, sink, recorder)?;
                }
                Containment::Straddles => {
                    let left = at + 1;
                    open.push(self.nodes[left as usize].after, memo);
                    open.push(left, memo);
                }
            }
        }
        ControlFlow::Continue(())
    }

    /// Tests a leaf's items one by one and hands over runs of admitted ones.
    #[inline(always)]
    fn test_leaf<G: Region, S: Sink, R: Recorder>(
        &self,
        first: usize,
        end: usize,
        region: &G,
        memo: G::Memo,
        sink: &mut S,
        recorder: &mut R,
    ) -> ControlFlow<()> {
        let mut run = first;
        for (i, b) in self.boxes[first..end].iter().enumerate() {
            recorder.item_tested();
            if !region.admits(b, memo, recorder) {
                let at = first + i;
                if run < at {
                    sink.accept(&self.ids[run..at])?;
                }
                run = at + 1;
            }
        }
        if run < end {
            sink.accept(&self.ids[run..end])?;
        }
        ControlFlow::Continue(())
    }
}

/// Open subtrees: a fixed array, then the heap.
struct Stack<M> {
    near: [(u32, M); STACK],
    used: usize,
    far: Vec<(u32, M)>,
}

impl<M: Copy> Stack<M> {
    fn new(root: M) -> Self {
        Stack {
            near: [(0, root); STACK],
            used: 1,
            far: Vec::new(),
        }
    }

    #[inline(always)]
    fn push(&mut self, node: u32, memo: M) {
        if let Some(slot) = self.near.get_mut(self.used) {
            *slot = (node, memo);
            self.used += 1;
        } else {
            self.far.push((node, memo));
        }
    }

    #[inline(always)]
    fn pop(&mut self) -> Option<(u32, M)> {
        if let Some(top) = self.far.pop() {
            return Some(top);
        }
        self.used = self.used.checked_sub(1)?;
        Some(self.near[self.used])
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::query::{Count, NoRecorder};
    use glam::Vec3;

    /// A degenerate list of a tree: node i has leaf i on the left and the
    /// rest on the right.
    fn comb(items: &[Aabb]) -> PackedTree {
        let n = items.len() as u32;
        let order: Vec<u32> = (0..n).collect();
        PackedTree::pack(items, 0, &order, |node| {
            // Even numbers are inner nodes, odd ones the leaves beside them.
            let i = node / 2;
            if node % 2 == 1 || i + 1 == n {
                Step::Leaf(i as usize..i as usize + 1)
            } else {
                Step::Inner([node + 1, node + 2])
            }
        })
    }

    #[test]
    fn a_tree_of_a_hundred_thousand_levels_is_walked_without_recursion() {
        let items: Vec<Aabb> = (0..100_000)
            .map(|i| Aabb::around(Vec3::new(i as f32, 0.0, 0.0), Vec3::splat(0.5)))
            .collect();
        let tree = comb(&items);
        assert_eq!(tree.depth(), 100_000);
        let mut all = Count::default();
        let everything = Aabb::new(Vec3::splat(-1e9), Vec3::splat(1e9));
        let _ = tree.query(&everything, &mut all, &mut NoRecorder);
        assert_eq!(all.0, 100_000);
        let mut found = Vec::new();
        let _ = tree.query(&Vec3::new(99_999.25, 0.0, 0.0), &mut found, &mut NoRecorder);
        assert_eq!(found, [99_999]);
    }

    #[test]
    fn nodes_hold_the_exact_union_of_their_items() {
        let items: Vec<Aabb> = (0..9)
            .map(|i| Aabb::around(Vec3::new(i as f32, -(i as f32), 0.1), Vec3::splat(0.3)))
            .collect();
        let tree = comb(&items);
        for node in &tree.nodes {
            let range = node.first as usize..(node.first + node.count) as usize;
            assert_eq!(node.bounds, Aabb::union_of(&tree.boxes[range]));
        }
    }

    #[test]
    fn an_item_that_a_builder_split_is_kept_once() {
        let items = [
            Aabb::around(Vec3::ZERO, Vec3::ONE),
            Aabb::around(Vec3::X, Vec3::ONE),
        ];
        let tree = PackedTree::pack(&items, 0, &[0, 1, 0], |node| match node {
            0 => Step::Inner([1, 2]),
            1 => Step::Leaf(0..2),
            _ => Step::Leaf(2..3),
        });
        let mut found = Vec::new();
        let _ = tree.query(&Vec3::ZERO, &mut found, &mut NoRecorder);
        assert_eq!(found, [0, 1]);
    }
}
