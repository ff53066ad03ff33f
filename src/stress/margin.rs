//! How far out a box may lie that the exact test still returns: the margin of
//! its planes, stated once for vectors and extremes.

use crate::arithmetic::Expansion;
use crate::camera::{Camera, Lens, LensKind, Surroundings};
use crate::geometry::{Aabb, ConvexVolume, Plane};

/// How far outside the camera's volume a box may lie that the exact test still
/// returns.
///
/// A plane of unit length is rounded (u of `|d|` and of each `|n_k| x_k`),
/// moved by c = 8 times u of `sum |n_k| A_k + |d|`, and evaluated with at most
/// 4 roundings of the magnitudes at the box's corner: 13 u of the sum over k
/// of the larger of A_k and the box's reach, and of `|d|`. The plane touches
/// the volume, whose points near the camera are among its corners, so `|d|`
/// is no more than the sum of A_k. 16 covers the sum of both; what is below
/// f32 altogether is 2^-140 at most. An eye far away from all that it sees
/// costs 2^-49 of its coordinates and depths, by the derivation in f64 and by
/// the margin for it; for planes that are sums of others four times that is
/// allowed. A view so wide that its sides are all
/// but parallel leaves f64 no digits for its bounds; what the exact test then
/// returns is not judged.
pub fn slack(camera: &Camera, around: &Surroundings, b: &Aabb) -> f64 {
    const UNIT_ROUNDOFF: f64 = 1.0 / (1u64 << 24) as f64;
    const TINY: f64 = f64::from_bits((1023 - 140) << 52);
    const DERIVED: f64 = 1.0 / (1u64 << 47) as f64;
    const CANCELLED: f64 = 2e-9;
    if openness(&camera.lens) < CANCELLED {
        return f64::INFINITY;
    }
    let near = camera.lens.near();
    let nearby = camera.lens.with_far(camera.lens.far().or(Some(near * 2.0)));
    let corners = nearby.ok().and_then(|lens| lens.corners(&camera.frame));
    let reach = corners
        .iter()
        .flatten()
        .fold(around.reach.as_dvec3(), |reach, corner| {
            reach.max(corner.abs())
        });
    let size = reach.max(b.reach().as_dvec3()).element_sum() + reach.element_sum();
    let eye = camera.frame.eye;
    let far_away = (eye.abs() + (eye - around.origin).abs()).element_sum()
        + near.abs()
        + camera.lens.far().unwrap_or(near).abs();
    16.0 * UNIT_ROUNDOFF * size + DERIVED * far_away + TINY
}

/// The determinant of near's, a side's and the bottom's or top's normals: what
/// is left when the three make a bound along an axis.
fn openness(lens: &Lens) -> f64 {
    let slopes = match *lens.kind() {
        LensKind::Perspective { fovy_deg, aspect } => {
            let y = libm::tan(fovy_deg.to_radians() / 2.0);
            [y * aspect, y]
        }
        LensKind::OffAxis { window } => {
            let [left, right, bottom, top] = window.map(|edge| edge.abs() / lens.near());
            [left.max(right), bottom.max(top)]
        }
        // Matrices are not drawn here.
        LensKind::Orthographic { .. } | LensKind::Matrix(_) => [0.0; 2],
    };
    slopes.map(|s| 1.0 / libm::hypot(1.0, s)).iter().product()
}

/// The six-plane test without any rounding.
pub fn sees_exactly(volume: &ConvexVolume, b: &Aabb) -> bool {
    let excludes = |plane: &Plane| {
        // f64 holds the products.
        let products = plane.normal.as_dvec3() * plane.p_vertex(b).as_dvec3();
        let mut value = Expansion::from(plane.d);
        for product in products.to_array() {
            value.grow(product);
        }
        value.sign() < 0
    };
    !b.is_empty() && !volume.planes().iter().any(excludes)
}
