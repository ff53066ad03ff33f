//! Bounds of the centres of a query's answers.
//!
//! For indexes that search boxes or cells only. The centre of every item that the six-plane test
//! sees lies within them; the converse does not hold.

use glam::{DVec3, Vec3};

use crate::geometry::{Aabb, Plane, PlaneF64, PlaneRows, ROW_LANES};

/// Share of the scene's size by which results are widened.
///
/// Far more than the rounding of the corners, far less than an item.
const SLACK: f64 = 1e-5;
/// Least determinant of three unit normals whose corner is trusted.
///
/// The error of a corner is about 1e-15 of the scene's size divided by the determinant: here a
/// tenth of [`SLACK`].
const LEAST_DETERMINANT: f64 = 1e-9;
/// Most of a coordinate or plane value.
///
/// Beyond this f32 may overflow, and then the plane test excludes nothing.
const MOST: f64 = 1e37;

/// The centres of the boxes that hold `p`.
pub fn of_point(p: Vec3, half: Vec3, scene: &Aabb) -> Aabb {
    let (p, half) = (p.as_dvec3(), half.as_dvec3());
    let size = scene.reach().as_dvec3().max(p.abs()).max_element();
    widened(p - half, p + half, size)
}

/// The centres of the boxes that no plane excludes.
///
/// A box passes a plane if `n . c + d + |n| . half >= 0` (the p-vertex, written about the centre),
/// up to the rounding of the plane test. So its centre lies in the polyhedron of the planes moved
/// outward. Clipped to the scene this is bounded, and its bounds are those of its corners.
/// O(planes^4), some microseconds for a frustum.
pub fn of_planes(rows: &PlaneRows, half: Vec3, scene: &Aabb) -> Aabb {
    corners_within(rows, half, scene).unwrap_or(*scene)
}

/// The planes of a view and the faces of the scene.
const MOST_HALVES: usize = ROW_LANES + 6;

/// The bounds; `None` if the corners cannot be computed reliably.
fn corners_within(rows: &PlaneRows, half: Vec3, scene: &Aabb) -> Option<Aabb> {
    let reach = scene.reach().as_dvec3();
    let size = reach.max_element();
    let mut halves = [PlaneF64::new(DVec3::ZERO, 0.0); MOST_HALVES];
    let mut count = 0;
    for plane in rows.planes() {
        if let Some(moved) = moved_outward(&plane, half.as_dvec3(), reach)? {
            halves[count] = moved;
            count += 1;
        }
    }
    for axis in DVec3::AXES {
        halves[count] = PlaneF64::new(axis, -axis.dot(scene.min.as_dvec3()));
        halves[count + 1] = PlaneF64::new(-axis, axis.dot(scene.max.as_dvec3()));
        count += 2;
    }
    let halves = &halves[..count];
    let mut crossed = [[DVec3::ZERO; MOST_HALVES]; MOST_HALVES];
    for (i, a) in halves.iter().enumerate() {
        for (j, b) in halves[..i].iter().enumerate() {
            crossed[i][j] = a.normal.cross(b.normal);
        }
    }
    let (mut min, mut max) = (DVec3::INFINITY, DVec3::NEG_INFINITY);
    for (i, a) in halves.iter().enumerate() {
        for (j, b) in halves[..i].iter().enumerate() {
            let line = crossed[i][j];
            for (k, c) in halves[..j].iter().enumerate() {
                let determinant = line.dot(c.normal);
                if determinant == 0.0 {
                    continue;
                }
                let scaled = crossed[i][k] * b.d - crossed[j][k] * a.d - line * c.d;
                // Certainly outside the scene, as where rounding lets nearly parallel near and far
                // planes meet.
                if scaled.abs().max_element() > 2.0 * size * (determinant.abs() + 1e-12) {
                    continue;
                }
                if determinant.abs() < LEAST_DETERMINANT {
                    return None;
                }
                let corner = scaled / determinant;
                let lies_in = |h: &PlaneF64| h.normal.dot(corner) + h.d >= -SLACK * size;
                if halves.iter().all(lies_in) {
                    (min, max) = (min.min(corner), max.max(corner));
                }
            }
        }
    }
    Some(widened(min, max, size))
}

/// The plane that the centres obey, normalised.
///
/// `Some(None)` if it constrains nothing; `None` if it may overflow or cannot be met.
fn moved_outward(plane: &Plane, half: DVec3, reach: DVec3) -> Option<Option<PlaneF64>> {
    let (normal, d) = (plane.normal.as_dvec3(), f64::from(plane.d));
    let largest = normal.abs().dot(reach) + d.abs();
    // All finite: no NaN.
    if largest >= MOST {
        return None;
    }
    let length = normal.length();
    if length == 0.0 {
        return if d >= 0.0 { Some(None) } else { None };
    }
    // Error bound of three products and three sums in f32.
    let error = 1e-6 * largest + 1e-30;
    let d = d + normal.abs().dot(half) + error;
    Some(Some(PlaneF64::new(normal / length, d / length)))
}

