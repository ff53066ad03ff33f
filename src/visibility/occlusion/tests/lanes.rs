//! Sixteen boxes at once compared with each box alone.
//!
//! Rectangles contain their boxes, and a query for all lanes equals a query for each.

use glam::DVec3;

use super::super::rect::Rects;
use super::super::{Interleaved, MaskedInner, OcclusionBuffer, View};
use super::by_rays::{Ready, point_between, with_view};
use crate::camera::{Camera, Frame, Lens};
use crate::kernel::{Isa, Kernel, LaneMask, Work};
use crate::scene::{Scene, SeededRng, WorldBox};
use crate::visibility::SampleGrid;

const GRID: SampleGrid = SampleGrid::new(320, 180);
/// Pixels so fine that the rounding of coordinates shows.
const FINE: SampleGrid = SampleGrid::new(32_000, 18_000);

/// Boxes in front of an eye that is about `far_out` away from the scene's origin.
fn before_eye(far_out: f64, seed: u64) -> (Ready, Frame) {
    let mut rng = SeededRng::new(seed);
    let eye = DVec3::new(far_out, 1.7 - far_out, far_out / 3.0);
    let boxes: Vec<WorldBox> = (0..3000)
        .map(|_| {
            let low = point_between(
                DVec3::new(-5.0, -40.0, -25.0),
                DVec3::new(60.0, 40.0, 25.0),
                &mut rng,
            );
            let size = rng.point() * if rng.below(8) == 0 { 12.0 } else { 1.0 };
            WorldBox::new(eye + low, eye + low + size)
        })
        .collect();
    let scene = Scene::about("before", &boxes, DVec3::ZERO).unwrap();
    let forward = DVec3::new(1.0, rng.between(-0.3, 0.3), rng.between(-0.3, 0.3));
    (
        Ready::of(scene),
        Frame::looking_along(eye, forward, DVec3::Z).unwrap(),
    )
}

fn lenses() -> [Lens; 3] {
    [
        Lens::perspective(60.0, 16.0 / 9.0, 0.1, None).unwrap(),
        Lens::off_axis([-0.02, 0.13, -0.05, 0.03], 0.1, Some(500.0)).unwrap(),
        Lens::orthographic(30.0, 16.0 / 9.0, 0.0, 100.0).unwrap(),
    ]
}

/// Computes the rectangles of all items, block by block.
struct Projected<'a>(&'a Ready, &'a View<'a>);

impl Work for Projected<'_> {
    type Output = Vec<Rects>;

    #[inline(always)]
    fn run<I: Isa>(self, isa: I) -> Vec<Rects> {
        let mut rects = Rects::default();
        let mut all = Vec::new();
        for block in self.0.occluders.levels[0].blocks() {
            rects.project(isa, block, self.1);
            all.push(rects);
        }
        all
    }
}

#[test]
fn rectangles_hold_every_corner_of_their_boxes() {
    for far_out in [0.0, 3e4] {
        let (ready, frame) = before_eye(far_out, 3);
        for lens in lenses() {
            let camera = Camera { frame, lens };
            let held = with_view(&ready, &camera, FINE, |view, _| {
                let all = Kernel::best().run(Projected(&ready, view));
                for kernel in Kernel::available() {
                    let same = kernel.run(Projected(&ready, view));
                    assert_eq!(format!("{same:?}"), format!("{all:?}"), "{kernel}");
                }
                let held = |(n, rects): (usize, &Rects)| corners_held(&ready, view, n, rects);
                all.iter().enumerate().map(held).sum::<usize>()
            });
            assert!(held > 3000, "{held}");
        }
    }
}

/// Checks the lanes of a block; returns the number of corners in the image.
fn corners_held(ready: &Ready, view: &View, block: usize, rects: &Rects) -> usize {
    let mut held = 0;
    let lanes = ready.occluders.lanes(0, block) & rects.flat;
    for lane in (0..16).filter(|lane| lanes >> lane & 1 == 1) {
        let rect = rects.get(lane);
        let b = ready.occluders.outer(block * 16 + lane);
        for corner in (0..8).map(|i| b.corner(i).as_dvec3() - view.eye) {
            let depth = corner.dot(view.forward);
            // Relative to the axes of the image.
            let [across, down] = [
                |l: &super::super::LinearFunction| l.x,
                |l: &super::super::LinearFunction| l.y,
            ]
            .map(|of| DVec3::from_array(std::array::from_fn(|k| of(&view.rays[k]))));
            let start = DVec3::from_array(std::array::from_fn(|k| view.rays[k].c));
            let aside = if view.parallel {
                corner
            } else {
                corner / depth
            } - start;
            let x = aside.dot(across) / across.length_squared();
            let y = aside.dot(down) / down.length_squared();
            let nearness = if view.parallel {
                view.far - depth
            } else {
                1.0 / depth
            };
            assert!(
                f64::from(rect.nearness) >= nearness,
                "{} {nearness}",
                rect.nearness
            );
            let [width, height] = [view.grid.width, view.grid.height].map(f64::from);
            if (0.0..width).contains(&x) && (0.0..height).contains(&y) {
                held += 1;
                assert!(rects.seen >> lane & 1 == 1);
                let (x, y) = (x as u16, y as u16);
                assert!((rect.x0..=rect.x1).contains(&x), "{rect:?} {x}");
                assert!((rect.y0..=rect.y1).contains(&y), "{rect:?} {y}");
            }
        }
    }
    held
}

/// Tests all boxes of all blocks, sixteen at once and one by one.
struct Hidden<'a>(&'a MaskedInner, &'a [Rects]);

impl Work for Hidden<'_> {
    type Output = Vec<[LaneMask; 2]>;

    #[inline(always)]
    fn run<I: Isa>(self, isa: I) -> Self::Output {
        let both = |rects: &Rects| {
            let lanes = rects.flat & rects.seen;
            let at_once = self.0.hides_lanes(isa, rects, lanes);
            let each = (0..16).filter(|&l| lanes >> l & 1 == 1 && self.0.hides(isa, &rects.get(l)));
            [at_once, each.fold(0, |all, lane| all | 1 << lane)]
        };
        self.1.iter().map(both).collect()
    }
}

#[test]
fn sixteen_at_once_are_each_one_by_itself() {
    let (ready, frame) = before_eye(0.0, 4);
    for lens in lenses() {
        with_view(&ready, &Camera { frame, lens }, GRID, |view, _| {
            let mut culler = Interleaved::new(MaskedInner::new(GRID), Kernel::best());
            culler.cull(&ready.occluders, view, &mut Vec::new());
            let rects = Kernel::best().run(Projected(&ready, view));
            for kernel in Kernel::available() {
                let answers = kernel.run(Hidden(&culler.buffer, &rects));
                assert!(
                    answers.iter().all(|[at_once, each]| at_once == each),
                    "{kernel}"
                );
                let hidden: u32 = answers.iter().map(|[all, _]| all.count_ones()).sum();
                assert!(hidden > 100, "{hidden}");
            }
        });
    }
}
