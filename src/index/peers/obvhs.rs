//! The crate obvhs by its own tree: its nodes in its order, its ids through
//! `primitive_indices`. It has no frustum traversal, so its public nodes are
//! walked as its own traversals do; or its `aabb_traverse` finds candidates.
//! Our re-laid tree of the same builder is the structure `bvh`.

use std::ops::ControlFlow;

use glam::Vec3;
use obvhs::BvhBuildParams;
use obvhs::bvh2::Bvh2;
use obvhs::bvh2::node::Bvh2Node;

use super::{BoxTest, Record, Tally, half_of_largest, peer_of_tree, refuse_stacks};
use crate::geometry::Aabb;
use crate::index::stack::Stack;
use crate::index::{BuildError, MemoryUsage, ploc};
use crate::query::{ItemId, Recorder, Sink};

/// A tree of obvhs with the items in the order of its primitives.
#[derive(Default)]
struct Tree {
    bvh: Bvh2,
    /// Empty where every leaf is one item, whose bounds are then the leaf's.
    boxes: Vec<Aabb>,
    ids: Vec<ItemId>,
    /// Half the size of the largest item on each axis.
    half: Vec3,
}

#[inline(always)]
fn bounds_of(node: &Bvh2Node) -> Aabb {
    Aabb::new(node.min, node.max)
}

impl Tree {
    fn build(
        structure: &'static str,
        items: Vec<Record>,
        params: BvhBuildParams,
    ) -> Result<Tree, BuildError> {
        refuse_stacks(structure, &items)?;
        if items.is_empty() {
            return Ok(Tree::default());
        }
        let boxes: Vec<Aabb> = items.iter().map(|item| item.bounds).collect();
        let mut bvh = ploc::build_as_it_comes(&boxes, params);
        bvh.reorder_in_stack_traversal_order();
        // A walk keeps one entry a level; the crate's default is 96.
        bvh.max_depth = bvh.max_depth.max(bvh.depth(0) + 2);
        let single = bvh.nodes.iter().all(|node| node.prim_count <= 1);
        let of = |&place: &u32| items[place as usize];
        Ok(Tree {
            boxes: match single {
                true => Vec::new(),
                false => bvh.primitive_indices.iter().map(|p| of(p).bounds).collect(),
            },
            ids: bvh.primitive_indices.iter().map(|p| of(p).id).collect(),
            half: half_of_largest(&items),
            bvh,
        })
    }

    fn memory(&self) -> MemoryUsage {
        let bvh = &self.bvh;
        let places = [
            &bvh.primitive_indices,
            &bvh.primitives_to_nodes,
            &bvh.parents,
        ];
        let leaves = match self.boxes.is_empty() {
            true => self.ids.len() * size_of::<Bvh2Node>(),
            false => 0,
        };
        MemoryUsage {
            node_bytes: bvh.nodes.capacity() * size_of::<Bvh2Node>() - leaves
                + places.iter().map(|list| list.capacity() * 4).sum::<usize>(),
            item_bytes: leaves + size_of_val(&self.boxes[..]) + size_of_val(&self.ids[..]),
        }
    }

    /// Hands over the items of a leaf that was not rejected.
    #[inline(always)]
    fn leaf<T: BoxTest, S: Sink, R: Recorder>(
        &self,
        node: &Bvh2Node,
        test: &T,
        sink: &mut S,
        tally: &Tally<'_, R>,
    ) -> ControlFlow<()> {
        let first = node.first_index as usize;
        for place in first..first + node.prim_count as usize {
            tally.item(test);
            let admitted = match self.boxes.get(place) {
                Some(b) => test.admits(b),
                None => test.admits(&bounds_of(node)),
            };
            if admitted {
                sink.accept(&self.ids[place..=place])?;
            }
        }
        ControlFlow::Continue(())
    }

    /// The walk: pairs of children from a stack, as in the crate's own
    /// `point_traverse`.
    #[inline(always)]
    fn walk<T: BoxTest, S: Sink, R: Recorder>(
        &self,
        test: &T,
        sink: &mut S,
        recorder: &mut R,
    ) -> ControlFlow<()> {
        let tally = Tally::new(recorder);
        let nodes = &self.bvh.nodes[..];
        let Some(root) = nodes.first() else {
            return ControlFlow::Continue(());
        };
        if root.is_leaf() {
            return self.leaf(root, test, sink, &tally);
        }
        tally.node(test);
        if test.rejects(&bounds_of(root)) {
            return ControlFlow::Continue(());
        }
        let mut open = Stack::new((root.first_index, ()));
        while let Some((first, ())) = open.pop() {
            for node in [&nodes[first as usize], &nodes[first as usize + 1]] {
                // A leaf of one item has the item's bounds: no test of its own.
                let single = node.prim_count == 1;
                if !single {
                    tally.node(test);
                    if test.rejects(&bounds_of(node)) {
                        continue;
                    }
                }
                if node.is_leaf() {
                    self.leaf(node, test, sink, &tally)?;
                } else {
                    open.push((node.first_index, ()));
                }
            }
        }
        ControlFlow::Continue(())
    }

    /// `aabb_traverse` with the bounds of the view, then the test.
    #[inline(always)]
    fn candidates<T: BoxTest, S: Sink, R: Recorder>(
        &self,
        test: &T,
        sink: &mut S,
        recorder: &mut R,
    ) -> ControlFlow<()> {
        let Some(root) = self.bvh.nodes.first() else {
            return ControlFlow::Continue(());
        };
        let tally = Tally::new(recorder);
        tally.count(R::node_tested);
        let scene = bounds_of(root);
        if test.rejects(&scene) {
            return ControlFlow::Continue(());
        }
        let asked = test.centres(self.half, &scene);
        let asked = obvhs::aabb::Aabb::new(asked.min.into(), asked.max.into());
        let mut flow = ControlFlow::Continue(());
        self.bvh.aabb_traverse(asked, |bvh, leaf| {
            flow = self.leaf(&bvh.nodes[leaf as usize], test, sink, &tally);
            flow.is_continue()
        });
        flow
    }
}

peer_of_tree!(
    /// obvhs as it comes: the middle preset, its public nodes walked.
    PeerObvhs,
    "peer-obvhs",
    "crate obvhs, medium build, its own nodes walked",
    "obvhs",
    Tree,
    BvhBuildParams::medium_build(),
    walk
);

peer_of_tree!(
    /// The preset that was fastest for views: one item a leaf.
    PeerObvhsTuned,
    "peer-obvhs-tuned",
    "crate obvhs, very slow build, one item a leaf, nodes in stack order, walked",
    "obvhs",
    Tree,
    ploc::ONE_A_LEAF,
    walk
);

peer_of_tree!(
    /// The crate's own `aabb_traverse`, asked with the bounds of the view.
    PeerObvhsAabb,
    "peer-obvhs-aabb",
    "crate obvhs, as tuned: aabb_traverse with the view's bounds, then the items' test",
    "obvhs",
    Tree,
    ploc::ONE_A_LEAF,
    candidates
);
