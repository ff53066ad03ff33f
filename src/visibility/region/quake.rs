//! Quake III maps: clusters of open leaves as regions.
//!
//! Their files have no openings between them; what a cluster sees is a table.

use std::sync::Arc;

use glam::DVec3;

use super::graph::{Ground, RegionGraph, RegionId};
use super::row::Pvs;
use crate::scene::{BspChild, LeafNode, QuakeMap, WorldBox};

/// Map units by which boxes are grown: map compilers round corners and planes.
const SLACK: f64 = 0.125;

/// The ground of a map.
#[derive(Debug)]
struct LeafGround(Arc<QuakeMap>);

/// Which sides of a node a box may meet, the front first.
fn sides(node: &LeafNode, b: &WorldBox) -> [bool; 2] {
    let (centre, half) = ((b.min + b.max) / 2.0, (b.max - b.min) / 2.0 + SLACK);
    // Signed distances from the plane, in lengths of its normal.
    let (normal, distance) = (node.normal.as_dvec3(), f64::from(node.distance));
    let (at, reach) = (normal.dot(centre) - distance, normal.abs().dot(half));
    [at + reach >= 0.0, at - reach <= 0.0]
}

impl Ground for LeafGround {
    fn regions_at(&self, b: &WorldBox, out: &mut Vec<RegionId>) -> bool {
        let tree = &self.0.tree;
        let (mut inside, mut open) = (true, vec![BspChild::Node(0)]);
        while let Some(at) = open.pop() {
            match at {
                BspChild::Solid => inside = false,
                BspChild::Leaf(leaf) => {
                    let own = WorldBox::of(&tree.boxes[leaf as usize], DVec3::ZERO);
                    out.extend(b.meets(&own).then_some(tree.clusters[leaf as usize]));
                }
                BspChild::Node(node) => {
                    let node = &tree.nodes[node as usize];
                    let met = node.children.into_iter().zip(sides(node, b));
                    open.extend(met.filter_map(|(child, is_met)| is_met.then_some(child)));
                }
            }
        }
        inside
    }
}

impl RegionGraph {
    /// The clusters of a map.
    pub fn of_quake(map: &Arc<QuakeMap>) -> RegionGraph {
        let parts = vec![Vec::new(); map.clusters];
        RegionGraph::new(parts, Vec::new(), Arc::new(LeafGround(map.clone())))
    }
}

impl Pvs {
    /// The table of a map, of what its clusters see.
    ///
    /// `None` where the map has none, as all are seen then, or where it is too large.
    pub fn of_quake(map: &QuakeMap) -> Option<Pvs> {
        Pvs::of_pairs(map.clusters, map.sees()?)
    }
}
