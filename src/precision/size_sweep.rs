//! Error against the ratio of item size to view depth: cubes strewn about one
//! frustum after another, tested with sphere, faces, bounds, silhouettes and
//! all of them. The unit of length is the depth.

use glam::{DVec3, Vec3};
use serde::Serialize;

use crate::camera::{Camera, CameraError, Frame, Lens, PlaneOptions, Surroundings};
use crate::culling::{
    Arithmetic, CameraView, Culling, CullingError, CullingTest, farthest_corner, silhouettes,
};
use crate::geometry::{Aabb, MAX_PLANES};
use crate::oracle::{Oracle, Pose, Verdict};
use crate::scene::SeededRng;
use crate::statistics::{Rate, rate_of};
use crate::verify::ErrorCount;

/// Edge of the cubes / depth of the frustum.
const SIZE_RATIOS: [f64; 5] = [0.01, 0.1, 0.3, 1.0, 10.0];

/// One ratio: false positives / visible, and what a test costs per box.
#[derive(Clone, PartialEq, Debug, Serialize)]
pub struct SizeRow {
    /// Edge of the cubes / depth of the frustum.
    pub size_over_depth: f64,
    /// Frusta in as many directions: the observations that the sampling errors
    /// rest on.
    pub frusta: usize,
    /// Cubes that were judged.
    pub cubes: u64,
    /// Cubes that the camera sees.
    pub visible: u64,
    /// Every culling test on these cubes.
    pub tests: Vec<SizeError>,
}

/// One culling test at one ratio.
#[derive(Clone, PartialEq, Debug, Serialize)]
pub struct SizeError {
    /// Name of the test.
    pub test: &'static str,
    /// False positives / visible cubes, by frustum; null if nothing is visible.
    pub excess: Option<Rate>,
    /// Visible cubes that were not returned.
    pub false_negative_count: u64,
}

/// Cubes of one frustum on each axis of a grid, one in each of its cells: spread
/// evenly they tell a frustum's share better than as many anywhere.
const GRID: usize = 8;
const BATCH: usize = GRID * GRID * GRID;
const FOVY_DEG: f64 = 60.0;
const ASPECT: f64 = 16.0 / 9.0;
/// Near plane / depth.
const NEAR: f64 = 0.01;

/// The tests by what they add to the faces; in f32 and without epsilon where
/// nothing else is said.
const TESTS: [&str; 7] = [
    "sphere",
    "six-plane",
    "six-box",
    "six+silhouettes",
    "exact",
    "exact + epsilon",
    "exact f64",
];

/// Judges about `cubes` cubes for every ratio, the same frusta for each.
///
/// # Errors
/// None for these cameras; the type says what cannot happen.
pub fn size_sweep(cubes: usize, seed: u64) -> Result<Vec<SizeRow>, CullingError> {
    let mut rng = SeededRng::new(seed);
    let mut tallies = SIZE_RATIOS.map(|_| Tally::default());
    for _ in 0..cubes.div_ceil(BATCH) {
        let camera = random_camera(&mut rng)?;
        let Some(oracle) = Oracle::of_camera(&Pose::of(&camera), &camera.lens, DVec3::ZERO) else {
            continue;
        };
        let views = views(&camera)?;
        for (tally, ratio) in tallies.iter_mut().zip(SIZE_RATIOS) {
            let cubes = strewn(&mut rng, &camera, ratio);
            tally.add(&oracle, &views, &cubes);
        }
    }
    let rows = tallies.iter().zip(SIZE_RATIOS);
    Ok(rows.map(|(tally, ratio)| tally.row(ratio)).collect())
}

/// Sums over the cubes of one ratio.
#[derive(Default)]
struct Tally {
    cubes: u64,
    /// Errors of each test, by frustum.
    tests: [Vec<ErrorCount>; TESTS.len()],
}

/// A frustum in any direction, at zero, of depth 1.
fn random_camera(rng: &mut SeededRng) -> Result<Camera, CameraError> {
    let lens = Lens::perspective(FOVY_DEG, ASPECT, NEAR, Some(1.0))?;
    loop {
        let (forward, up) = (rng.normal3(), rng.normal3());
        if let Ok(frame) = Frame::looking_along(DVec3::ZERO, forward, up) {
            return Ok(Camera { frame, lens });
        }
    }
}

