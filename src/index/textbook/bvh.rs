//! The textbook bounding volume hierarchy: the binary tree of the crate obvhs, its
//! own nodes gone through one at a time.

use obvhs::BvhBuildParams;
use obvhs::bvh2::node::Bvh2Node;

use super::{Items, Node, Slice, TextbookParams, answered_by_walk};
use crate::geometry::Aabb;
use crate::index::partition::Record;
use crate::index::{BuildError, Info, Input, Kind, MemoryUsage, Origin, RegionIndex, ploc};
use crate::query::ItemId;

/// A bounding volume hierarchy (Clark 1976, "Hierarchical geometric models for
/// visible surface algorithms"; the crate builds it bottom-up, by PLOC: Meister and
/// Bittner 2018). O(log n + answers) per query.
///
/// The lecture on visibility does not name it; it is what engines have in place of
/// its trees. Nodes are obvhs's, two children side by side; items lie in the order
/// of the leaves.
pub struct BvhTextbook {
    nodes: Vec<Bvh2Node>,
    items: Items,
}

/// A node in its tree.
#[derive(Clone, Copy)]
struct At<'t> {
    tree: &'t BvhTextbook,
    node: &'t Bvh2Node,
}

impl Node for At<'_> {
    #[inline]
    fn bounds(&self) -> Aabb {
        Aabb::new(self.node.min, self.node.max)
    }
    #[inline]
    fn items(&self) -> Slice<'_> {
        let (first, count) = (self.node.first_index, self.node.prim_count);
        let places = match self.node.is_leaf() {
            true => first as usize..(first + count) as usize,
            false => 0..0,
        };
        let Items { boxes, ids } = &self.tree.items;
        (&boxes[places.clone()], &ids[places])
    }
    #[inline]
    fn children(self) -> impl Iterator<Item = Self> {
        let first = self.node.first_index as usize;
        let children = match self.node.is_leaf() {
            true => 0..0,
            false => first..first + 2,
        };
        let tree = self.tree;
        tree.nodes[children].iter().map(|node| At { tree, node })
    }
}

impl BvhTextbook {
    fn root(&self) -> Option<At<'_>> {
        let node = self.nodes.first()?;
        Some(At { tree: self, node })
    }

    /// Lays the items of a subtree out in its order and fits its nodes; its bounds.
    /// The deepest level that is allowed keeps all that is below it: the builder's
    /// trees may be deeper.
    fn settle(&mut self, at: u32, levels: u32, stacks: &[&[Record]], order: &[u32]) -> Aabb {
        let node = self.nodes[at as usize];
        if levels > 0 && !node.is_leaf() {
            let [first, second] = [0, 1]
                .map(|child| self.settle(node.first_index + child, levels - 1, stacks, order));
            return self.bound(at, first.union(&second));
        }
        let first = self.items.ids.len();
        for &stack in &self.places(node, order) {
            for record in stacks[stack as usize] {
                self.items.boxes.push(record.bounds);
                self.items.ids.push(record.id);
            }
        }
        let leaf = &mut self.nodes[at as usize];
        leaf.first_index = first as u32;
        leaf.prim_count = (self.items.ids.len() - first) as u32;
        let bounds = Aabb::union_of(&self.items.boxes[first..]);
        self.bound(at, bounds)
    }

    /// What obvhs has in the leaves of a subtree, whose depth has no bound.
    fn places(&self, node: Bvh2Node, order: &[u32]) -> Vec<u32> {
        let (mut places, mut open) = (Vec::new(), vec![node]);
        while let Some(node) = open.pop() {
            let (first, count) = (node.first_index as usize, node.prim_count as usize);
            match node.is_leaf() {
                true => places.extend(&order[first..first + count]),
                false => open.extend(&self.nodes[first..first + 2]),
            }
        }
        places
    }

    /// Exact unions, whatever the builder has rounded.
    fn bound(&mut self, at: u32, bounds: Aabb) -> Aabb {
        let node = &mut self.nodes[at as usize];
        (node.min, node.max) = (bounds.min, bounds.max);
        bounds
    }
}

impl RegionIndex for BvhTextbook {
    const INFO: Info = Info::new(
        "bvh-textbook",
        "lecture form: the nodes of crate obvhs, one at a time",
        Kind::Tree,
        Origin::Ours,
    )
    .textbook();
    type Params = TextbookParams;

    fn build(input: &Input<'_>, params: &TextbookParams) -> Result<Self, BuildError> {
        let items = input.items;
        params.check(Self::INFO.name)?;
        let mut records = Record::all(items)?;
        let mut tree = BvhTextbook {
            nodes: Vec::new(),
            items: Items::default(),
        };
        if records.is_empty() {
            return Ok(tree);
        }
        // Items with the very same bounds are one to the builder, which finds no nearest
        // one among them.
        let key = |r: &Record| r.bounds.bits();
        records.sort_unstable_by_key(|r| (key(r), r.id));
        let stacks: Vec<&[Record]> = records.chunk_by(|a, b| key(a) == key(b)).collect();
        // At unit size: it compares areas, which must not overflow.
        let reach = Aabb::union_of(items).reach().max_element();
        let scale = reach.recip().min(f32::MAX);
        let scaled = |b: &Aabb| Aabb::new(b.min * scale, b.max * scale);
        let boxes: Vec<Aabb> = stacks
            .iter()
            .map(|stack| scaled(&stack[0].bounds))
            .collect();
        let config = BvhBuildParams {
            max_prims_per_leaf: params.leaf.min(255),
            ..BvhBuildParams::medium_build()
        };
        let built = ploc::build(&boxes, config);
        tree.nodes = built.nodes;
        tree.settle(0, params.depth, &stacks, &built.primitive_indices);
        Ok(tree)
    }

    fn memory(&self) -> MemoryUsage {
        let Items { boxes, ids } = &self.items;
        MemoryUsage {
            node_bytes: self.nodes.capacity() * size_of::<Bvh2Node>(),
            item_bytes: boxes.capacity() * size_of::<Aabb>() + ids.capacity() * size_of::<ItemId>(),
        }
    }

    answered_by_walk!();
}
