//! Error against the size of items and against ill-conditioned cameras.
//!
//! Sizes: every test, on cubes strewn around frusta. Cameras: distance of the world from zero, its
//! scale, far/near, field of view and aspect, by the six-plane test with every derivation of the
//! planes and in every arithmetic. Boxes are f32 world coordinates, on purpose, and nothing is
//! rebased.

use glam::{DVec3, Vec3};
use serde::Serialize;

use super::culling_result::{CullingResult, Names, counts_or_null};
use crate::camera::{Camera, Frame, Lens, LensKind, PLANE_METHODS, PlaneOptions, Surroundings};
use crate::culling::{Arithmetic, Culling, CullingTest};
use crate::geometry::Aabb;
use crate::measure::blamed;
use crate::query::ItemId;
use crate::scene::SeededRng;
use crate::statistics::{Estimate, rate_of};
use crate::verify::{ErrorCount, Truth, scan};

named! {
    /// Quantity that a sweep varies.
    #[derive(Clone, Copy, PartialEq, Eq, Debug, Serialize)]
    #[serde(rename_all = "lowercase")]
    pub enum Sweep, SWEEPS {
        Size = "size", "edge of the cubes / depth of the view";
        Offset = "offset", "distance of the world from zero along each axis";
        Scale = "scale", "size of the world, depth / 100";
        #[serde(rename = "far/near")]
        FarOverNear = "far/near", "far / near";
        #[serde(rename = "fov")]
        FieldOfView = "fov", "vertical field of view, degrees";
        Aspect = "aspect", "width / height";
    }
}

/// Cubes in the size sweep for each camera in the other sweeps.
const CUBES_PER_CAMERA: usize = 10_000;
/// Least number of cameras for a reliable interval.
///
/// Items of one camera share its planes.
const LEAST_CAMERAS: usize = 32;
const MOST_CAMERAS: usize = 200;

impl Sweep {
    /// Number of cameras per value, for a number of cubes per size.
    pub fn cameras(self, cubes: usize) -> usize {
        match self {
            Sweep::Size => cubes.div_ceil(BATCH),
            _ => cubes
                .div_ceil(CUBES_PER_CAMERA)
                .clamp(LEAST_CAMERAS, MOST_CAMERAS),
        }
    }

    /// Values of the sweep, mildest first.
    pub fn values(self) -> [f64; 5] {
        match self {
            Sweep::Size => [0.01, 0.1, 0.3, 1.0, 10.0],
            Sweep::Offset => [0.0, 1e4, 1e5, 1e6, 1e7],
            Sweep::Scale => [1.0, 1e-20, 1e-30, 1e-36, 1e-38],
            Sweep::FarOverNear => [10, 16, 20, 24, 26].map(|power| (1u32 << power).into()),
            Sweep::FieldOfView => [1e-3, 1.0, 60.0, 150.0, 179.9],
            Sweep::Aspect => [1e-4, 1e-2, 1.0, 1e2, 1e4],
        }
    }
}

/// Errors of one culling at one value of a sweep.
#[derive(Clone, PartialEq, Debug, Serialize)]
pub struct SweepRow {
    /// Quantity that is varied.
    pub sweep: Sweep,
    /// Value in the sweep's own unit.
    pub value: f64,
    /// Test, arithmetic and planes.
    #[serde(flatten)]
    pub names: Names,
    /// False negatives per million visible items; null if the planes cannot be made.
    pub false_negative_ppm: Option<Estimate>,
    /// False positives / visible items; null as above.
    pub excess: Option<Estimate>,
    /// Error counts; null as above.
    #[serde(flatten, serialize_with = "counts_or_null")]
    pub errors: Option<ErrorCount>,
    /// Reason why the planes cannot be made; null if they can.
    pub refused: Option<String>,
}

