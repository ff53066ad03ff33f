//! The textbook bounding volume hierarchy: the binary tree of the crate obvhs, its
//! nodes visited one at a time.

use obvhs::BvhBuildParams;
use obvhs::bvh2::Bvh2;
use obvhs::bvh2::node::Bvh2Node;

use super::{Division, Node, Textbook, TextbookParams};
use crate::geometry::Aabb;
use crate::index::items::Record;
use crate::index::{Input, ploc};

/// A bounding volume hierarchy (Clark 1976, "Hierarchical geometric models for
/// visible surface algorithms"; the crate builds it bottom-up, by PLOC: Meister and
/// Bittner 2018). O(log n + answers) per query.
///
/// The lecture on visibility does not name it; engines use it instead of the lecture's
/// trees.
pub type BvhTextbook = Textbook<ObvhsNodes>;

/// Division of [`BvhTextbook`].
pub struct ObvhsNodes;

impl Division for ObvhsNodes {
    const NAME: &str = "bvh-textbook";
    const SUMMARY: &str = "lecture form: the nodes of crate obvhs, one at a time";

    fn root(input: &Input<'_>, mut records: Vec<Record>, params: &TextbookParams) -> Node {
        // Items with identical bounds are one primitive for the builder, whose search for
        // the nearest neighbour fails among them.
        let key = |r: &Record| r.bounds.bits();
        records.sort_unstable_by_key(|r| (key(r), r.id));
        let stacks: Vec<&[Record]> = records.chunk_by(|a, b| key(a) == key(b)).collect();
        // At unit size: the builder compares areas, which must not overflow.
        let reach = Aabb::union_of(input.items).reach().max_element();
        let scale = reach.recip().min(f32::MAX);
        let scaled = |b: &Aabb| Aabb::new(b.min * scale, b.max * scale);
        let boxes = stacks.iter().map(|stack| scaled(&stack[0].bounds));
        let config = BvhBuildParams {
            max_prims_per_leaf: params.leaf.min(255),
            ..BvhBuildParams::medium_build()
        };
        let built = ploc::build(&boxes.collect::<Vec<_>>(), config);
        subtree(&built, built.nodes[0], params.depth, &stacks)
    }
}

/// A node of obvhs with the exact bounds of its items, which the builder rounds.
///
/// At the deepest level allowed it keeps the items of all leaves below: the builder's
/// trees may be deeper.
fn subtree(built: &Bvh2, node: Bvh2Node, levels: u32, stacks: &[&[Record]]) -> Node {
    let children = |node: &Bvh2Node| {
        let first = node.first_index as usize;
        [built.nodes[first], built.nodes[first + 1]]
    };
    if levels > 0 && !node.is_leaf() {
        let below = children(&node).map(|child| subtree(built, child, levels - 1, stacks));
        let mut inner = Node::with(below[0].bounds.union(&below[1].bounds), &[]);
        inner.children = below.into();
        return inner;
    }
    let (mut records, mut open) = (Vec::new(), vec![node]);
    while let Some(node) = open.pop() {
        let (first, count) = (node.first_index as usize, node.prim_count as usize);
        match node.is_leaf() {
            true => {
                for &stack in &built.primitive_indices[first..first + count] {
                    records.extend_from_slice(stacks[stack as usize]);
                }
            }
            false => open.extend(children(&node)),
        }
    }
    let bounds = Aabb::union_of(records.iter().map(|record| &record.bounds));
    Node::with(bounds, &records)
}
