//! By the distance of the centre of each box.

use super::contract::{DepthOrder, Piece, by_key, distance};
use crate::camera::Camera;
use crate::visibility::Solids;

/// As typed on the command line.
pub const NAME: &str = "centre-distance";
/// One line for tables and help.
pub const SUMMARY: &str = "sorted by the distance of the centre of each box";

/// Sorted by distance. O(n log n) per view.
pub struct CentreDistance;

impl DepthOrder for CentreDistance {
    fn order(&self, solids: &Solids, camera: &Camera, pieces: &mut Vec<Piece>) {
        by_key(solids, pieces, |b| {
            distance(camera, b.min / 2.0 + b.max / 2.0)
        });
    }
}
