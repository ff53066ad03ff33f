//! Error against what makes a camera ill-conditioned: how far from zero the world
//! lies, how small it is, far/near, field of view, aspect, and how nearly up is
//! the direction of view. The six-plane test by every derivation of the planes and in
//! every arithmetic; boxes are f32 world coordinates, on purpose, and nothing is
//! rebased.

use glam::{DVec3, Vec3};
use serde::Serialize;

use super::judged::{Names, counts_or_null};
use crate::camera::{
    Camera, CameraError, Frame, Lens, LensKind, PLANE_METHODS, PlaneOptions, Pose, Surroundings,
};
use crate::culling::{Arithmetic, CameraView, Culling, CullingError, CullingTest};
use crate::geometry::Aabb;
use crate::query::ItemId;
use crate::scene::SeededRng;
use crate::statistics::{Rate, rate_of};
use crate::verify::{ErrorCount, Truth, scan};

named! {
    /// Quantity that is swept over.
    #[derive(Clone, Copy, PartialEq, Eq, Debug, Serialize)]
    #[serde(rename_all = "lowercase")]
    pub enum Sweep, SWEEPS {
        Offset = "offset", "distance of the world from zero along each axis";
        Scale = "scale", "size of the world, depth / 100";
        #[serde(rename = "far/near")]
        FarOverNear = "far/near", "far / near";
        #[serde(rename = "fov")]
        FieldOfView = "fov", "vertical field of view, degrees";
        Aspect = "aspect", "width / height";
        Up = "up", "angle between up and the direction of view, rad";
    }
}

impl Sweep {
    /// Values of the sweep, from the mildest on.
    pub fn values(self) -> [f64; 5] {
        match self {
            Sweep::Offset => [0.0, 1e4, 1e5, 1e6, 1e7],
            Sweep::Scale => [1.0, 1e-20, 1e-30, 1e-36, 1e-38],
            Sweep::FarOverNear => [10, 16, 20, 24, 26].map(|power| (1u32 << power).into()),
            Sweep::FieldOfView => [1e-3, 1.0, 60.0, 150.0, 179.9],
            Sweep::Aspect => [1e-4, 1e-2, 1.0, 1e2, 1e4],
            Sweep::Up => [1.0, 1e-4, 1e-8, 1e-11, 1e-14],
        }
    }
}

/// One plane test at one value of a sweep.
#[derive(Clone, PartialEq, Debug, Serialize)]
pub struct SweepRow {
    /// Quantity that is varied.
    pub sweep: Sweep,
    /// Its value, in the sweep's own unit.
    pub value: f64,
    /// Test, arithmetic and planes.
    #[serde(flatten)]
    pub names: Names,
    /// Null if the planes cannot be made.
    pub false_negative_ppm: Option<Rate>,
    /// False positives / visible items; null as above.
    pub excess: Option<Rate>,
    /// The same as counts; null as above.
    #[serde(flatten, serialize_with = "counts_or_null")]
    pub errors: Option<ErrorCount>,
    /// Why the planes cannot be made; null if they can.
    pub refused: Option<String>,
}

/// Mean depth of the views of a world of size 1.
///
/// Depths are drawn: rounding does the same to all views by one lens.
const DEPTH: f64 = 100.0;
/// Boxes of each camera.
const BOXES: usize = 500;

/// A culling, by the toolkit's frame or by a plain one, and its errors.
struct SweptTest {
    culling: Culling,
    /// Axes are cross products in f64, rounded as they come.
    has_plain_frame: bool,
    /// Errors by camera.
    errors: Vec<ErrorCount>,
    refused: Option<String>,
}

/// The f32 default, with a plain frame as well; f64, f32 about the eye and every
/// derivation without epsilon.
fn tests() -> Vec<SweptTest> {
    let bare = PlaneOptions::default().without_epsilon();
    let of = |arithmetic, method| {
        let planes = PlaneOptions { method, ..bare };
        Culling::new(CullingTest::SixPlane, arithmetic, planes)
    };
    let arithmetics = [Arithmetic::F64, Arithmetic::F32Relative].map(|a| of(a, bare.method));
    let methods = PLANE_METHODS.map(|(method, ..)| of(Arithmetic::F32, method));
    let all = [&[Culling::default(); 2][..], &arithmetics, &methods].concat();
    let tests = all.into_iter().enumerate().map(|(n, culling)| SweptTest {
        culling,
        has_plain_frame: n == 1,
        errors: Vec::new(),
        refused: None,
    });
    tests.collect()
}

