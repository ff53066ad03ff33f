//! The machinery that all trees share: nodes in depth-first order over items
//! in tree order, so that every subtree is one slice of ids; item bounds in
//! blocks of sixteen; one traversal with plane masks for every kind of region;
//! refitting. How a tree comes to be is each structure's own business.

use std::ops::{ControlFlow, Range};

use glam::Vec3;

use super::bundles::{Bundles, Leaves};
use super::node::TreeNode;
use super::stack::Stack;
use crate::geometry::{Aabb, BoxBlocks, PlaneMask};
use crate::kernel::{Isa, prefetch};
use crate::query::{Containment, Context, ItemId, QueryVolume, Recorder, Sink};

use super::MemoryUsage;

/// A tree packed for querying: 36 bytes a node, 28 an item. Nodes may have
/// any number of children.
#[derive(Default)]
pub struct PackedTree {
    nodes: Vec<TreeNode>,
    boxes: BoxBlocks,
    ids: Vec<ItemId>,
    depth: usize,
    /// The nodes again, as views traverse them.
    bundles: Bundles,
    /// Place of each item in tree order, made when first needed.
    place_of: Vec<u32>,
}

/// Mark of an item that is not in the tree.
const ABSENT: u32 = u32::MAX;

/// Writes a tree in depth-first order: open a node, push its items or write
/// its children, close it.
pub struct TreeWriter {
    tree: PackedTree,
    level: usize,
}

impl TreeWriter {
    /// An empty tree with memory for so many items.
    pub fn with_capacity(items: usize) -> Self {
        TreeWriter {
            tree: PackedTree {
                boxes: BoxBlocks::with_capacity(items),
                ids: Vec::with_capacity(items),
                ..PackedTree::default()
            },
            level: 0,
        }
    }

    /// Begins a node below the ones that are open; its number.
    pub fn open(&mut self) -> usize {
        self.level += 1;
        self.tree.depth = self.tree.depth.max(self.level);
        self.tree.nodes.push(TreeNode {
            bounds: Aabb::EMPTY,
            first: self.tree.ids.len() as u32,
            count: 0,
            after: 0,
        });
        self.tree.nodes.len() - 1
    }

    /// Adds an item to the leaf that is open.
    pub fn push(&mut self, id: ItemId, bounds: &Aabb) {
        self.tree.ids.push(id);
        self.tree.boxes.push(bounds);
    }

    /// Ends a node: its subtree is complete.
    pub fn close(&mut self, node: usize) {
        self.level -= 1;
        let (after, items) = (self.tree.nodes.len(), self.tree.ids.len());
        let closed = &mut self.tree.nodes[node];
        closed.count = items as u32 - closed.first;
        closed.after = after as u32;
        self.tree.fit(node);
    }

    /// The tree of all nodes that were opened and closed.
    pub fn finish(mut self) -> PackedTree {
        self.tree.nodes.shrink_to_fit();
        self.tree.boxes.shrink_to_fit();
        self.tree.ids.shrink_to_fit();
        self.tree.bundles = Bundles::of(&self.tree.nodes);
        self.tree
    }
}

impl PackedTree {
    /// The nodes in depth-first order, the root first.
    #[inline(always)]
    pub fn nodes(&self) -> &[TreeNode] {
        &self.nodes
    }

    /// Item bounds in tree order.
    #[inline(always)]
    pub fn boxes(&self) -> &BoxBlocks {
        &self.boxes
    }

    /// Item ids in tree order.
    #[inline(always)]
    pub fn ids(&self) -> &[ItemId] {
        &self.ids
    }

    /// Whether the node has no children.
    #[inline(always)]
    pub fn is_leaf(&self, node: usize) -> bool {
        self.nodes[node].after() == node + 1
    }

    /// Levels from the root to the deepest leaf; 0 for no items.
    pub fn depth(&self) -> usize {
        self.depth
    }

    /// Bytes of nodes and of items, as allocated.
    pub fn memory(&self) -> MemoryUsage {
        MemoryUsage {
            node_bytes: size_of_val(&self.nodes[..]) + self.bundles.bytes(),
            item_bytes: self.boxes.bytes()
                + size_of_val(&self.ids[..])
                + size_of_val(&self.place_of[..]),
        }
    }

    /// Hands every item that the volume sees to the sink: those that hold a
    /// point in tree order; of a frustum accepted subtrees first, level by
    /// level, then what is left of the leaves.
    #[inline(always)]
    pub fn query<Q: QueryVolume, C: Context>(&self, volume: &Q, cx: &mut C) -> ControlFlow<()> {
        if Q::IS_POINT {
            return self.walk(volume, cx);
        }
        let isa = cx.isa();
        let (sink, recorder) = cx.parts();
        self.search(isa, volume, sink, recorder)
    }

    #[inline(always)]
    fn leaves<'a, Q>(&'a self, volume: &'a Q) -> Leaves<'a, Q> {
        Leaves {
            boxes: &self.boxes,
            ids: &self.ids,
            volume,
        }
    }

