//! Generated paths, one function per family; `street` and `walk` have files.

use glam::DVec3;

use super::{Pose, Stage, thin, unfit};
use crate::camera::Frame;
use crate::input::{Result, note};
use crate::scene::{CameraPlace, PlaceView, on_sphere};
use crate::shown::counted;
use crate::spec::Spec;

/// A circle about the scene: all items pass by.
///
/// `radius` is in half diagonals, `height` (of the eye above the centre) in radii.
pub(super) fn orbit(stage: &Stage, spec: &mut Spec) -> Result<Vec<Pose>> {
    let radius = spec.number_between("radius", 0.6, 0.0, 1e6)? * stage.radius();
    let height = spec.number_between("height", 0.35, -1e6, 1e6)? * radius;
    let pose = |turn: f64| {
        let arm = on_sphere(0.0, std::f64::consts::TAU * turn) * radius;
        let arm = arm.with_z(height);
        Pose::new(stage.centre() + arm, -arm)
    };
    Ok(stage.turns().map(pose).collect())
}

/// A closed flight through `waypoints` seeded points in the middle of the scene.
///
/// The coherent path of a game or a film camera.
pub(super) fn flythrough(stage: &Stage, spec: &mut Spec) -> Result<Vec<Pose>> {
    let count = spec.whole("waypoints", 8, 4..=10_000)? as usize;
    let mut rng = stage.rng();
    let (low, extent) = (stage.bounds.min, stage.extent());
    let points = (0..count).map(|_| {
        let share = rng.point() * 0.8 + 0.1;
        (low + extent * share).with_z(stage.flight_level(share.z))
    });
    let points: Vec<DVec3> = points.collect();
    let step = 1e-3;
    let pose = |turn: f64| {
        let at = turn * count as f64;
        let eye = spline(&points, at);
        // Slightly downward, like a pilot.
        let ahead = (spline(&points, at + step) - eye) / step;
        let forward = ahead - DVec3::Z * 0.15 * ahead.length();
        let moving = forward.length() > 1e-9 * stage.radius();
        Pose::new(eye, if moving { forward } else { DVec3::X })
    };
    Ok(stage.turns().map(pose).collect())
}

/// A closed centripetal Catmull-Rom spline at `at` (segment number plus fraction).
///
/// Evaluated by the pyramid of Barry and Goldman 1988; without loops or cusps within a segment
/// (Yuksel et al. 2011).
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
    let a = [0, 1, 2].map(|i| mix(p[i], p[i + 1], i, i + 1));
    let b = [mix(a[0], a[1], 0, 2), mix(a[1], a[2], 1, 3)];
    mix(b[0], b[1], 1, 2)
}

/// A turn in place by the camera's own yaw: the eye is fixed, the view changes.
pub(super) fn spin(stage: &Stage, _: &mut Spec) -> Result<Vec<Pose>> {
    let eye = stage.centre().with_z(stage.flight_level(0.3));
    let level = Frame::looking_along(eye, DVec3::X, DVec3::Z);
    let mut frame = level.map_err(|error| unfit("spin", error))?;
    let step = 360.0 / stage.count as f64;
    let poses = (0..stage.count).map(|_| {
        let pose = Pose::new(frame.eye, frame.forward());
        frame.yaw(step);
        pose
    });
    Ok(poses.collect())
}

/// The lecture's zoom in both senses.
///
/// The eye moves along the direction of view, then stays while the field of view narrows. `power`
/// is the final magnification.
pub(super) fn zoom(stage: &Stage, spec: &mut Spec) -> Result<Vec<Pose>> {
    let power = spec.number_between("power", 8.0, 1.0, 1e6)?;
    let forward = DVec3::new(0.8, 0.5, -0.3).normalize();
    let from = stage.centre() - forward * stage.radius();
    let pose = |t: f64| {
        // From the rim 90 % of the way to the centre.
        let travelled = (2.0 * t).min(1.0) * 0.9 * stage.radius();
        let magnification = libm::pow(power, (2.0 * t - 1.0).max(0.0));
        Pose {
            magnification,
            ..Pose::new(from + forward * travelled, forward)
        }
    };
    Ok(even_times([0.0, 1.0], stage.count).map(pose).collect())
}