impl SweptTest {
    fn names(&self) -> Names {
        let mut names = Names::of(&self.culling);
        if self.has_plain_frame {
            names.planes = "frame-plain";
        }
        names
    }

    fn view(&self, camera: &Camera, around: &Surroundings) -> Result<CameraView, CullingError> {
        match self.has_plain_frame {
            true => self.culling.view(&with_plain_frame(camera)?, around),
            false => self.culling.view(camera, around),
        }
    }

    fn row(self, sweep: Sweep, value: f64) -> SweepRow {
        let known = self.refused.is_none();
        let judged = if known { &self.errors[..] } else { &[] };
        let missed = rate_of(judged, |e| [e.false_negatives, e.visible]);
        SweepRow {
            sweep,
            value,
            names: self.names(),
            false_negative_ppm: missed.map(|share| share.of_share().per(1e6)),
            excess: rate_of(judged, |e| [e.false_positives, e.visible]),
            errors: known.then(|| judged.iter().copied().sum()),
            refused: self.refused,
        }
    }
}

/// The same camera with axes from the pose by rounded cross products.
fn with_plain_frame(camera: &Camera) -> Result<Camera, CameraError> {
    let (eye, forward, up) = match Pose::of(camera) {
        Pose::LookAt { eye, look, up } => (eye, look - eye, up),
        Pose::Forward { eye, forward, up } => (eye, forward, up),
    };
    let u = forward.cross(up).normalize();
    Ok(Camera {
        frame: Frame::looking_along(eye, forward, u.cross(forward))?,
        lens: camera.lens,
    })
}

/// Judges `cameras` random cameras at every value with every test; the same
/// cameras for each.
pub fn sweep(sweep: Sweep, cameras: usize, seed: u64) -> Vec<SweepRow> {
    let at = |value| {
        let (mut tests, mut rng) = (tests(), SeededRng::new(seed));
        (0..cameras).for_each(|_| judge(&mut rng, sweep, value, &mut tests));
        tests.into_iter().map(move |test| test.row(sweep, value))
    };
    sweep.values().into_iter().flat_map(at).collect()
}

fn camera_at(rng: &mut SeededRng, sweep: Sweep, value: f64) -> Option<Camera> {
    let of = |own: Sweep, otherwise: f64| if own == sweep { value } else { otherwise };
    let scale = of(Sweep::Scale, 1.0);
    let centre = DVec3::splat(of(Sweep::Offset, 0.0));
    let eye = centre + rng.normal3() * 10.0 * scale;
    let (forward, beside) = (rng.normal3().normalize(), rng.normal3());
    let across = forward.cross(beside).normalize();
    let angle = of(Sweep::Up, 1.0);
    let up = forward * libm::cos(angle) + across * libm::sin(angle);
    let depth = rng.between(0.7, 1.3) * DEPTH * scale;
    let near = depth / of(Sweep::FarOverNear, 1000.0);
    let (fovy, aspect) = (of(Sweep::FieldOfView, 60.0), of(Sweep::Aspect, 16.0 / 9.0));
    let lens = Lens::perspective(fovy, aspect, near, Some(depth)).ok()?;
    let frame = Frame::looking_along(eye, forward, up).ok()?;
    Some(Camera { frame, lens })
}