/// Rounds to f32, wider by the slack.
fn widened(min: DVec3, max: DVec3, size: f64) -> Aabb {
    let slack = DVec3::splat(SLACK * size + f64::from(f32::MIN_POSITIVE));
    Aabb::new((min - slack).as_vec3(), (max + slack).as_vec3())
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn vector(size: f32) -> impl Strategy<Value = Vec3> {
        [-size..size, -size..size, -size..size].prop_map(Vec3::from_array)
    }

    prop_compose! {
        fn item()(at in vector(50.0), half in vector(9.0)) -> Aabb {
            Aabb::around(at, half.abs())
        }
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(2000))]
        #[test]
        fn no_item_of_the_answer_has_its_centre_outside(
            items in prop::collection::vec(item(), 1..40),
            planes in prop::collection::vec((vector(1.0), vector(40.0)), 0..=ROW_LANES / 2),
            // For each plane a second one, nearly parallel or antiparallel to it.
            seconds in prop::collection::vec(
                (any::<bool>(), -9i32..-3, vector(1.0), vector(40.0)),
                0..=ROW_LANES / 2,
            ),
            p in vector(50.0),
        ) {
            let seconds = planes.iter().zip(seconds).map(|((normal, _), (same, by, off, point))| {
                let normal = if same { *normal } else { -*normal };
                (normal + off * 10f32.powi(by), point)
            });
            let planes: Vec<Plane> = planes.iter().copied().chain(seconds)
                .map(|(normal, point)| Plane::through(point, normal)).collect();
            let rows = PlaneRows::collect(planes.iter()).expect("eight at most");
            let scene = Aabb::union_of(&items);
            let largest = items.iter().fold(Vec3::ZERO, |h, b| h.max(b.half_extent()));
            let seen_from = of_planes(&rows, largest, &scene);
            let holding = of_point(p, largest, &scene);
            for b in &items {
                prop_assert!(rows.exclude(b) || seen_from.contains_point(b.centre()));
                prop_assert!(!b.contains_point(p) || holding.contains_point(b.centre()));
            }
        }
    }

    /// A small frustum in a large scene is not answered with the whole scene.
    #[test]
    fn a_pyramid_is_bounded_by_its_corners() {
        let planes = [
            Plane::new(Vec3::new(1.0, 0.0, 1.0), 0.0),
            Plane::new(Vec3::new(-1.0, 0.0, 1.0), 0.0),
            Plane::new(Vec3::new(0.0, 1.0, 1.0), 0.0),
            Plane::new(Vec3::new(0.0, -1.0, 1.0), 0.0),
            Plane::new(Vec3::new(0.0, 0.0, -1.0), 10.0),
        ];
        let rows = PlaneRows::collect(planes.iter()).expect("five planes");
        let scene = Aabb::around(Vec3::ZERO, Vec3::splat(1000.0));
        let centres = of_planes(&rows, Vec3::splat(0.5), &scene);
        let wanted = Aabb::new(Vec3::new(-11.5, -11.5, -1.0), Vec3::new(11.5, 11.5, 10.5));
        let off = (centres.min - wanted.min)
            .abs()
            .max((centres.max - wanted.max).abs());
        assert!(off.max_element() < 0.1, "{centres:?}");
    }

    /// Rotations that leave the near and far planes not quite parallel.
    ///
    /// They meet far outside the scene; that corner must be ignored.
    #[test]
    fn a_frustum_is_bounded_however_it_is_turned() {
        let scene = Aabb::around(Vec3::ZERO, Vec3::splat(1000.0));
        for i in 0..500 {
            let turn =
                glam::Quat::from_axis_angle(Vec3::new(0.3, -0.5, 0.8).normalize(), 0.37 * i as f32)
                    * glam::Quat::from_rotation_x(0.11 * i as f32);
            let sides = [Vec3::X, -Vec3::X, Vec3::Y, -Vec3::Y].map(|side| side - Vec3::Z);
            let sides = sides.map(|inward| Plane::through(Vec3::ZERO, turn * inward));
            let ahead = turn * -Vec3::Z;
            let near = Plane::through(ahead, ahead);
            let far = Plane::through(ahead * 10.0, turn * Vec3::Z);
            let planes = sides.iter().chain([&near, &far]);
            let rows = PlaneRows::collect(planes).expect("six planes");
            let centres = of_planes(&rows, Vec3::splat(0.5), &scene);
            // From corner to corner of the far side, moved outward.
            assert!(centres.extent().max_element() < 36.0, "{i}: {centres:?}");
        }
    }
}
