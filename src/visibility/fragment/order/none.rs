//! No order: as the items come.

use super::contract::Piece;
use crate::camera::Camera;
use crate::visibility::Solids;

/// Items in the order of their ids.
pub fn order(solids: &Solids, _: &Camera, pieces: &mut Vec<Piece>) {
    pieces.clear();
    pieces.extend((0..solids.boxes.len() as u32).map(Piece::whole));
}