/// Boxes in and about the view, no larger than a twentieth of what it is narrow
/// by. As a world in f32 has them: rounded to its grid, and exact from there on.
fn boxes_about(rng: &mut SeededRng, camera: &Camera) -> Vec<Aabb> {
    let (LensKind::Perspective { aspect, .. }, Some(depth)) =
        (*camera.lens.kind(), camera.lens.far())
    else {
        return Vec::new();
    };
    let slope = camera.lens.height_at(1.0).unwrap_or(0.0) / 2.0;
    let narrow = depth * slope.min(slope * aspect).min(1.0);
    let frame = &camera.frame;
    let one = |rng: &mut SeededRng| {
        let half = rng.between(0.005, 0.05) * narrow;
        let ahead = rng.between(0.0, 1.1) * depth;
        let mut beside = |slope: f64| rng.between(-1.2, 1.2) * (slope * ahead + 2.0 * half);
        let (x, y) = (beside(slope * aspect), beside(slope));
        let at = frame.eye + frame.u() * x + frame.v() * y - frame.n() * ahead;
        Aabb::around(at.as_vec3(), Vec3::splat(half as f32))
    };
    (0..BOXES).map(|_| one(rng)).collect()
}

fn judge(rng: &mut SeededRng, sweep: Sweep, value: f64, tests: &mut [SweptTest]) {
    let Some(camera) = camera_at(rng, sweep, value) else {
        return;
    };
    let boxes = boxes_about(rng, &camera);
    let around = Surroundings::of_boxes(&boxes);
    let Some(truth) = Truth::of_camera(&camera, DVec3::ZERO, &boxes) else {
        return;
    };
    for test in tests {
        match test.view(&camera, &around) {
            Ok(view) => {
                let view = view.as_any();
                let answer: Vec<ItemId> = scan(&boxes, |b| view.sees(b)).collect();
                test.errors.push(truth.errors(&boxes, &answer));
            }
            Err(error) => test.refused = Some(error.to_string()),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn of<'r>(rows: &'r [SweepRow], value: f64, arithmetic: &str, planes: &str) -> &'r SweepRow {
        let named = |row: &&SweepRow| {
            let names = &row.names;
            let is_bare = names.epsilon == 0.0;
            (names.arithmetic, names.planes, row.value) == (arithmetic, planes, value) && is_bare
        };
        rows.iter().find(named).expect(arithmetic)
    }

    #[test]
    fn the_default_loses_nothing_anywhere() {
        for (which, name, _) in SWEEPS {
            let rows = sweep(which, 4, 3);
            assert_eq!(rows.len(), 5 * tests().len());
            for row in &rows {
                let is_safe = row.names == Names::of(&Culling::default());
                assert_eq!(row.errors.is_none(), row.refused.is_some(), "{row:?}");
                let Some(errors) = row.errors else { continue };
                let lost = errors.false_negatives + errors.touch_dropped;
                assert!(!is_safe || lost == 0, "{row:?}");
                // There is something to lose, and something to return too much.
                let visible = 101..4 * BOXES as u64;
                assert!(visible.contains(&errors.visible), "{name} {row:?}");
            }
        }
    }

    #[test]
    fn each_sweep_finds_what_it_is_there_for() {
        let lost = |row: &SweepRow| row.errors.unwrap().false_negatives;
        let rows = sweep(Sweep::FarOverNear, 6, 1);
        let [least, .., large, most] = Sweep::FarOverNear.values();
        assert!(lost(of(&rows, large, "f32", "gh-gl-f32")) > 0);
        assert!(of(&rows, most, "f32", "gh-gl-f32").refused.is_some());
        assert_eq!(lost(of(&rows, least, "f32", "frame")), 0);
        let rows = sweep(Sweep::Scale, 6, 1);
        assert!(lost(of(&rows, 1e-30, "f32", "gh-gl-f32")) > 0);
        assert_eq!(lost(of(&rows, 1e-30, "f32", "frame")), 0);
        let rows = sweep(Sweep::Offset, 6, 1);
        assert!(lost(of(&rows, 1e6, "f32", "gh-gl-f32")) > 0);
        assert_eq!(lost(of(&rows, 1e7, "f64", "frame")), 0);
        // Axes that were rounded as they came: c = 8 is no help.
        let rows = sweep(Sweep::Up, 6, 1);
        let plain = |row: &&SweepRow| row.names.planes == "frame-plain";
        let by_angle: Vec<u64> = rows.iter().filter(plain).map(lost).collect();
        assert!(by_angle[0] == 0 && by_angle[4] > 0, "{by_angle:?}");
    }
}