    /// Sink and recorder come apart here, as they do in all that loops over nodes
    /// or blocks: a reference that is a parameter aliases nothing, as the compiler
    /// knows; one that is read from a context may. It is worth 3 to 7 %.
    #[inline(always)]
    fn search<I: Isa, Q: QueryVolume, S: Sink, R: Recorder>(
        &self,
        isa: I,
        volume: &Q,
        sink: &mut S,
        recorder: &mut R,
    ) -> ControlFlow<()> {
        let Some(root) = self.nodes.first() else {
            return ControlFlow::Continue(());
        };
        recorder.node_tested();
        let (verdict, mask) = volume.classify(&root.bounds, volume.mask(), recorder);
        match verdict {
            Containment::Outside => {
                recorder.subtree_rejected();
                return ControlFlow::Continue(());
            }
            Containment::Inside => {
                recorder.subtree_accepted(self.ids.len());
                return sink.accept_places(isa, &self.ids, 0..self.ids.len());
            }
            Containment::Straddles => {}
        }
        let (tree, leaves) = ((&self.nodes[..], &self.ids[..]), self.leaves(volume));
        self.bundles
            .search(isa, tree, (volume, mask), &leaves, sink, recorder)
    }

    /// Hands every item that the volume sees to the sink, in tree order.
    ///
    /// One walk along the nodes in memory order: a rejected subtree is jumped
    /// over, an accepted one is a single slice, and a straddling one leaves its
    /// mask of open planes for all nodes up to its end.
    #[inline(always)]
    pub fn walk<Q: QueryVolume, C: Context>(&self, volume: &Q, cx: &mut C) -> ControlFlow<()> {
        let isa = cx.isa();
        let (sink, recorder) = cx.parts();
        self.walk_by(isa, volume, sink, recorder)
    }

    #[inline(always)]
    fn walk_by<I: Isa, Q: QueryVolume, S: Sink, R: Recorder>(
        &self,
        isa: I,
        volume: &Q,
        sink: &mut S,
        recorder: &mut R,
    ) -> ControlFlow<()> {
        let mut top = (self.nodes.len() as u32, volume.mask());
        // What lies below the innermost straddling node; its own root, never
        // taken off, ends with the walk.
        let mut below = Stack::new(top);
        let mut at = 0;
        while let Some(node) = self.nodes.get(at as usize) {
            while at >= top.0 {
                top = below.pop().unwrap_or(top);
            }
            recorder.node_tested();
            let (verdict, mask) = volume.classify(&node.bounds, top.1, recorder);
            match verdict {
                Containment::Outside => {
                    recorder.subtree_rejected();
                    at = node.after;
                }
                Containment::Inside => {
                    recorder.subtree_accepted(node.count as usize);
                    sink.accept_places(isa, &self.ids, node.items())?;
                    at = node.after;
                }
                Containment::Straddles => {
                    at += 1;
                    if node.after == at {
                        self.test_items(isa, node.items(), (volume, mask), sink, recorder)?;
                    } else {
                        below.push(top);
                        top = (node.after, mask);
                    }
                }
            }
        }
        ControlFlow::Continue(())
    }

    /// Asks for some items, their bounds and ids, ahead of their use.
    #[inline(always)]
    pub fn prefetch_items(&self, items: Range<usize>) {
        for (start, _, block) in self.boxes.range(items.start, items.end) {
            block.prefetch();
            prefetch(&self.ids[start]);
        }
    }

    /// Appends the ids of those items whose closed box holds `p`.
    #[inline(always)]
    pub fn collect_holding(&self, items: Range<usize>, p: Vec3, ids: &mut Vec<ItemId>) {
        for (start, lanes, block) in self.boxes.range(items.start, items.end) {
            let mut held = block.holding(p) & lanes;
            while held != 0 {
                ids.push(self.ids[start + held.trailing_zeros() as usize]);
                held &= held - 1;
            }
        }
    }

    /// Tests items block by block and hands over runs of admitted ones.
    #[inline(always)]
    pub fn test_items<I: Isa, Q: QueryVolume, S: Sink, R: Recorder>(
        &self,
        isa: I,
        items: Range<usize>,
        (volume, mask): (&Q, PlaneMask),
        sink: &mut S,
        recorder: &mut R,
    ) -> ControlFlow<()> {
        self.leaves(volume).test(isa, items, mask, sink, recorder)
    }

