//! Binary partition of space from another program, such as the BSP tree of a map.

use super::Plane;

/// Planes in a tree. Nodes refer to each other by their place in the list.
#[derive(Clone, Default, PartialEq, Debug)]
pub struct PlaneTree {
    /// In any order.
    pub nodes: Vec<PlaneTreeNode>,
    /// `None` for a space that is not divided.
    pub root: Option<u32>,
}

/// A dividing plane; its inside is the front.
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct PlaneTreeNode {
    /// Its normal points to the front.
    pub plane: Plane,
    /// Front, then back; `None` where the division ends.
    pub children: [Option<u32>; 2],
}
