//! Error against the ratio of item size to view depth: cubes strewn about one
//! frustum after another, tested with sphere, faces, bounds, silhouettes and
//! all of them. Ratios are what counts, so the unit of length is the depth.

use glam::{DVec3, Vec3};
use serde::Serialize;

use crate::camera::{Camera, CameraError, Frame, Lens, PlaneOptions, Surroundings};
use crate::culling::{bounds, extended, silhouettes};
use crate::geometry::{Aabb, BoxBlocks, MAX_PLANES, Spheres, WidePlane, WideVolume, sphere_cube};
use crate::kernel::BASELINE;
use crate::measure::Stopwatch;
use crate::oracle::{Oracle, Pose, Verdict};
use crate::query::QueryVolume;
use crate::scene::Dice;
use crate::statistics::median;

/// Edge of the cubes / depth of the frustum.
pub const SIZE_RATIOS: [f64; 5] = [0.01, 0.1, 0.3, 1.0, 10.0];

/// One ratio: false positives / visible, and what a test costs a box.
#[derive(Clone, PartialEq, Debug, Serialize)]
pub struct SizeRow {
    /// Edge of the cubes / depth of the frustum.
    pub size_over_depth: f64,
    /// Cubes that were judged, and how many of them are visible.
    pub cubes: u64,
    /// Cubes that the camera sees.
    pub visible: u64,
    /// Every culling test on these cubes.
    pub tests: Vec<SizeError>,
}

#[derive(Clone, PartialEq, Debug, Serialize)]
pub struct SizeError {
    pub test: &'static str,
    pub excess: f64,
    pub false_negative_count: u64,
    /// Linear scan in blocks of sixteen, thread CPU time, median.
    pub ns_per_box: f64,
}

/// Cubes of one frustum.
const BATCH: usize = 16_384;
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
    "six-plane + silhouettes",
    "exact",
    "exact + epsilon",
    "exact f64",
];

/// Judges about `cubes` cubes for every ratio; deterministic but for the
/// times. `None` if stopped.
///
/// # Errors
/// None for these cameras; the type says what cannot happen.
pub fn size_sweep(
    cubes: usize,
    seed: u64,
    stop: &dyn Fn() -> bool,
) -> Result<Option<Vec<SizeRow>>, CameraError> {
    let mut rows = Vec::new();
    for (i, &ratio) in SIZE_RATIOS.iter().enumerate() {
        let mut dice = Dice::new(seed.wrapping_add(i as u64));
        let mut tally = Tally::default();
        for _ in 0..cubes.div_ceil(BATCH) {
            if stop() {
                return Ok(None);
            }
            tally.add_frustum(&mut dice, ratio)?;
        }
        rows.push(tally.row(ratio));
    }
    Ok(Some(rows))
}

#[derive(Default)]
struct Tally {
    cubes: u64,
    visible: u64,
    /// Per test: returned though out, not returned though in, times.
    extra: [u64; TESTS.len()],
    missed: [u64; TESTS.len()],
    times: [Vec<f64>; TESTS.len()],
}

