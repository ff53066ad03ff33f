//! By the distance of the nearest point of each box.

use super::contract::{Piece, by_key, distance, nearest_point, sorted};
use crate::camera::Camera;
use crate::query::ItemId;
use crate::scene::WorldBox;
use crate::visibility::Solids;

/// Sorted by distance. O(n log n) per view.
pub fn order(solids: &Solids, camera: &Camera, pieces: &mut Vec<Piece>) {
    by_key(solids, pieces, |b| nearest(camera, b));
}

/// Brings some of the items into this order. O(n log n).
///
/// # Panics
/// If there is no such item.
pub fn front_to_back(solids: &Solids, camera: &Camera, items: &mut [ItemId]) {
    let key = |&item: &ItemId| (nearest(camera, &solids.boxes[item as usize]), item);
    let order = sorted(items.iter().map(key));
    let places = items.iter_mut().zip(order);
    places.for_each(|(to, (_, item))| *to = item);
}

fn nearest(camera: &Camera, b: &WorldBox) -> f64 {
    distance(camera, nearest_point(camera, b))
}
