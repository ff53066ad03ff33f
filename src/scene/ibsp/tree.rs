//! The BSP tree of a Quake III map: exact search for a point's open leaf.

use glam::{DVec3, Vec3};

use crate::geometry::{Aabb, Plane, PlaneTree};
use crate::input::Result;
use crate::query::ItemId;
use crate::scene::bsp::{BspChild, descend, plane_tree, side_of};
use crate::scene::records::Table;

/// Most nodes on the way to a leaf; maps have fewer than a hundred.
const MOST_DEEP: u32 = 1 << 12;
/// Upper bound of coordinates, which are 32-bit numbers.
const FARTHEST: f64 = 1e10;
/// Map units by which boxes are grown: map compilers truncate fractions.
const GROWTH: f64 = 1.0;

/// A dividing plane.
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct LeafNode {
    /// Points to the front.
    pub normal: Vec3,
    /// Distance from the origin: points of the plane have `normal . p = distance`.
    pub distance: f32,
    /// Front, plane included, then back.
    pub children: [BspChild; 2],
}

/// A tree whose open leaves are the regions of a map.
#[derive(Clone, Default, Debug)]
pub struct LeafTree {
    /// The nodes, the root first.
    pub nodes: Vec<LeafNode>,
    /// Boxes of the open leaves, in the order of the file, grown by a map unit.
    pub boxes: Vec<Aabb>,
    /// Cluster of each open leaf.
    pub clusters: Vec<u32>,
}

impl LeafNode {
    /// 1, for the back, if `normal . p < distance`; else 0. Exact.
    pub fn side(&self, p: DVec3) -> usize {
        usize::from(side_of(self.normal.as_dvec3(), self.distance.into(), p) < 0)
    }
}

impl LeafTree {
    /// Links the tree; `clusters` is their number, if the file states it.
    pub fn read(
        nodes: &Table,
        leaves: &Table,
        planes: &Table,
        clusters: Option<usize>,
    ) -> Result<LeafTree> {
        let reached = reached_leaves(nodes, leaves)?;
        let most = clusters.unwrap_or(usize::MAX).min(leaves.len());
        let mut tree = LeafTree::default();
        let mut children = vec![BspChild::Solid; leaves.len()];
        for leaf in (0..leaves.len()).filter(|&leaf| reached[leaf]) {
            let cluster = leaves.int(leaf, 0);
            let [min, max] = [8, 20].map(|at| leaves.whole(leaf, at).as_dvec3());
            // Solid, or without any point.
            if cluster < 0 || min.cmpgt(max).any() {
                continue;
            }
            if cluster as usize >= most {
                let found = format!("cluster {cluster} in leafs {leaf}");
                return Err(leaves.error(leaf, 0, found, format!("less than {most}")));
            }
            children[leaf] = BspChild::Leaf(tree.boxes.len() as ItemId);
            let grown = Aabb::rounded_outward(min - GROWTH, max + GROWTH, DVec3::ZERO);
            tree.boxes.push(grown);
            tree.clusters.push(cluster as u32);
        }
        for node in 0..nodes.len() {
            let plane = nodes.index(node, 0, planes)?;
            let child = |at| match nodes.int(node, at) {
                leaf if leaf < 0 => children.get(!leaf as usize).copied(),
                node => Some(BspChild::Node(node as u32)),
            };
            tree.nodes.push(LeafNode {
                normal: planes.vector(plane, 0)?,
                distance: planes.float(plane, 12)?,
                // Unreachable nodes may have any children.
                children: [4, 8].map(|at| child(at).unwrap_or(BspChild::Solid)),
            });
        }
        Ok(tree)
    }

    /// The open leaf that contains a point within its box. O(depth).
    pub fn descend(&self, p: DVec3) -> Option<ItemId> {
        if p.abs().max_element() > FARTHEST {
            return None;
        }
        let leaf = descend(BspChild::Node(0), |node| {
            let node = &self.nodes[node as usize];
            node.children[node.side(p)]
        })?;
        let [min, max] = [self.boxes[leaf as usize].min, self.boxes[leaf as usize].max];
        let holds = p.cmpge(min.as_dvec3()) & p.cmple(max.as_dvec3());
        holds.all().then_some(leaf)
    }

    /// The planes, for structures that can use them.
    pub fn plane_tree(&self) -> PlaneTree {
        let nodes = self.nodes.iter();
        let nodes = nodes.map(|n| (Plane::new(n.normal, -n.distance), n.children));
        plane_tree(BspChild::Node(0), nodes)
    }
}

/// Marks the leaves below the first node.
///
/// Those of a map's moving parts have no node.
///
/// # Errors
/// Nodes that do not form a tree, or form a very deep one.
fn reached_leaves(nodes: &Table, leaves: &Table) -> Result<Vec<bool>> {
    let error = |node, at, found: String| Err(nodes.error(node, at, found, "a BSP tree"));
    if nodes.len() == 0 {
        return error(0, 0, "no nodes".to_owned());
    }
    let mut reached = [vec![false; nodes.len()], vec![false; leaves.len()]];
    reached[0][0] = true;
    let mut open = vec![(0, 1)];
    while let Some((node, depth)) = open.pop() {
        if depth > MOST_DEEP {
            let found = format!("{depth} nodes, one below the other");
            let expected = format!("at most {MOST_DEEP}");
            return Err(nodes.error(node, 0, found, expected));
        }
        for at in [4, 8] {
            let child = nodes.int(node, at);
            let (of, name, index) = match child < 0 {
                true => (1, "leaf", !child as usize),
                false => (0, "node", child as usize),
            };
            match reached[of].get_mut(index) {
                Some(fresh) if !*fresh => *fresh = true,
                Some(_) => return error(node, at, format!("{name} {index} is reached twice")),
                None => return error(node, at, format!("{name} {index} does not exist")),
            }
            if child >= 0 {
                open.push((index, depth + 1));
            }
        }
    }
    let [_, leaves] = reached;
    Ok(leaves)
}