/// A frustum in any direction, at zero, of depth 1.
fn random_camera(dice: &mut Dice) -> Result<Camera, CameraError> {
    let lens = Lens::perspective(FOVY_DEG, ASPECT, NEAR, Some(1.0))?;
    loop {
        let (forward, up) = (dice.normal3(), dice.normal3());
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
fn strewn(dice: &mut Dice, camera: &Camera, ratio: f64) -> Vec<Aabb> {
    let [low, high] = region(ratio);
    let cube = |dice: &mut Dice| {
        let depth = dice.between(low.z, high.z);
        let (x, y) = (dice.between(low.x, high.x), dice.between(low.y, high.y));
        cube_at(camera, ratio, DVec3::new(x, y, depth))
    };
    (0..BATCH).map(|_| cube(dice)).collect()
}

impl Tally {
    fn add_frustum(&mut self, dice: &mut Dice, ratio: f64) -> Result<(), CameraError> {
        let camera = random_camera(dice)?;
        let cubes = strewn(dice, &camera, ratio);
        self.add_cubes(&camera, &cubes)
    }

    fn add_cubes(&mut self, camera: &Camera, cubes: &[Aabb]) -> Result<(), CameraError> {
        let Some(oracle) = Oracle::of_camera(&Pose::of(camera), &camera.lens, DVec3::ZERO) else {
            return Ok(());
        };
        let verdicts: Vec<Verdict> = cubes.iter().map(|cube| oracle.verdict(cube)).collect();
        self.cubes += cubes.len() as u64;
        self.visible += verdicts.iter().filter(|v| **v != Verdict::Out).count() as u64;
        let around = Surroundings::default();
        let wide = camera.wide_volume(&around)?;
        let faces = wide.planes();
        let room = MAX_PLANES - faces.len();
        let moved = PlaneOptions::default();
        let bare = PlaneOptions {
            epsilon: 0.0,
            ..moved
        };
        let narrow = |more: &[WidePlane]| camera.volume_with(more, &bare, &around);
        let in_f64 = |more: Vec<WidePlane>| WideVolume::from_planes(&[faces, &more].concat());
        let boxes = blocks(cubes);
        let balls: Vec<Aabb> = cubes.iter().map(sphere_cube).collect();
        let spheres = Spheres::new(&narrow(&[])?);
        self.take(0, &spheres, &blocks(&balls), &verdicts);
        self.take(1, &narrow(&[])?, &boxes, &verdicts);
        self.take(2, &narrow(&bounds(faces))?, &boxes, &verdicts);
        self.take(3, &narrow(&silhouettes(faces, room))?, &boxes, &verdicts);
        self.take(4, &narrow(&extended(faces))?, &boxes, &verdicts);
        let conservative = camera.volume_with(&extended(faces), &moved, &around)?;
        self.take(5, &conservative, &boxes, &verdicts);
        self.take(6, &in_f64(extended(faces))?, &boxes, &verdicts);
        Ok(())
    }

    fn take<V: QueryVolume>(
        &mut self,
        test: usize,
        view: &V,
        blocks: &BoxBlocks,
        verdicts: &[Verdict],
    ) {
        let mut admitted = vec![0; verdicts.len().div_ceil(16)];
        let watch = Stopwatch::start();
        let mask = view.mask();
        for ((_, lanes, block), slot) in blocks.range(0, verdicts.len()).zip(&mut admitted) {
            *slot = view.kept_lanes(BASELINE, block, mask) & lanes;
        }
        self.times[test].push(watch.lap().cpu_ns / verdicts.len() as f64);
        for (i, verdict) in verdicts.iter().enumerate() {
            let seen = admitted[i / 16] >> (i % 16) & 1 == 1;
            self.extra[test] += u64::from(seen && *verdict == Verdict::Out);
            self.missed[test] += u64::from(!seen && *verdict == Verdict::In);
        }
    }

    fn row(&self, ratio: f64) -> SizeRow {
        let tests = TESTS.iter().enumerate().map(|(i, test)| SizeError {
            test,
            excess: self.extra[i] as f64 / self.visible as f64,
            false_negative_count: self.missed[i],
            ns_per_box: median(&self.times[i]).unwrap_or(f64::NAN),
        });
        SizeRow {
            size_over_depth: ratio,
            cubes: self.cubes,
            visible: self.visible,
            tests: tests.collect(),
        }
    }
}

fn blocks(boxes: &[Aabb]) -> BoxBlocks {
    let mut blocks = BoxBlocks::with_capacity(boxes.len());
    boxes.iter().for_each(|b| blocks.push(b));
    blocks
}

#[cfg(test)]
mod tests {
    use super::*;

    /// What lies beside the region would have to be counted if any test
    /// returned it.
    #[test]
    fn nothing_beside_the_region_is_returned_by_any_test() {
        let mut dice = Dice::new(5);
        for ratio in SIZE_RATIOS {
            let [low, high] = region(ratio);
            let (mut beside, mut within) = (Tally::default(), Tally::default());
            for _ in 0..8 {
                let camera = random_camera(&mut dice).unwrap();
                let mut cubes = Vec::new();
                for _ in 0..2000 {
                    let mut at = low + (high - low) * dice.point();
                    // Just outside one of the six faces.
                    let (axis, out) = (dice.below(3), 1e-3 * (high - low));
                    at[axis] = match dice.below(2) {
                        0 => low[axis] - out[axis],
                        _ => high[axis] + out[axis],
                    };
                    cubes.push(cube_at(&camera, ratio, at));
                }
                beside.add_cubes(&camera, &cubes).unwrap();
                within.add_frustum(&mut dice, ratio).unwrap();
            }
            assert_eq!((beside.cubes, beside.visible), (16_000, 0), "{ratio}");
            assert_eq!(beside.extra, [0; TESTS.len()], "{ratio}");
            // The other way round: cubes within are seen, and the f64 test
            // with all planes makes no mistake.
            assert!(within.visible > 0 && within.extra[0] > 0, "{ratio}");
            let exact = TESTS.len() - 1;
            assert_eq!(
                (within.extra[exact], within.missed[exact]),
                (0, 0),
                "{ratio}"
            );
        }
    }

    #[test]
    fn the_same_seed_finds_the_same_errors() {
        let errors = |seed: u64| -> Vec<(u64, Vec<u64>)> {
            let rows = size_sweep(1, seed, &|| false).unwrap().unwrap();
            let of = |row: &SizeRow| {
                let all = row.tests.iter().map(|t| t.excess.to_bits());
                (row.visible, all.collect())
            };
            rows.iter().map(of).collect()
        };
        assert_eq!(errors(3), errors(3));
        assert_ne!(errors(3), errors(4));
        assert_eq!(size_sweep(1, 1, &|| true), Ok(None));
    }
}
