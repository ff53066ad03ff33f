//! By the distance of the centre of each box.

use super::contract::{Piece, by_key, distance};
use crate::camera::Camera;
use crate::visibility::Solids;

/// Sorted by distance. O(n log n) per view.
pub fn order(solids: &Solids, camera: &Camera, pieces: &mut Vec<Piece>) {
    by_key(solids, pieces, |b| {
        distance(camera, b.min / 2.0 + b.max / 2.0)
    });
}
