//! The nodes of a tree grouped sixteen to a block, so that a query by a volume
//! tests sixteen nodes at once. Layout, construction and refit.

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

/// A tree of wide nodes: sixteen lanes each, in tree order, any descendants of one
/// tree node. 40 bytes per lane.
#[derive(Default)]
pub struct WideNodes {
    pub blocks: Vec<BoxBlock>,
    pub links: Vec<Links>,
    /// The lane of each tree node, counted over all wide nodes; or [`NO_LANE`].
    lane_of: Vec<u32>,
    /// True if some lane stands for several siblings.
    has_groups: bool,
}

/// Mark of a tree node whose children take its place.
const NO_LANE: u32 = u32::MAX;

/// Sibling nodes that share a lane: adjoining subtrees.
type Siblings = Vec<usize>;

impl WideNodes {
    /// Groups the nodes of a tree in depth-first order. Nodes are replaced by their
    /// children, the largest surface first, as long as they fit: that node is the
    /// likeliest to straddle (Wald, Benthin and Boulos 2008, "Getting rid of
    /// packets", p. 52). No wide node if the root is a leaf. O(nodes).
    pub fn new(nodes: &[TreeNode]) -> WideNodes {
        let mut wide = WideNodes {
            lane_of: vec![NO_LANE; nodes.len()],
            ..WideNodes::default()
        };
        if nodes.is_empty() || is_leaf(nodes, 0) {
            return wide;
        }
        // Breadth first, so that wide nodes of one level are adjacent.
        let mut waiting = VecDeque::from([children(nodes, 0).collect::<Siblings>()]);
        let mut queued = 1;
        while let Some(siblings) = waiting.pop_front() {
            let mut links = Links::default();
            let mut block = BoxBlock::EMPTY;
            for (lane, siblings) in lanes_of(nodes, &siblings).into_iter().enumerate() {
                block.set(lane, &bounds_of(nodes, &siblings));
                let (first, last) = (siblings[0], siblings[siblings.len() - 1]);
                links.first[lane] = nodes[first].first;
                links.end[lane] = nodes[last].items().end as u32;
                links.lanes |= 1 << lane;
                let is_group = siblings.len() > 1;
                wide.has_groups |= is_group;
                if !is_group {
                    wide.lane_of[first] = (wide.blocks.len() * LANES + lane) as u32;
                }
                if !is_group && is_leaf(nodes, first) {
                    links.below[lane] = first as u32;
                    links.leaves |= 1 << lane;
                } else {
                    links.below[lane] = queued;
                    queued += 1;
                    waiting.push_back(match is_group {
                        true => siblings,
                        false => children(nodes, first).collect(),
                    });
                }
            }
            wide.blocks.push(block);
            wide.links.push(links);
        }
        wide.blocks.shrink_to_fit();
        wide.links.shrink_to_fit();
        wide
    }

    /// Takes over a node's new bounds. False if the wide nodes must be built again:
    /// some lane stands for several siblings, whose union no node has.
    #[must_use]
    pub fn refit(&mut self, node: usize, bounds: &Aabb) -> bool {
        let lane = self.lane_of[node];
        if lane != NO_LANE {
            let lane = lane as usize;
            self.blocks[lane / LANES].set(lane % LANES, bounds);
        }
        !self.has_groups
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

/// Distributes siblings over at most sixteen lanes, in tree order.
fn lanes_of(nodes: &[TreeNode], siblings: &[usize]) -> Vec<Siblings> {
    let share = siblings.len().div_ceil(LANES);
    let mut lanes: Vec<Siblings> = siblings.chunks(share).map(<[usize]>::to_vec).collect();
    let area = |lane: &Siblings| bounds_of(nodes, lane).half_area();
    let mut areas: Vec<f32> = lanes.iter().map(area).collect();
    loop {
        let fits = |lane: &Siblings| match lane[..] {
            [node] if !is_leaf(nodes, node) => {
                lanes.len() + children(nodes, node).count() <= LANES + 1
            }
            _ => false,
        };
        let largest = (0..lanes.len())
            .filter(|&i| fits(&lanes[i]))
            .max_by(|&a, &b| areas[a].total_cmp(&areas[b]));
        let Some(lane) = largest else { return lanes };
        let opened: Vec<Siblings> = children(nodes, lanes[lane][0])
            .map(|node| vec![node])
            .collect();
        areas.splice(lane..=lane, opened.iter().map(area));
        lanes.splice(lane..=lane, opened);
    }
}

fn bounds_of(nodes: &[TreeNode], siblings: &[usize]) -> Aabb {
    let bounds = siblings.iter().map(|&node| nodes[node].bounds);
    bounds.fold(Aabb::EMPTY, |all, b| all.union(&b))
}