impl SweepRow {
    fn of(test: CullingResult, sweep: Sweep, value: f64) -> SweepRow {
        let known = test.refused.is_none();
        let result = if known { &test.errors[..] } else { &[] };
        let missed = rate_of(result, |e| [e.false_negatives, e.visible]);
        SweepRow {
            sweep,
            value,
            names: Names::of(&test.culling),
            false_negative_ppm: missed.map(|share| share.of_share().times(1e6)),
            excess: rate_of(result, |e| [e.false_positives, e.visible]),
            errors: known.then(|| result.iter().copied().sum()),
            refused: test.refused,
        }
    }

    /// Error to plot: false positives for sizes, in percent of the visible items.
    ///
    /// False negatives for cameras, per million.
    pub fn error(&self) -> Option<Estimate> {
        match self.sweep {
            Sweep::Size => self.excess.map(|rate| rate.times(100.0)),
            _ => self.false_negative_ppm,
        }
    }
}

/// Mean depth of the views of a world of size 1.
///
/// Depths are random, as rounding has the same effect on all views with one lens.
const DEPTH: f64 = 100.0;
/// Boxes of each camera.
const BOXES: usize = 500;

/// Tests of the size sweep: all four, in f32 without epsilon.
///
/// The exact test also with epsilon, and in f64.
fn tests_of_sizes() -> Vec<Culling> {
    use CullingTest::{Exact, SixBox, SixPlane, Sphere};
    let moved = PlaneOptions::default();
    let bare = moved.without_epsilon();
    let in_f32 = |test| Culling::new(test, Arithmetic::F32, bare);
    let mut all = Vec::from([Sphere, SixPlane, SixBox, Exact].map(in_f32));
    all.push(Culling::new(Exact, Arithmetic::F32, moved));
    all.push(Culling::new(Exact, Arithmetic::F64, bare));
    all
}

/// Cullings of the camera sweeps.
///
/// The f32 default; f64, f32 about the eye and every derivation without epsilon.
fn tests_of_cameras() -> Vec<Culling> {
    let bare = PlaneOptions::default().without_epsilon();
    let of = |arithmetic, method| {
        let planes = PlaneOptions { method, ..bare };
        Culling::new(CullingTest::SixPlane, arithmetic, planes)
    };
    let arithmetics = [Arithmetic::F64, Arithmetic::F32Relative].map(|a| of(a, bare.method));
    let methods = PLANE_METHODS.map(|(method, ..)| of(Arithmetic::F32, method));
    let first = [Culling::default()].into_iter();
    first.chain(arithmetics).chain(methods).collect()
}

/// Cullings of a sweep, before any camera is evaluated.
fn without_errors(sweep: Sweep) -> Vec<CullingResult> {
    let tests = match sweep {
        Sweep::Size => tests_of_sizes(),
        _ => tests_of_cameras(),
    };
    let tests = tests.into_iter().map(|culling| CullingResult {
        culling,
        ..CullingResult::default()
    });
    tests.collect()
}

/// Evaluates `cameras` random cameras at every value with every culling.
///
/// Each culling gets the same cameras.
pub fn sweep(sweep: Sweep, cameras: usize, seed: u64) -> Vec<SweepRow> {
    let mut all = sweep.values().map(|value| (value, without_errors(sweep)));
    let mut rng = SeededRng::new(seed);
    match sweep {
        Sweep::Size => {
            for _ in 0..cameras {
                let camera = random_camera(&mut rng);
                for (size, tests) in &mut all {
                    let cubes = scattered(&mut rng, &camera, *size);
                    evaluate(&camera, &cubes, &Surroundings::default(), tests);
                }
            }
        }
        _ => {
            for (value, tests) in &mut all {
                rng = SeededRng::new(seed);
                for _ in 0..cameras {
                    let Some(camera) = camera_at(&mut rng, sweep, *value) else {
                        continue;
                    };
                    let boxes = boxes_about(&mut rng, &camera);
                    evaluate(&camera, &boxes, &Surroundings::of_boxes(&boxes), tests);
                }
            }
        }
    }
    let rows = all.into_iter().flat_map(|(value, tests)| {
        let tests = tests.into_iter();
        tests.map(move |test| SweepRow::of(test, sweep, value))
    });
    rows.collect()
}

