//! Exact proof that a box is inside a closed piece of a surface.
//!
//! No triangle enters the box, and the surface winds round it.

use glam::{DVec3, Vec3};

use crate::arithmetic::Expansion;
use crate::geometry::Aabb;
use crate::visibility::triangle::{Eye, faces, normal};

/// Returns `true` if the open box is inside a closed piece.
pub fn is_in(part: &[[Vec3; 3]], inner: &Aabb) -> bool {
    let is_apart = part.iter().all(|corners| is_outside(*corners, inner));
    // All of an open box without a surface in it is inside, or none is.
    is_apart && winding(part, inner).is_some_and(|turns| turns > 0)
}

/// Returns `true` if a triangle and an open box have no point in common, exactly.
///
/// By the thirteen separating axes (Akenine-Möller 2001) as comparisons and orientations.
fn is_outside(corners: [Vec3; 3], b: &Aabb) -> bool {
    let [p, q, r] = corners;
    let (low, high) = (p.min(q).min(r), p.max(q).max(r));
    if high.cmple(b.min).any() || low.cmpge(b.max).any() {
        return true;
    }
    // Without area there is no plane to be behind.
    let on_plane = normal(corners) != DVec3::ZERO
        && [[p, q, r], [p, r, q]]
            .into_iter()
            .any(|triangle| (0..8).all(|i| !faces(&Eye::local(b.corner(i).as_dvec3()), triangle)));
    // Edges against the box's axes: a line of the projection along the axis that has
    // the rectangle on one side, the triangle on the other.
    on_plane
        || (0..3).any(|axis| {
            let flat = |v: Vec3| [v[(axis + 1) % 3], v[(axis + 2) % 3]];
            (0..3).any(|k| {
                let [a, b0, c] = [k, k + 1, k + 2].map(|i| flat(corners[i % 3]));
                let own = turn(a, b0, c);
                let sides = (0..8).map(|i| turn(a, b0, flat(b.corner(i))));
                let [mut left, mut right] = [own >= 0, own <= 0];
                for side in sides {
                    left &= side <= 0;
                    right &= side >= 0;
                }
                // Where the projection is a line, both sides of it are free; where it
                // is a point, there is no line.
                (left || right) && a != b0
            })
        })
}

/// The sign of the turn from `a` over `b` to `c`, exactly: 1 is to the left.
pub fn turn(a: [f32; 2], b: [f32; 2], c: [f32; 2]) -> i32 {
    let [[ax, ay], [bx, by], [cx, cy]] = [a, b, c].map(|p| p.map(f64::from));
    let (left, right) = ((bx - ax) * (cy - ay), (by - ay) * (cx - ax));
    let side = left - right;
    // Four roundings on each way: Shewchuk 1997 proves 3 + 16 * 2^-53 of them.
    if side.abs() > (left.abs() + right.abs()) * (4.0 * f64::EPSILON) {
        return if side > 0.0 { 1 } else { -1 };
    }
    let minus = |p: f64, q: f64| &Expansion::from(p) - &Expansion::from(q);
    let (left, right) = (
        &minus(bx, ax) * &minus(cy, ay),
        &minus(by, ay) * &minus(cx, ax),
    );
    (&left - &right).sign()
}

/// How often a closed surface winds around a point in the box: crossings of a ray
/// upward from it, `None` if every ray that was tried meets an edge.
fn winding(part: &[[Vec3; 3]], inner: &Aabb) -> Option<i32> {
    let (low, size) = (inner.min.as_dvec3(), inner.extent().as_dvec3());
    // Places of the plane that are unlikely to be those of corners.
    (1..16).find_map(|k| {
        let within = |step: f64| (0.5 + f64::from(k) * step).fract() * 0.8 + 0.1;
        let at = DVec3::new(within(0.381_966), within(0.237_512), 0.5);
        let from = (low + size * at).as_vec3();
        if !(from.cmpgt(inner.min).all() && from.cmplt(inner.max).all()) {
            return None;
        }
        let eye = Eye::local(from.as_dvec3());
        let mut turns = 0;
        for &[a, b, c] in part {
            let (low, high) = (a.min(b).min(c), a.max(b).max(c));
            let is_aside = low.x > from.x || high.x < from.x || low.y > from.y || high.y < from.y;
            if is_aside || high.z < from.z {
                continue;
            }
            let flat = |v: Vec3| [v.x, v.y];
            let sides = [(a, b), (b, c), (c, a)].map(|(p, q)| turn(flat(p), flat(q), flat(from)));
            let (some_left, some_right) = (sides.contains(&1), sides.contains(&-1));
            if some_left && some_right {
                continue;
            }
            if sides.contains(&0) {
                return None;
            }
            // Upward the ray leaves through a triangle that faces up, if it is above:
            // the point then is behind it.
            let is_in_front = faces(&eye, [a, b, c]);
            turns += match (some_left, is_in_front) {
                (true, false) => 1,
                (false, true) => -1,
                _ => 0,
            };
        }
        Some(turns)
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::SeededRng;

    #[test]
    fn separation_is_what_clipping_says() {
        // Cut the triangle by the six planes in f64: something left means common points.
        let unit = Aabb::new(Vec3::splat(-1.0), Vec3::ONE);
        let mut rng = SeededRng::new(4);
        let (mut apart, mut by_edge) = (0, 0);
        for _ in 0..20_000 {
            let centre = rng.normal3();
            let corners = [0; 3].map(|_| (centre + rng.normal3() * 1.5).as_vec3());
            let mut polygon = corners.map(Vec3::as_dvec3).to_vec();
            for plane in 0..6 {
                let (axis, sign) = (plane / 2, if plane % 2 == 0 { 1.0 } else { -1.0 });
                let side = |p: DVec3| 1.0 - p[axis] * sign;
                let mut cut = Vec::new();
                for (i, &p) in polygon.iter().enumerate() {
                    let q = polygon[(i + 1) % polygon.len()];
                    if side(p) > 0.0 {
                        cut.push(p);
                    }
                    if (side(p) > 0.0) != (side(q) > 0.0) {
                        cut.push(p + (q - p) * (side(p) / (side(p) - side(q))));
                    }
                }
                polygon = cut;
            }
            let is_apart = is_outside(corners, &unit);
            assert_eq!(is_apart, polygon.is_empty(), "{corners:?}");
            let [a, b, c] = corners;
            let bounds = Aabb::new(a.min(b).min(c), a.max(b).max(c));
            apart += u32::from(is_apart);
            by_edge += u32::from(is_apart && bounds.intersects(&unit));
        }
        assert!(apart > 1000 && by_edge > 100, "{apart} {by_edge}");
        // A needle without area, through the middle.
        let [a, b] = [Vec3::splat(-2.0), Vec3::splat(2.0)];
        assert!(!is_outside([a, b, Vec3::ZERO], &unit) && !is_outside([a, a, b], &unit));
        assert!(is_outside(
            [a + Vec3::X * 4.0, b + Vec3::X * 4.0, Vec3::X * 4.0],
            &unit
        ));
    }
}
