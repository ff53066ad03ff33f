//! The nodes of a tree grouped sixteen to a block: layout, construction and refit.
//!
//! A query by a volume tests sixteen nodes at once.

use std::collections::VecDeque;

use super::node::{TreeNode, children, is_leaf};
use crate::geometry::{Aabb, BoxBlock, LANES, LaneMask};
use crate::kernel::prefetch;

/// Subtrees behind the lanes of a wide node.
#[derive(Clone, Copy, Default)]
#[repr(C, align(64))]
pub struct Links {
    /// The wide node of a lane's children; for a leaf, its tree node.
    pub below: [u32; LANES],
    /// First item of each lane in tree order.
    pub first: [u32; LANES],
    /// End of each lane's items.
    pub end: [u32; LANES],
    /// Lanes that hold a node.
    pub lanes: LaneMask,
    /// Lanes that hold a leaf.
    pub leaves: LaneMask,
}

/// A tree of wide nodes: sixteen lanes each, in tree order.
///
/// The lanes of a wide node are any descendants of one tree node. 40 bytes per lane.
#[derive(Default)]
pub struct WideNodes {
    pub blocks: Vec<BoxBlock>,
    pub links: Vec<Links>,
    /// The lane of each tree node, numbered over all wide nodes; or [`NO_LANE`].
    lane_of: Vec<u32>,
}

/// Mark of a tree node that its children replace.
const NO_LANE: u32 = u32::MAX;

impl WideNodes {
    /// Groups the nodes of a tree in depth-first order.
    ///
    /// Nodes are replaced by their children, the largest surface first, as long as they fit: the
    /// largest node is the likeliest to straddle (Wald, Benthin and Boulos 2008, "Getting rid of
    /// packets", p. 52). No wide node if the root is a leaf. O(nodes).
    pub fn new(nodes: &[TreeNode]) -> WideNodes {
        let mut wide = WideNodes {
            lane_of: vec![NO_LANE; nodes.len()],
            ..WideNodes::default()
        };
        if nodes.is_empty() || is_leaf(nodes, 0) {
            return wide;
        }
        let scale = nodes[0].bounds.scale_for_areas();
        // Breadth first, so that wide nodes of one level are adjacent.
        let mut waiting = VecDeque::from([0]);
        let mut queued = 1;
        while let Some(parent) = waiting.pop_front() {
            let mut links = Links::default();
            let mut block = BoxBlock::EMPTY;
            for (lane, node) in lanes_of(nodes, parent, scale).enumerate() {
                block.set(lane, &nodes[node].bounds);
                links.first[lane] = nodes[node].first;
                links.end[lane] = nodes[node].items().end as u32;
                links.lanes |= 1 << lane;
                wide.lane_of[node] = (wide.blocks.len() * LANES + lane) as u32;
                if is_leaf(nodes, node) {
                    links.below[lane] = node as u32;
                    links.leaves |= 1 << lane;
                } else {
                    links.below[lane] = queued;
                    queued += 1;
                    waiting.push_back(node);
                }
            }
            wide.blocks.push(block);
            wide.links.push(links);
        }
        wide.blocks.shrink_to_fit();
        wide.links.shrink_to_fit();
        wide
    }

    /// Takes over a node's new bounds.
    pub fn refit(&mut self, node: usize, bounds: &Aabb) {
        let lane = self.lane_of[node];
        if lane != NO_LANE {
            let lane = lane as usize;
            self.blocks[lane / LANES].set(lane % LANES, bounds);
        }
    }

    /// Prefetches the wide node of an entry of a frontier, if there is such an entry.
    #[inline(always)]
    pub fn prefetch(&self, entries: &[u32], i: usize) {
        if let Some(&next) = entries.get(i)
            && let Some(block) = self.blocks.get(next as usize)
        {
            block.prefetch();
            let links = &self.links[next as usize];
            prefetch(&links.below);
            prefetch(&links.lanes);
        }
    }

    /// Heap bytes.
    pub fn bytes(&self) -> usize {
        size_of_val(&self.blocks[..])
            + size_of_val(&self.links[..])
            + size_of_val(&self.lane_of[..])
    }
}

/// Descendants of a node that its block holds, at most sixteen, in tree order.
fn lanes_of(nodes: &[TreeNode], parent: usize, scale: f32) -> impl Iterator<Item = usize> {
    let area = |node: usize| nodes[node].bounds.scaled(scale).half_area();
    let below = |node| children(nodes, node).map(|child| (area(child), child));
    let mut lanes: Vec<(f32, usize)> = below(parent).collect();
    loop {
        let fits = |node| {
            !is_leaf(nodes, node) && lanes.len() + children(nodes, node).count() <= LANES + 1
        };
        let largest = (0..lanes.len())
            .filter(|&lane| fits(lanes[lane].1))
            .max_by(|&a, &b| lanes[a].0.total_cmp(&lanes[b].0));
        let Some(lane) = largest else {
            return lanes.into_iter().map(|(_, node)| node);
        };
        let node = lanes[lane].1;
        lanes.splice(lane..=lane, below(node));
    }
}
