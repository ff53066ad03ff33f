//! A case of the occlusion stage: boxes, a camera, a buffer and ray targets.

use glam::DVec3;

use crate::camera::{Camera, Frame, Lens};
use crate::scene::{SeededRng, WorldBox};
use crate::visibility::SampleGrid;

/// Number of random rays per case.
pub const RAYS: usize = 1_000;

/// Resolutions of the occlusion buffers, from coarse to that of a small image.
///
/// At the coarse ones much lies between the samples.
const GRIDS: [SampleGrid; 4] = [
    SampleGrid::new(40, 25),
    SampleGrid::new(80, 45),
    SampleGrid::new(160, 90),
    SampleGrid::new(320, 180),
];

/// Input of the back ends under test.
pub struct StageCase {
    /// Items.
    pub boxes: Vec<WorldBox>,
    /// Camera of the view.
    pub camera: Camera,
    /// Pixels of the buffers.
    pub grid: SampleGrid,
    /// Targets of rays in addition to the random ones: gaps, seams, rims.
    pub aims: Vec<DVec3>,
}

impl StageCase {
    /// A case on a random grid, without targets.
    pub fn new(rng: &mut SeededRng, boxes: Vec<WorldBox>, camera: Camera) -> StageCase {
        StageCase {
            boxes,
            camera,
            grid: GRIDS[rng.below(GRIDS.len())],
            aims: Vec::new(),
        }
    }

    /// Adds slivers: small boxes behind corners of other boxes.
    ///
    /// An edge hides them entirely or except for a fraction of a pixel.
    pub fn with_slivers(mut self, rng: &mut SeededRng) -> StageCase {
        let frame = &self.camera.frame;
        let of_boxes = self.boxes.len();
        for _ in 0..SLIVERS {
            let b = &self.boxes[rng.below(of_boxes)];
            let corner = [b.min, b.max].map(|corner| corner.to_array());
            let corner = DVec3::from([0, 1, 2].map(|axis| corner[rng.below(2)][axis]));
            let way = corner - frame.eye;
            let beyond = match self.camera.lens.is_orthographic() {
                true => frame.forward() * rng.between(0.5, 10.0),
                false => way * rng.between(0.1, 2.0),
            };
            let size = (way + beyond).length() * libm::pow(10.0, rng.between(-4.0, -2.0));
            let centre = corner + beyond + (rng.point() * 2.0 - 1.0) * size;
            let sliver = WorldBox::around(centre, DVec3::splat(size));
            self.aims.extend([0.05, 0.5, 0.95].map(|part| {
                let along = DVec3::new(part, rng.unit(), rng.unit());
                sliver.min + (sliver.max - sliver.min) * along
            }));
            self.boxes.push(sliver);
        }
        self
    }
}

/// Slivers per case.
const SLIVERS: usize = 24;

/// A camera at the origin that looks along x, z up, without a far plane.
pub fn along_x(near: f64) -> Camera {
    let lens = Lens::perspective(60.0, 16.0 / 9.0, near, None).expect("a lens");
    looking(DVec3::ZERO, DVec3::X, lens)
}

/// A camera that looks along `forward`, with z up.
pub fn looking(eye: DVec3, forward: DVec3, lens: Lens) -> Camera {
    let frame = Frame::looking_along(eye, forward, DVec3::Z).expect("a direction beside up");
    Camera { frame, lens }
}

/// A rectangle in a plane perpendicular to x.
pub fn flat(x: f64, [left, right]: [f64; 2], [low, high]: [f64; 2]) -> WorldBox {
    WorldBox::new(DVec3::new(x, left, low), DVec3::new(x, right, high))
}

/// A random fraction of an edge, often next to one of its ends.
pub fn along(rng: &mut SeededRng) -> f64 {
    match rng.below(3) {
        0 => rng.unit(),
        1 => rng.unit() * 1e-3,
        _ => 1.0 - rng.unit() * 1e-3,
    }
}
