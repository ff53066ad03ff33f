//! A closed flight through seeded way points: the coherent path of a game or
//! a film camera.

use glam::DVec3;

use super::{PathError, Pose, Stage};
use crate::spec::Spec;

/// `waypoints` (default 8) random points within the scene's middle.
pub(super) fn frames(stage: &Stage, spec: &mut Spec) -> Result<Vec<Pose>, PathError> {
    let count = spec.whole("waypoints", 8, 10_000)?.max(4) as usize;
    let mut rng = stage.rng();
    let (low, extent) = (stage.bounds.min, stage.extent());
    let points: Vec<DVec3> = (0..count)
        .map(|_| {
            let share = rng.point() * 0.8 + 0.1;
            let z = stage.flight_level(share.z);
            (low + extent * share).with_z(z)
        })
        .collect();
    let step = 1e-3;
    let pose = |turn: f64| {
        let at = turn * count as f64;
        let eye = spline(&points, at);
        // Slightly downward, as a pilot looks.
        let ahead = (spline(&points, at + step) - eye) / step;
        let forward = ahead - DVec3::Z * 0.15 * ahead.length();
        let moving = forward.length() > 1e-9 * stage.radius();
        Pose::new(eye, if moving { forward } else { DVec3::X })
    };
    Ok(stage.turns().map(pose).collect())
}

/// A closed centripetal Catmull-Rom spline at `at` (segment number plus
/// fraction), by the pyramid of Barry and Goldman 1988; no loops and no cusps
/// within a segment (Yuksel et al. 2011).
fn spline(points: &[DVec3], at: f64) -> DVec3 {
    let n = points.len();
    let segment = at.floor();
    let point = |k: usize| points[(segment as usize + n + k - 1) % n];
    let p = [point(0), point(1), point(2), point(3)];
    let mut knots = [0.0; 4];
    for i in 1..4 {
        let gap = (p[i] - p[i - 1]).length().sqrt();
        knots[i] = knots[i - 1] + gap.max(1e-12);
    }
    let t = knots[1] + (knots[2] - knots[1]) * (at - segment);
    let mix = |a: DVec3, b: DVec3, from: usize, to: usize| {
        a + (b - a) * ((t - knots[from]) / (knots[to] - knots[from]))
    };
    let a = [
        mix(p[0], p[1], 0, 1),
        mix(p[1], p[2], 1, 2),
        mix(p[2], p[3], 2, 3),
    ];
    let b = [mix(a[0], a[1], 0, 2), mix(a[1], a[2], 1, 3)];
    mix(b[0], b[1], 1, 2)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_spline_passes_through_its_points_without_jumps() {
        let points = [
            DVec3::ZERO,
            DVec3::X,
            DVec3::new(3.0, 2.0, 0.0),
            DVec3::new(0.0, 5.0, 1.0),
        ];
        for (i, p) in points.iter().enumerate() {
            assert!((spline(&points, i as f64) - *p).length() < 1e-9);
            let across = spline(&points, i as f64 + 1e-7) - spline(&points, i as f64 + 4.0 - 1e-7);
            assert!(across.length() < 1e-5);
        }
    }
}