fn camera_at(rng: &mut SeededRng, sweep: Sweep, value: f64) -> Option<Camera> {
    let of = |own: Sweep, otherwise: f64| if own == sweep { value } else { otherwise };
    let scale = of(Sweep::Scale, 1.0);
    let centre = DVec3::splat(of(Sweep::Offset, 0.0));
    let eye = centre + rng.normal3() * 10.0 * scale;
    let (forward, beside) = (rng.normal3().normalize(), rng.normal3());
    let across = forward.cross(beside).normalize();
    // One radian from the direction of view.
    let up = forward * libm::cos(1.0) + across * libm::sin(1.0);
    let depth = rng.between(0.7, 1.3) * DEPTH * scale;
    let near = depth / of(Sweep::FarOverNear, 1000.0);
    let (fovy, aspect) = (of(Sweep::FieldOfView, 60.0), of(Sweep::Aspect, 16.0 / 9.0));
    let lens = Lens::perspective(fovy, aspect, near, Some(depth)).ok()?;
    let frame = Frame::looking_along(eye, forward, up).ok()?;
    Some(Camera { frame, lens })
}

/// Boxes in and around the view, at most a twentieth as large as it is narrow.
///
/// Rounded to the f32 grid, as in an f32 world, and exact from then on.
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

fn evaluate(camera: &Camera, boxes: &[Aabb], around: &Surroundings, tests: &mut [CullingResult]) {
    let Some(truth) = Truth::of_camera(camera, DVec3::ZERO, boxes) else {
        return;
    };
    for test in tests {
        match test.culling.view(camera, around) {
            Ok(view) => {
                let (view, of) = (view.as_any(), test.culling.test);
                let answer: Vec<ItemId> = scan(&of.items(boxes), |b| view.sees(b)).collect();
                test.errors.push(blamed(of, truth.errors(boxes, &answer)));
            }
            Err(error) => test.refused = Some(error.to_string()),
        }
    }
}

/// Cubes per frustum along each axis of a grid, one in each cell.
///
/// Stratified cubes estimate a frustum's error better than as many independent ones.
const GRID: usize = 8;
const BATCH: usize = GRID * GRID * GRID;
const FOVY_DEG: f64 = 60.0;
const ASPECT: f64 = 16.0 / 9.0;
/// Near plane / depth.
const NEAR: f64 = 0.01;

/// Frustum of depth 1 at zero, in a random direction.
fn random_camera(rng: &mut SeededRng) -> Camera {
    let lens = Lens::perspective(FOVY_DEG, ASPECT, NEAR, Some(1.0)).expect("a lens");
    loop {
        let (forward, up) = (rng.normal3(), rng.normal3());
        if let Ok(frame) = Frame::looking_along(DVec3::ZERO, forward, up) {
            return Camera { frame, lens };
        }
    }
}

/// Corners of a box around the centres of all cubes that any test can return.
///
/// In the camera's own frame: across, up, depth.
fn region(ratio: f64) -> [DVec3; 2] {
    let radius = ratio * 3f64.sqrt() / 2.0;
    // The sphere test returns the most: centres within the frustum whose planes are all moved
    // outward by the radius. That is a truncated pyramid from near - radius to far + radius.
    let slope_y = libm::tan(FOVY_DEG.to_radians() / 2.0);
    let slope_x = slope_y * ASPECT;
    let far = 1.0 + radius;
    // An outer plane lies radius / cos of the half angle beside the old one.
    let reach = |slope: f64| far * slope + radius * (1.0 + slope * slope).sqrt();
    let (x, y) = (reach(slope_x), reach(slope_y));
    [DVec3::new(-x, -y, NEAR - radius), DVec3::new(x, y, far)]
}

/// Cube with this centre in the camera's own frame.
fn cube_at(camera: &Camera, ratio: f64, at: DVec3) -> Aabb {
    let frame = &camera.frame;
    let centre = frame.u() * at.x + frame.v() * at.y - frame.n() * at.z;
    Aabb::around(centre.as_vec3(), Vec3::splat((ratio / 2.0) as f32))
}

