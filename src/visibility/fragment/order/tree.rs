//! The order in which the packed tree keeps its items: what the object stage hands
//! over without any sorting.

use super::contract::{DepthOrder, Piece};
use crate::camera::Camera;
use crate::index::{Input, RegionIndex, Wide};
use crate::query::ItemId;
use crate::visibility::Solids;

/// Items as they lie in the tree.
pub struct TreeOrder(Vec<ItemId>);

impl TreeOrder {
    /// The order of the tree over the items; that of their ids where there is none.
    pub fn of(solids: &Solids) -> TreeOrder {
        let tree = Wide::build(&Input::new(&solids.outer), &Default::default());
        let order = tree.ok().and_then(|tree| Some(tree.tree_order()?.to_vec()));
        TreeOrder(order.unwrap_or_else(|| (0..solids.boxes.len() as ItemId).collect()))
    }
}

impl DepthOrder for TreeOrder {
    fn order(&self, _: &Solids, _: &Camera, pieces: &mut Vec<Piece>) {
        pieces.clear();
        pieces.extend(self.0.iter().map(|&item| Piece::whole(item)));
    }
}
