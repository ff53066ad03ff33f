//! No order: as the items come.

use super::contract::{DepthOrder, Piece};
use crate::camera::Camera;
use crate::visibility::Solids;

/// As typed on the command line.
pub const NAME: &str = "none";
/// One line for tables and help.
pub const SUMMARY: &str = "items in the order of their ids";

/// Items in the order of their ids.
pub struct None;

impl DepthOrder for None {
    fn order(&self, solids: &Solids, _: &Camera, pieces: &mut Vec<Piece>) {
        pieces.clear();
        let items = 0..solids.boxes.len() as u32;
        pieces.extend(items.map(|item| Piece {
            item,
            part: Option::None,
        }));
    }
}
