//! By the distance of the nearest point of each box.

use super::contract::{DepthOrder, Piece, by_key, distance, nearest_point};
use crate::camera::Camera;
use crate::visibility::Solids;

/// As typed on the command line.
pub const NAME: &str = "box-distance";
/// One line for tables and help.
pub const SUMMARY: &str = "sorted by the distance of the nearest point of each box";

/// Sorted by distance. O(n log n) per view.
pub struct BoxDistance;

impl DepthOrder for BoxDistance {
    fn order(&self, solids: &Solids, camera: &Camera, pieces: &mut Vec<Piece>) {
        by_key(solids, pieces, |b| {
            distance(camera, nearest_point(camera, b))
        });
    }
}