/// Cubes whose centres are spread evenly over the region.
fn scattered(rng: &mut SeededRng, camera: &Camera, ratio: f64) -> Vec<Aabb> {
    let [low, high] = region(ratio);
    let cell = (high - low) / GRID as f64;
    let cube = |i: usize| {
        let corner = [i % GRID, i / GRID % GRID, i / GRID / GRID].map(|at| at as f64);
        let at = low + (DVec3::from(corner) + rng.point()) * cell;
        cube_at(camera, ratio, at)
    };
    (0..BATCH).map(cube).collect()
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
        for (which, name, _) in &SWEEPS[1..] {
            let rows = sweep(*which, 4, 3);
            assert_eq!(rows.len(), 5 * tests_of_cameras().len());
            for row in &rows {
                let is_safe = row.names == Names::of(&Culling::default());
                assert_eq!(row.errors.is_none(), row.refused.is_some(), "{row:?}");
                let Some(errors) = row.errors else { continue };
                let lost = errors.false_negatives + errors.touch_dropped;
                assert!(!is_safe || lost == 0, "{row:?}");
                // There are items to lose, and items to return in excess.
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
    }

    /// Errors of every test of the size sweep.
    fn of_cubes(camera: &Camera, cubes: &[Aabb]) -> Vec<ErrorCount> {
        let mut tests = without_errors(Sweep::Size);
        evaluate(camera, cubes, &Surroundings::default(), &mut tests);
        tests.iter().map(|test| test.errors[0]).collect()
    }

    /// Cubes outside the region need not be counted, as no test returns them.
    #[test]
    fn nothing_beside_the_region_is_returned_by_any_test() {
        let mut rng = SeededRng::new(5);
        for ratio in Sweep::Size.values() {
            let [low, high] = region(ratio);
            let mut spheres_extra = 0;
            for _ in 0..8 {
                let camera = random_camera(&mut rng);
                let mut cubes = Vec::new();
                for _ in 0..2000 {
                    let mut at = low + (high - low) * rng.point();
                    // Just outside one of the six faces.
                    let (axis, out) = (rng.below(3), 1e-3 * (high - low));
                    at[axis] = match rng.below(2) {
                        0 => low[axis] - out[axis],
                        _ => high[axis] + out[axis],
                    };
                    cubes.push(cube_at(&camera, ratio, at));
                }
                for beside in of_cubes(&camera, &cubes) {
                    assert_eq!(beside, ErrorCount::default(), "{ratio}");
                }
                // Conversely, cubes inside are visible, and the f64 test with all planes makes no
                // error.
                let within = of_cubes(&camera, &scattered(&mut rng, &camera, ratio));
                let [spheres, .., exact] = &within[..] else {
                    panic!("{within:?}")
                };
                assert!(exact.visible > 0, "{ratio}");
                spheres_extra += spheres.false_positives;
                assert_eq!((exact.false_positives, exact.false_negatives), (0, 0));
            }
            assert!(spheres_extra > 0, "{ratio}");
        }
    }

    /// Other frusta and other cubes: results differ as much as their sampling errors.
    ///
    /// This includes the rare errors.
    #[test]
    fn seeds_agree_within_their_sampling_errors() {
        let sweeps: Vec<Vec<SweepRow>> = (1..5).map(|seed| sweep(Sweep::Size, 24, seed)).collect();
        let (mut cells, mut apart) = (0, 0);
        for (n, row) in sweeps[0].iter().enumerate() {
            let first = row.excess.unwrap();
            for other in &sweeps[1..] {
                let other = other[n].excess.unwrap();
                let off = (first.value - other.value).abs();
                let width = |rate: &Estimate| rate.upper.unwrap() - rate.value;
                cells += 1;
                apart += usize::from(off > width(&first).hypot(width(&other)));
            }
        }
        assert!(20 * apart < 2 * cells, "{apart} of {cells}");
    }

    #[test]
    fn the_same_seed_finds_the_same_errors() {
        assert_eq!(sweep(Sweep::Size, 1, 3), sweep(Sweep::Size, 1, 3));
        assert_ne!(sweep(Sweep::Size, 1, 3), sweep(Sweep::Size, 1, 4));
    }
}
