//! Depths in f64, by which boxes far from a ray are passed over.

use crate::scene::WorldBox;

/// A depth moved by more than it can have been rounded.
pub fn roomy(depth: f64, by: f64) -> f64 {
    depth + by * depth.abs() * 1e-14
}

/// Not above the depth where the ray enters and not below the one where it leaves:
/// to pass over boxes far from it. `None` where that is not so simple.
pub fn guess(origin: [f64; 3], direction: [f64; 3], b: &WorldBox) -> Option<[f64; 2]> {
    let (mut enters, mut leaves) = (f64::NEG_INFINITY, f64::INFINITY);
    for k in 0..3 {
        if direction[k].abs() < 1e-100 {
            return None;
        }
        let low = (b.min[k] - origin[k]) / direction[k];
        let high = (b.max[k] - origin[k]) / direction[k];
        enters = enters.max(roomy(low.min(high), -1.0));
        leaves = leaves.min(roomy(low.max(high), 1.0));
    }
    Some([enters, leaves])
}
