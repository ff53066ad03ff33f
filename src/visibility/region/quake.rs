//! Quake III maps: clusters of open leaves as regions.
//!
//! Their files have no openings between clusters; a table lists the clusters visible from each.

use std::sync::Arc;

use glam::DVec3;

use super::back_ends::Pvs;
use super::graph::{RegionGraph, RegionId, RegionLocator};
use crate::scene::{BspChild, QuakeMap, WorldBox};

/// Map units by which boxes are enlarged: map compilers round corners and planes.
const SLACK: f64 = 0.125;

impl RegionLocator for QuakeMap {
    fn regions_at(&self, b: &WorldBox, out: &mut Vec<RegionId>) -> bool {
        let tree = &self.tree;
        let (centre, half) = ((b.min + b.max) / 2.0, (b.max - b.min) / 2.0 + SLACK);
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
                    // Signed distances from the plane, in lengths of its normal.
                    let (normal, distance) = (node.normal.as_dvec3(), f64::from(node.distance));
                    let (at, reach) = (normal.dot(centre) - distance, normal.abs().dot(half));
                    let [front, back] = node.children;
                    open.extend((at + reach >= 0.0).then_some(front));
                    open.extend((at - reach <= 0.0).then_some(back));
                }
            }
        }
        inside
    }
}

impl RegionGraph {
    /// Clusters of a map as regions.
    pub fn of_quake(map: &Arc<QuakeMap>) -> RegionGraph {
        let parts = vec![Vec::new(); map.clusters];
        RegionGraph::new(parts, Vec::new(), map.clone())
    }
}

impl Pvs {
    /// Visibility table of the clusters of a map.
    ///
    /// `None` if the map has no table, which means that everything is visible, or if the table is
    /// too large.
    pub fn of_quake(map: &QuakeMap) -> Option<Pvs> {
        Pvs::of_pairs(map.clusters, map.sees()?)
    }
}
