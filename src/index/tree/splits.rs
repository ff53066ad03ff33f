//! Region search by dividing planes of any direction.
//!
//! One plane per inner node of a binary tree, one dot product each.

use std::ops::ControlFlow;

use glam::Vec3;

use super::node::{Stack, is_leaf};
use super::packed::PackedTree;
use crate::geometry::Plane;
use crate::query::{Context, Predicate, Recorder};

/// The normal of a node's plane and how far its two sides reach along it.
#[derive(Clone, Copy, Default, Debug)]
pub struct Split {
    normal: Vec3,
    /// Greatest position of the back side along the normal.
    back_high: f32,
    /// Least position of the front side along the normal.
    front_low: f32,
}

impl Split {
    /// The splits of a tree by the normals of its nodes; those of leaves are unused.
    pub fn all(tree: &PackedTree, normals: Vec<Vec3>) -> Vec<Split> {
        let fitted = |(node, normal)| {
            let mut split = Split {
                normal,
                ..Split::default()
            };
            split.fit(tree, node);
            split
        };
        normals.into_iter().enumerate().map(fitted).collect()
    }

    /// Computes how far the two sides of a node reach, from the bounds of its children.
    pub fn fit(&mut self, tree: &PackedTree, node: usize) {
        if is_leaf(tree.nodes(), node) {
            return;
        }
        let back = &tree.nodes()[node + 1];
        let front = &tree.nodes()[back.after()];
        let along = self.along();
        self.back_high = along.value_at(along.p_vertex(&back.bounds));
        self.front_low = along.value_at(along.n_vertex(&front.bounds));
    }

    /// Position along the normal, by the plane test's own arithmetic.
    ///
    /// Monotone: a point of an item never lies beyond the item's corner.
    #[inline(always)]
    fn along(&self) -> Plane {
        Plane::new(self.normal, 0.0)
    }
}

/// Passes every item whose closed box holds `p` to the sink, in tree order.
#[inline(always)]
pub fn locate<C: Context>(
    tree: &PackedTree,
    splits: &[Split],
    p: Vec3,
    cx: &mut C,
) -> ControlFlow<()> {
    let nodes = tree.nodes();
    let mut open = Stack::new(0);
    while let Some(at) = open.pop() {
        let mut at = at as usize;
        // An empty tree has no node 0.
        while let Some(node) = nodes.get(at) {
            cx.recorder().nodes_tested(1);
            if is_leaf(nodes, at) {
                tree.test_items(node.items(), (&p, p.mask()), cx)?;
                break;
            }
            let split = &splits[at];
            let value = split.along().value_at(p);
            let front = nodes[at + 1].after();
            // Not `<=`: with a NaN (coordinates beyond f32) both sides are entered.
            let beyond_back = value > split.back_high;
            let before_front = value < split.front_low;
            at = match (beyond_back, before_front) {
                (true, true) => break,
                (true, false) => front,
                (false, true) => at + 1,
                (false, false) => {
                    open.push(front as u32);
                    at + 1
                }
            };
        }
    }
    ControlFlow::Continue(())
}
