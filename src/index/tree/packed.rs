//! The packed tree: layout, construction, memory, refit. Queries are in `search`.
//!
//! Nodes are in depth-first order, items in the order of their leaves ("tree order"), so
//! that every subtree is one slice of either. Item bounds are in blocks of sixteen.

use super::node::{TreeNode, children, is_leaf};
use super::wide_nodes::WideNodes;
use crate::geometry::{Aabb, BoxBlocks, LANES};
use crate::index::items::{Dirty, Positions};
use crate::index::{MemoryUsage, TreeCell};
use crate::kernel::prefetch;
use crate::query::ItemId;

/// A tree packed for queries.
///
/// 28 bytes per item. Nodes have at most sixteen children and take 110 to 160 bytes each, blocks of
/// sixteen included.
#[derive(Default)]
pub struct PackedTree {
    /// In depth-first order.
    nodes: Vec<TreeNode>,
    /// Item bounds in tree order.
    boxes: BoxBlocks,
    /// Item ids in tree order.
    ids: Vec<ItemId>,
    /// The nodes again, sixteen to a block, for queries by volumes.
    pub(super) wide_nodes: WideNodes,
    positions: Positions,
    /// The leaf of each position, from the first refit on.
    leaves: Vec<u32>,
    /// The parent of each node, from the first refit on; the root is its own parent.
    parents: Vec<u32>,
}

impl PackedTree {
    /// Builds a tree in depth-first order from the group of its root.
    ///
    /// `expand` is called once per node with the tree so far, the node's index and its group: it
    /// either [pushes](PackedTree::push) the items of a leaf or lists the groups of the children,
    /// in order. Iterative, so that a degenerate tree cannot overflow the stack.
    ///
    /// # Panics
    /// If a node has more than sixteen children.
    pub fn grow<G>(
        items: usize,
        root: G,
        mut expand: impl FnMut(&mut PackedTree, usize, G, &mut Vec<G>),
    ) -> PackedTree {
        enum Task<G> {
            Open(G),
            Close(usize),
        }
        let mut tree = PackedTree {
            boxes: BoxBlocks::with_capacity(items),
            ids: Vec::with_capacity(items),
            ..PackedTree::default()
        };
        let (mut tasks, mut groups) = (vec![Task::Open(root)], Vec::new());
        while let Some(task) = tasks.pop() {
            match task {
                Task::Open(group) => {
                    let node = tree.nodes.len();
                    tree.nodes.push(TreeNode {
                        first: tree.ids.len() as u32,
                        ..TreeNode::default()
                    });
                    tasks.push(Task::Close(node));
                    expand(&mut tree, node, group, &mut groups);
                    let count = groups.len();
                    assert!(count <= LANES, "{count} children; expected at most {LANES}");
                    tasks.extend(groups.drain(..).rev().map(Task::Open));
                }
                Task::Close(node) => {
                    let (after, items) = (tree.nodes.len(), tree.ids.len());
                    let closed = &mut tree.nodes[node];
                    closed.count = items as u32 - closed.first;
                    closed.after = after as u32;
                    tree.fit(node);
                }
            }
        }
        tree.nodes.shrink_to_fit();
        tree.boxes.shrink_to_fit();
        tree.ids.shrink_to_fit();
        tree.wide_nodes = WideNodes::new(&tree.nodes);
        tree
    }

    /// Adds an item to the leaf that is being expanded.
    pub fn push(&mut self, id: ItemId, bounds: &Aabb) {
        self.ids.push(id);
        self.boxes.push(bounds);
    }

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