/// Unrelated views: the eye jumps, so nothing of the last frame helps.
pub(super) fn teleport(stage: &Stage, _: &mut Spec) -> Result<Vec<Pose>> {
    let mut rng = stage.rng();
    let poses = (0..stage.count).map(|_| {
        let share = rng.point();
        let z = stage.flight_level(share.z);
        let eye = (stage.bounds.min + stage.extent() * share).with_z(z);
        // Normal components: every direction is equally likely.
        let forward = rng.normal3();
        let looking = forward != DVec3::ZERO;
        Pose::new(eye, if looking { forward } else { DVec3::X })
    });
    Ok(poses.collect())
}

/// The whole scene from outside: all is visible, so the cost of the answer shows.
///
/// Eyes on a Fibonacci spiral over the sphere, far enough away that any field of view above 30
/// degrees contains the scene's bounding sphere.
pub(super) fn outside(stage: &Stage, _: &mut Spec) -> Result<Vec<Pose>> {
    const GOLDEN_ANGLE: f64 = 2.399_963_229_728_653;
    // 1/sin(15 degrees) = 3.86 radii.
    let distance = 4.0 * stage.radius();
    let pose = |turn: f64| {
        let i = turn * stage.count as f64;
        let arm = on_sphere(0.98 * (1.0 - 2.0 * turn), i * GOLDEN_ANGLE);
        Pose::new(stage.centre() + arm * distance, -arm)
    };
    Ok(stage.turns().map(pose).collect())
}

/// The scene's own camera places: things of Doom maps, cameras of glTF.
///
/// Roll and lens are the file's, if it states them. At most `frames` of them.
pub(super) fn places(stage: &Stage, spec: &mut Spec) -> Result<Vec<Pose>> {
    if stage.scene.places.is_empty() {
        let wanted = "expected one with places: a Doom map, a glTF with cameras";
        let found = format_args!("'{}' has no camera places of its own", stage.scene.name);
        return Err(unfit("places", format_args!("scene {found}; {wanted}")));
    }
    let places = stage.scene.places.iter();
    let mut poses: Vec<Pose> = places.map(|place| pose(stage, place, None)).collect();
    if spec.text("frames").is_some() {
        thin(&mut poses, stage.count);
    }
    Ok(poses)
}

pub(super) fn pose(stage: &Stage, place: &CameraPlace, time_s: Option<f64>) -> Pose {
    let turned = |v| stage.scene.up.to_z_up(v);
    let view = place.view.map(|view| PlaceView {
        up: turned(view.up),
        ..view
    });
    Pose {
        view,
        time_s,
        ..Pose::new(turned(place.eye), turned(place.forward))
    }
}

/// The camera moved by the animation of a scene's file, at even times.
pub(super) fn animation(stage: &Stage, _: &mut Spec) -> Result<Vec<Pose>> {
    let unfit = |reason: String| unfit("animation", reason);
    let animation = match stage.scene.animation.as_deref() {
        Some(Ok(animation)) => animation,
        Some(Err(error)) => return Err(unfit(error.to_string())),
        None => {
            let reason = "has no animated camera; expected a glTF file with one";
            return Err(unfit(format!("scene '{}' {reason}", stage.scene.name)));
        }
    };
    let (cameras, clips) = (animation.cameras, animation.clips);
    for (count, one) in [(cameras, "animated camera"), (clips, "animation")] {
        if count > 1 {
            let all = counted(count, one);
            note(&format!("path 'animation' follows the first of {all}"));
        }
    }
    let times = even_times(animation.seconds, stage.count);
    let pose = |time: f64| match animation.at(time) {
        Some(place) => Ok(pose(stage, &place, Some(time))),
        None => Err(unfit(format!(
            "no direction of view at {time} s; expected a transform with one"
        ))),
    };
    times.map(pose).collect()
}

/// Times from the first to the last key, both exact.
fn even_times([first, last]: [f64; 2], count: usize) -> impl Iterator<Item = f64> {
    let steps = count.saturating_sub(1).max(1) as f64;
    // Exact products of f32 times, so that the last time is the last key's.
    let at = move |frame: f64| (first * (steps - frame) + last * frame) / steps;
    (0..count).map(move |frame| at(frame as f64))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_last_time_is_that_of_the_last_key() {
        let times: Vec<f64> = even_times([0.0, 4.0], 50).collect();
        assert_eq!((times[0], times[49]), (0.0, 4.0));
        assert!(times.is_sorted());
    }

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
