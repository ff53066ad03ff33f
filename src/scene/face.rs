//! Triangulation of polygons with three or more corners.

use earcut::Earcut;
use glam::{DVec2, DVec3};

use crate::shown::counted;

/// Most corners of a concave face.
///
/// Ear clipping of one that crosses itself takes quadratic time.
const MOST_CONCAVE: usize = 1000;
/// Share of a larger face's area that its fan may cover the wrong way round.
///
/// Rounded corners dent a convex face.
const MOST_WRONG: f64 = 1e-4;

/// Adds the triangles of a face: a fan, or the ears of a concave one.
///
/// Their winding is the face's. `face` has three or more indices of points. A corner without an
/// ear, such as the end of a spur, becomes a triangle of its own, so that the triangles have the
/// bounds of the face. O(corners); for a concave face up to quadratic. One of more than
/// [`MOST_CONCAVE`] corners becomes a fan if the fan does not overlap except by rounding.
///
/// # Errors
/// The words "a concave face of N corners", N above [`MOST_CONCAVE`].
pub fn add_triangles(points: &[DVec3], face: &[u32], to: &mut Vec<[u32; 3]>) -> Result<(), String> {
    let flat = flat_if_concave(points, face);
    let flat = flat.filter(|flat| face.len() <= MOST_CONCAVE || !is_fan(flat));
    let Some(flat) = flat else {
        to.extend(face[1..].windows(2).map(|pair| [face[0], pair[0], pair[1]]));
        return Ok(());
    };
    if face.len() > MOST_CONCAVE {
        return Err("a concave face of ".to_owned() + &counted(face.len(), "corner"));
    }
    let mut ears: Vec<u32> = Vec::new();
    let flat = flat.iter().map(DVec2::to_array);
    Earcut::new().earcut(flat, &[], &mut ears);
    let mut is_left = vec![true; face.len()];
    (ears.iter()).for_each(|place| is_left[*place as usize] = false);
    let ears = ears.chunks_exact(3);
    to.extend(ears.map(|ear| [0, 1, 2].map(|n| face[ear[n] as usize])));
    let alone = face.iter().zip(is_left).filter(|(_, is_left)| *is_left);
    to.extend(alone.map(|(corner, _)| [*corner; 3]));
    Ok(())
}

/// A face projected along its normal, if it turns both ways.
///
/// Counter-clockwise; the normal is Newell's.
fn flat_if_concave(points: &[DVec3], face: &[u32]) -> Option<Vec<DVec2>> {
    if face.len() < 4 {
        return None;
    }
    let all = 0..face.len();
    let origin = points[face[0] as usize];
    let at = |place: usize| points[face[place % face.len()] as usize] - origin;
    let normal: DVec3 = all.clone().map(|n| at(n).cross(at(n + 1))).sum();
    let axis = normal.abs().max_position();
    let sign = normal[axis].signum();
    let seen = |place: usize| {
        let point = at(place);
        DVec2::new(sign * point[(axis + 1) % 3], point[(axis + 2) % 3])
    };
    let turns_left = |place: usize| {
        let [a, b, c] = [0, 1, 2].map(|next| seen(place + next));
        (b - a).perp_dot(c - b) >= 0.0
    };
    let is_concave = normal.is_finite() && !all.clone().all(turns_left);
    is_concave.then(|| all.map(seen).collect())
}

/// Tests whether the triangles from the first corner overlap only by rounding.
fn is_fan(flat: &[DVec2]) -> bool {
    let areas = flat[1..].windows(2);
    let areas = areas.map(|pair| (pair[0] - flat[0]).perp_dot(pair[1] - flat[0]));
    let wrong: f64 = areas.clone().filter(|area| *area < 0.0).sum();
    -wrong <= MOST_WRONG * areas.sum::<f64>()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn triangles(points: &[DVec3], face: &[u32]) -> Vec<[u32; 3]> {
        let mut found = Vec::new();
        add_triangles(points, face, &mut found).unwrap();
        found
    }

    /// From any of its corners, along any axis, from both sides.
    #[test]
    fn a_concave_face_leaves_its_notch_open() {
        let u = [
            [0, 0],
            [3, 0],
            [3, 3],
            [2, 3],
            [2, 1],
            [1, 1],
            [1, 3],
            [0, 3],
        ];
        for (first, axis) in (0..8).flat_map(|first| [0, 1, 2].map(|axis| (first, axis))) {
            let point = |[a, b]: [i32; 2]| {
                let mut point = [0.0, f64::from(a), f64::from(b)];
                point.rotate_right(axis);
                DVec3::from(point)
            };
            let points = u.map(point);
            for side in [1.0, -1.0] {
                let mut face: Vec<u32> = (0..8).map(|n| (n + first) % 8).collect();
                if side < 0.0 {
                    face.reverse();
                }
                let areas = triangles(&points, &face).into_iter().map(|corners| {
                    let [a, b, c] = corners.map(|corner| points[corner as usize]);
                    (b - a).cross(c - a) / 2.0
                });
                let areas: Vec<DVec3> = areas.collect();
                assert_eq!(areas.iter().map(|area| area.length()).sum::<f64>(), 7.0);
                assert_eq!(areas.iter().sum::<DVec3>()[axis], 7.0 * side);
            }
        }
    }

    #[test]
    fn every_corner_has_a_triangle() {
        let [o, x, far, xy] = [[0, 0], [1, 0], [9, 0], [1, 1]]
            .map(|[x, y]| DVec3::new(f64::from(x), f64::from(y), 0.0));
        let found = triangles(&[o, x, far, x, xy], &[0, 1, 2, 3, 4]);
        let held: Vec<u32> = found.into_iter().flatten().collect();
        assert!((0..5).all(|corner| held.contains(&corner)), "{held:?}");
    }

    #[test]
    fn a_large_concave_face_is_refused() {
        let zigzag = |n: u32| DVec3::new(f64::from(n), f64::from(n % 2), 0.0);
        for (count, is_read) in [(1000, true), (1001, false)] {
            let points: Vec<DVec3> = (0..count).map(zigzag).collect();
            let face: Vec<u32> = (0..count).collect();
            let found = add_triangles(&points, &face, &mut Vec::new());
            assert_eq!(found.is_ok(), is_read, "{count}: {found:?}");
        }
    }

    #[test]
    fn a_large_convex_face_may_have_rounded_corners() {
        let (u, v) = (DVec3::new(1.0, 0.3, 0.2), DVec3::new(-0.3, 1.0, 0.0));
        let corner = |n: u32| {
            let share = f64::from(n % 251) / 251.0;
            let sides = [u * share, u + v * share, u + v - u * share, v - v * share];
            (sides[n as usize / 251] * 1e6).round()
        };
        let points: Vec<DVec3> = (0..1004).map(corner).collect();
        let mut face: Vec<u32> = (0..1004).collect();
        for _ in 0..2 {
            assert!(flat_if_concave(&points, &face).is_some());
            assert_eq!(triangles(&points, &face).len(), 1002);
            face.reverse();
        }
    }
}