    /// The root, followed by the lanes of the wide nodes below it.
    pub fn cells(&self) -> Vec<TreeCell<'_>> {
        let mut cells = Vec::new();
        let below = (!self.wide_nodes.blocks.is_empty()).then_some(0);
        let root = self.nodes.first();
        // The last entry is the next cell; a cell without a wide node below it keeps items.
        let mut open = Vec::from_iter(root.map(|root| (0, root.bounds, root.items(), below)));
        while let Some((level, bounds, items, below)) = open.pop() {
            cells.push(TreeCell {
                level,
                bounds,
                half_space: None,
                items: below.map_or(&self.ids[items], |_| &[]),
            });
            let Some(at) = below else { continue };
            let (links, block) = (&self.wide_nodes.links[at], &self.wide_nodes.blocks[at]);
            for lane in (0..LANES).rev().filter(|lane| links.lanes >> lane & 1 == 1) {
                let items = links.first[lane] as usize..links.end[lane] as usize;
                let below = (links.leaves >> lane & 1 == 0).then_some(links.below[lane] as usize);
                open.push((level + 1, block.get(lane), items, below));
            }
        }
        cells
    }

    /// Bytes of nodes and of items, as allocated.
    pub fn memory(&self) -> MemoryUsage {
        MemoryUsage {
            node_bytes: size_of_val(&self.nodes[..])
                + self.wide_nodes.bytes()
                + size_of_val(&self.leaves[..])
                + size_of_val(&self.parents[..]),
            item_bytes: self.boxes.bytes() + size_of_val(&self.ids[..]) + self.positions.bytes(),
        }
    }

    /// Takes over the new bounds of moved items: refits the nodes above them.
    ///
    /// The tree's shape does not change. False, with the tree unchanged, if an item becomes or
    /// ceases to be empty.
    ///
    /// Calls `fitted` for every node that changed, children first. O(moved * depth).
    pub fn refit(
        &mut self,
        items: &[Aabb],
        moved: &[ItemId],
        mut fitted: impl FnMut(&PackedTree, usize),
    ) -> bool {
        self.positions.prepare(self.ids.iter(), items.len());
        let stays = |&id: &ItemId| self.positions.of(id).is_none() == items[id as usize].is_empty();
        if !moved.iter().all(stays) {
            return false;
        }
        if self.parents.is_empty() {
            self.find_paths();
        }
        let mut changed = Dirty::none(self.nodes.len());
        for (i, &id) in moved.iter().enumerate() {
            if let Some(position) = self.positions.ahead(items, moved, i) {
                self.boxes.prefetch(position);
                prefetch(&self.leaves[position]);
            }
            let Some(position) = self.positions.of(id) else {
                continue;
            };
            self.boxes.set(position, &items[id as usize]);
            let mut node = self.leaves[position] as usize;
            while changed.mark(node) {
                node = self.parents[node] as usize;
            }
        }
        for word in (0..changed.words()).rev() {
            for node in changed.of_word(word).rev() {
                self.fit(node);
                self.wide_nodes.refit(node, &self.nodes[node].bounds);
                fitted(self, node);
            }
        }
        true
    }

    /// Computes the leaf of each position and the parent of each node.
    fn find_paths(&mut self) {
        self.leaves.resize(self.ids.len(), 0);
        self.parents.resize(self.nodes.len(), 0);
        for node in 0..self.nodes.len() {
            for child in children(&self.nodes, node) {
                self.parents[child] = node as u32;
            }
            if is_leaf(&self.nodes, node) {
                self.leaves[self.nodes[node].items()].fill(node as u32);
            }
        }
    }

    /// Computes a node's bounds from its children, or a leaf's from its items.
    fn fit(&mut self, node: usize) {
        let mut bounds = Aabb::EMPTY;
        if is_leaf(&self.nodes, node) {
            for position in self.nodes[node].items() {
                bounds = bounds.union(&self.boxes.get(position));
            }
        }
        for child in children(&self.nodes, node) {
            bounds = bounds.union(&self.nodes[child].bounds);
        }
        self.nodes[node].bounds = bounds;
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::kernel::Plain;
    use crate::query::{Count, NoRecorder, QueryContext};
    use glam::Vec3;

    /// A degenerate tree: each node has a leaf and the remaining items as children.
    fn comb(items: &[Aabb]) -> PackedTree {
        enum Group {
            Rest(usize),
            Item(usize),
        }
        PackedTree::grow(
            items.len(),
            Group::Rest(0),
            |tree, _, group, groups| match group {
                Group::Item(id) => tree.push(id as ItemId, &items[id]),
                Group::Rest(from) => {
                    groups.push(Group::Item(from));
                    groups.extend((from + 1 < items.len()).then_some(Group::Rest(from + 1)));
                }
            },
        )
    }

    fn row(count: usize) -> Vec<Aabb> {
        let centre = |i| Vec3::new(i as f32, -(i as f32), 0.1);
        (0..count)
            .map(|i| Aabb::around(centre(i), Vec3::splat(0.3)))
            .collect()
    }

    #[test]
    fn a_tree_of_a_hundred_thousand_levels_is_walked_without_recursion() {
        let items = row(100_000);
        let tree = comb(&items);
        assert!(tree.cells().len() > items.len());
        let mut all = Count::default();
        let everything = Aabb::new(Vec3::splat(-1e9), Vec3::splat(1e9));
        let _ = tree.query(
            &everything,
            &mut QueryContext::new(Plain, &mut all, &mut NoRecorder),
        );
        assert_eq!(all.0, 100_000);
        for id in [0, 50_000, 99_999] {
            let mut found = Vec::new();
            let _ = tree.query(
                &items[id].centre(),
                &mut QueryContext::new(Plain, &mut found, &mut NoRecorder),
            );
            assert_eq!(found, [id as ItemId]);
        }
    }

    #[test]
    fn nodes_are_grouped_alike_at_any_scale() {
        let lanes = |scale: f32| {
            let place = |i: u32| Vec3::new((i * i) as f32, (i % 7) as f32, 0.5);
            let items = (0..300).map(|i| Aabb::around(place(i), Vec3::ONE).scaled(scale));
            let items: Vec<Aabb> = items.collect();
            let tree = PackedTree::grow(items.len(), 0..items.len(), |tree, _, group, groups| {
                let middle = group.start.midpoint(group.end);
                match group.len() {
                    1 => tree.push(group.start as ItemId, &items[group.start]),
                    _ => groups.extend([group.start..middle, middle..group.end]),
                }
            });
            let links = tree.wide_nodes.links.iter();
            links.map(|links| links.first).collect::<Vec<_>>()
        };
        let usual = lanes(1.0);
        assert!(usual.len() > 16);
        for power in [66, -100] {
            assert_eq!(lanes(libm::ldexpf(1.0, power)), usual, "2^{power}");
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