    /// Takes over the new bounds of moved items without changing the tree's
    /// shape: nodes on the way to them are fitted anew. False, with the tree
    /// unchanged, if an item enters or leaves the tree (it is or was empty).
    ///
    /// O(moved * depth), or O(nodes) where that is less. `fitted` is told of
    /// every node that changed, children first.
    pub fn refit(
        &mut self,
        items: &[Aabb],
        moved: &[ItemId],
        mut fitted: impl FnMut(&PackedTree, usize),
    ) -> bool {
        if self.place_of.len() != items.len() {
            self.place_of = vec![ABSENT; items.len()];
            for (place, &id) in self.ids.iter().enumerate() {
                self.place_of[id as usize] = place as u32;
            }
        }
        let stays = |id: &ItemId| {
            let (was, is) = (
                self.place_of[*id as usize] != ABSENT,
                !items[*id as usize].is_empty(),
            );
            was == is
        };
        if !moved.iter().all(stays) {
            return false;
        }
        let mut dirty = vec![false; self.nodes.len()];
        let all = moved.len() * self.depth.max(1) > self.nodes.len();
        for &id in moved {
            let place = self.place_of[id as usize];
            if place != ABSENT {
                self.boxes.set(place as usize, &items[id as usize]);
                if !all {
                    self.mark_path(place as usize, &mut dirty);
                }
            }
        }
        let mut whole = true;
        for node in (0..self.nodes.len())
            .rev()
            .filter(|&node| all || dirty[node])
        {
            self.fit(node);
            whole &= self.bundles.fit(node, &self.nodes[node].bounds);
            fitted(self, node);
        }
        if !whole {
            self.bundles = Bundles::of(&self.nodes);
        }
        true
    }

    /// Marks the nodes from the root to the leaf that holds a place.
    fn mark_path(&self, place: usize, dirty: &mut [bool]) {
        let mut node = 0;
        loop {
            dirty[node] = true;
            if self.is_leaf(node) {
                return;
            }
            node += 1;
            while !self.nodes[node].items().contains(&place) {
                node = self.nodes[node].after();
            }
        }
    }

    /// A node's bounds from its children, or from its items if it is a leaf.
    fn fit(&mut self, node: usize) {
        let mut bounds = Aabb::EMPTY;
        if self.is_leaf(node) {
            for place in self.nodes[node].items() {
                bounds = bounds.union(&self.boxes.get(place));
            }
        }
        let mut child = node + 1;
        while child < self.nodes[node].after() {
            bounds = bounds.union(&self.nodes[child].bounds);
            child = self.nodes[child].after();
        }
        self.nodes[node].bounds = bounds;
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::kernel::BASELINE;
    use crate::query::{Count, NoRecorder, QueryContext};

    /// A degenerate list of a tree: each node has one leaf and the rest.
    fn comb(items: &[Aabb]) -> PackedTree {
        let mut writer = TreeWriter::with_capacity(items.len());
        let mut open = Vec::new();
        for (id, b) in items.iter().enumerate() {
            open.push(writer.open());
            let leaf = writer.open();
            writer.push(id as ItemId, b);
            writer.close(leaf);
        }
        while let Some(node) = open.pop() {
            writer.close(node);
        }
        writer.finish()
    }

    fn row(count: usize) -> Vec<Aabb> {
        let place = |i| Vec3::new(i as f32, -(i as f32), 0.1);
        (0..count)
            .map(|i| Aabb::around(place(i), Vec3::splat(0.3)))
            .collect()
    }

    #[test]
    fn a_tree_of_a_hundred_thousand_levels_is_walked_without_recursion() {
        let items = row(100_000);
        let tree = comb(&items);
        assert_eq!(tree.depth(), 100_001);
        let mut all = Count::default();
        let everything = Aabb::new(Vec3::splat(-1e9), Vec3::splat(1e9));
        let _ = tree.walk(
            &everything,
            &mut QueryContext::new(BASELINE, &mut all, &mut NoRecorder),
        );
        assert_eq!(all.0, 100_000);
        for id in [0, 50_000, 99_999] {
            let mut found = Vec::new();
            let _ = tree.query(
                &items[id].centre(),
                &mut QueryContext::new(BASELINE, &mut found, &mut NoRecorder),
            );
            assert_eq!(found, [id as ItemId]);
        }
    }

    fn assert_fitted(tree: &PackedTree, items: &[Aabb]) {
        for node in &tree.nodes {
            let own = tree.ids[node.items()].iter().map(|&id| &items[id as usize]);
            assert_eq!(node.bounds, Aabb::union_of(own));
        }
    }

    #[test]
    fn nodes_hold_the_exact_union_of_their_items_also_after_moves() {
        let mut items = row(40);
        let mut tree = comb(&items);
        assert_fitted(&tree, &items);
        for moved in [vec![3], vec![39, 0], (0..40).collect::<Vec<ItemId>>()] {
            for &id in &moved {
                items[id as usize] = Aabb::around(Vec3::splat(id as f32 * 7.0), Vec3::ONE);
            }
            assert!(tree.refit(&items, &moved, |_, _| ()));
            assert_fitted(&tree, &items);
        }
        items[5] = Aabb::EMPTY;
        assert!(
            !tree.refit(&items, &[5], |_, _| ()),
            "an item that leaves needs a rebuild"
        );
    }
}