/// The corners of a box about the centres of all cubes that any of the tests
/// can return, in the camera's own frame: across, up, depth.
fn region(ratio: f64) -> [DVec3; 2] {
    let radius = ratio * 3f64.sqrt() / 2.0;
    // The sphere test returns the most: centres within the frustum whose
    // planes are all moved outward by the radius. That is a truncated pyramid
    // from near - radius to far + radius.
    let slope_y = libm::tan(FOVY_DEG.to_radians() / 2.0);
    let slope_x = slope_y * ASPECT;
    let far = 1.0 + radius;
    // An outer plane lies radius / cos of the half angle beside the old one.
    let reach = |slope: f64| far * slope + radius * (1.0 + slope * slope).sqrt();
    let (x, y) = (reach(slope_x), reach(slope_y));
    [DVec3::new(-x, -y, NEAR - radius), DVec3::new(x, y, far)]
}

/// The cube with this centre in the camera's own frame.
fn cube_at(camera: &Camera, ratio: f64, at: DVec3) -> Aabb {
    let frame = &camera.frame;
    let centre = frame.u() * at.x + frame.v() * at.y - frame.n() * at.z;
    Aabb::around(centre.as_vec3(), Vec3::splat((ratio / 2.0) as f32))
}

/// Cubes whose centres are strewn evenly over the region.
fn strewn(rng: &mut SeededRng, camera: &Camera, ratio: f64) -> Vec<Aabb> {
    let [low, high] = region(ratio);
    let cell = (high - low) / GRID as f64;
    let cube = |i: usize| {
        let corner = [i % GRID, i / GRID % GRID, i / GRID / GRID].map(|at| at as f64);
        let at = low + (DVec3::from(corner) + rng.point()) * cell;
        cube_at(camera, ratio, at)
    };
    (0..BATCH).map(cube).collect()
}

/// Views of one frustum, in the order of [`TESTS`].
fn views(camera: &Camera) -> Result<[CameraView; TESTS.len()], CullingError> {
    let around = Surroundings::default();
    let moved = PlaneOptions::default();
    let bare = moved.without_epsilon();
    let of =
        |test, arithmetic, planes| Culling::new(test, arithmetic, planes).view(camera, &around);
    let in_f32 = |test| of(test, Arithmetic::F32, bare);
    let wide = camera.convex_volume_f64(&around)?;
    let faces = wide.planes();
    let more = silhouettes(faces, MAX_PLANES - faces.len(), farthest_corner(faces));
    Ok([
        in_f32(CullingTest::Sphere)?,
        in_f32(CullingTest::SixPlane)?,
        in_f32(CullingTest::SixBox)?,
        CameraView::Volume(camera.volume_with(&more, &bare, &around)?),
        in_f32(CullingTest::Exact)?,
        of(CullingTest::Exact, Arithmetic::F32, moved)?,
        of(CullingTest::Exact, Arithmetic::F64, bare)?,
    ])
}

impl Tally {
    fn add(&mut self, oracle: &Oracle, views: &[CameraView], cubes: &[Aabb]) {
        let verdicts: Vec<Verdict> = cubes.iter().map(|cube| oracle.verdict(cube)).collect();
        self.cubes += cubes.len() as u64;
        let balls = CullingTest::Sphere.items(cubes);
        for (test, view) in self.tests.iter_mut().zip(views) {
            let own = match view {
                CameraView::Spheres(_) => &balls,
                _ => cubes,
            };
            let (view, mut errors) = (view.as_any(), ErrorCount::default());
            for (b, verdict) in own.iter().zip(&verdicts) {
                let seen = view.sees(b);
                errors.visible += u64::from(*verdict != Verdict::Out);
                errors.false_positives += u64::from(seen && *verdict == Verdict::Out);
                errors.false_negatives += u64::from(!seen && *verdict == Verdict::In);
            }
            test.push(errors);
        }
    }

