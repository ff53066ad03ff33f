//! Picket fences: an item behind a gap is visible, however narrow the gap.

use glam::DVec3;

use super::super::{MaskedCentre, MaskedInner, OcclusionBuffer};
use super::by_rays::{Ready, front, missing, with_view};
use super::kept;
use crate::camera::{Camera, Frame, Lens};
use crate::kernel::Kernel;
use crate::scene::{Scene, SeededRng, WorldBox};
use crate::visibility::SampleGrid;

/// Counts the items behind a fence that are lost, and those that are visible.
///
/// The gaps are `gap` pixels wide; an item is visible if a ray through a gap meets it.
fn lost_behind_fence<B: OcclusionBuffer>(grid: SampleGrid, gap: f64, seed: u64) -> (usize, usize) {
    let mut rng = SeededRng::new(seed);
    let lens = Lens::perspective(60.0, 16.0 / 9.0, 0.1, None).unwrap();
    let [left, right, ..] = lens.window();
    let pixel = (right - left) / f64::from(grid.width) * 10.0;
    let mut boxes = Vec::new();
    let mut y = 10.0 * left;
    while y < 10.0 * right {
        let width = pixel * rng.between(6.0, 40.0);
        let (low, high) = (DVec3::new(10.0, y, -8.0), DVec3::new(10.0, y + width, 8.0));
        boxes.push(WorldBox::new(low, high));
        y += width + gap * pixel;
    }
    let pickets = boxes.len();
    for picket in 0..pickets {
        // At twice the distance of the gap, in line with it.
        let y = 2.0 * (boxes[picket].max.y + gap * pixel / 2.0);
        for storey in -2..3 {
            let at = DVec3::new(20.25, y, 2.0 * f64::from(storey));
            boxes.push(WorldBox::around(
                at,
                DVec3::new(0.5, rng.between(0.02, 0.3), 1.0),
            ));
        }
    }
    let ready = Ready::of(Scene::from_boxes("fence", &boxes).unwrap());
    let frame = Frame::looking_along(DVec3::ZERO, DVec3::X, DVec3::Z).unwrap();
    with_view(&ready, &Camera { frame, lens }, grid, |view, rays| {
        // Through the centre of each gap (y is opposite to the columns).
        let mut seen = Vec::new();
        for picket in &boxes[..pickets - 1] {
            let across = -(picket.max.y + gap * pixel / 2.0) / 10.0;
            let x = (across - left) / (right - left);
            for row in 1..40 {
                let ray = rays.through(x, f64::from(row) / 40.0);
                seen.extend(front(&ray, &ready.solids.boxes));
            }
        }
        seen.sort_unstable();
        seen.dedup();
        let lost = kept::<B>(&ready, view, Kernel::best());
        let lost = lost.iter().map(|kept| missing(&seen, kept).len());
        (lost.max().unwrap(), seen.len())
    })
}

const GRIDS: [(u32, u32); 4] = [(160, 90), (320, 180), (640, 360), (1280, 720)];
const GAPS: [f64; 5] = [4.0, 1.0, 0.5, 0.1, 0.03];

#[test]
fn whole_pixels_show_what_is_behind_a_gap() {
    let mut through = 0;
    for (width, height) in GRIDS {
        for gap in GAPS {
            let (lost, seen) =
                lost_behind_fence::<MaskedInner>(SampleGrid::new(width, height), gap, 1);
            assert_eq!(lost, 0, "{width}, gap {gap}");
            through += seen;
        }
    }
    assert!(through > 100, "{through}: the gaps show something");
}

#[test]
fn pixel_centres_hide_what_is_behind_a_gap() {
    for (width, height) in GRIDS {
        let grid = SampleGrid::new(width, height);
        let lost = GAPS.map(|gap| lost_behind_fence::<MaskedCentre>(grid, gap, 1).0);
        assert!(lost[3] > 0 && lost[4] > 0, "{width}: {lost:?}");
    }
}