    fn row(&self, ratio: f64) -> SizeRow {
        let tests = TESTS.iter().zip(&self.tests);
        let tests = tests.map(|(test, own)| SizeError {
            test,
            excess: rate_of(own, |errors| [errors.false_positives, errors.visible]),
            false_negative_count: own.iter().map(|errors| errors.false_negatives).sum(),
        });
        SizeRow {
            size_over_depth: ratio,
            frusta: self.tests[0].len(),
            cubes: self.cubes,
            visible: self.tests[0].iter().map(|errors| errors.visible).sum(),
            tests: tests.collect(),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn judged(camera: &Camera, cubes: &[Aabb]) -> Tally {
        let oracle = Oracle::of_camera(&Pose::of(camera), &camera.lens, DVec3::ZERO).unwrap();
        let mut tally = Tally::default();
        tally.add(&oracle, &views(camera).unwrap(), cubes);
        tally
    }

    fn extra(tally: &Tally) -> [u64; TESTS.len()] {
        tally.tests.each_ref().map(|test| test[0].false_positives)
    }

    /// Cubes beside the region would have to be counted if any test returned them.
    #[test]
    fn nothing_beside_the_region_is_returned_by_any_test() {
        let mut rng = SeededRng::new(5);
        for ratio in SIZE_RATIOS {
            let [low, high] = region(ratio);
            let mut spheres_extra = 0;
            for _ in 0..8 {
                let camera = random_camera(&mut rng).unwrap();
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
                let beside = judged(&camera, &cubes);
                let visible = |tally: &Tally| tally.tests[0][0].visible;
                assert_eq!((beside.cubes, visible(&beside)), (2000, 0), "{ratio}");
                assert_eq!(extra(&beside), [0; TESTS.len()], "{ratio}");
                // The other way round: cubes within are seen, and the f64 test
                // with all planes makes no mistake.
                let within = judged(&camera, &strewn(&mut rng, &camera, ratio));
                assert!(visible(&within) > 0, "{ratio}");
                spheres_extra += extra(&within)[0];
                let exact = TESTS.len() - 1;
                let missed = within.tests[exact][0].false_negatives;
                assert_eq!((extra(&within)[exact], missed), (0, 0));
            }
            assert!(spheres_extra > 0, "{ratio}");
        }
    }

    /// Other frusta and other cubes: as far from each other as the sampling
    /// errors say, also the rare ones, and never farther than another seed may be.
    #[test]
    fn seeds_agree_within_their_sampling_errors() {
        let sweep = |seed: u64| size_sweep(24 * BATCH, seed).unwrap();
        let sweeps: Vec<Vec<SizeRow>> = (1..5).map(sweep).collect();
        let (mut cells, mut apart) = (0, 0);
        for (row, of_first) in sweeps[0].iter().enumerate() {
            for (test, first) in of_first.tests.iter().enumerate() {
                let first = first.excess.unwrap();
                for other in &sweeps[1..] {
                    let other = other[row].tests[test].excess.unwrap();
                    let off = (first.value - other.value).abs();
                    let ratio = of_first.size_over_depth;
                    assert!(
                        off <= first.elsewhere.unwrap(),
                        "{ratio} {}: {first:?} {other:?}",
                        TESTS[test]
                    );
                    let width = |rate: &Rate| rate.upper.unwrap() - rate.value;
                    cells += 1;
                    apart += usize::from(off > width(&first).hypot(width(&other)));
                }
            }
        }
        assert!(20 * apart < 2 * cells, "{apart} of {cells}");
    }

    #[test]
    fn the_same_seed_finds_the_same_errors() {
        let errors = |seed: u64| -> Vec<(u64, Vec<Option<u64>>)> {
            let rows = size_sweep(1, seed).unwrap();
            let of = |row: &SizeRow| {
                let all = row
                    .tests
                    .iter()
                    .map(|t| t.excess.map(|e| e.value.to_bits()));
                (row.visible, all.collect())
            };
            rows.iter().map(of).collect()
        };
        assert_eq!(errors(3), errors(3));
        assert_ne!(errors(3), errors(4));
    }
}
