//! Drawn images against the exact truth of their samples.

mod images;

use glam::DVec3;

use super::*;
use crate::camera::{Camera, Frame, Lens};
use crate::query::ItemId;
use crate::scene::{SeededRng, WorldBox, load};
use crate::visibility::truth::{Boxes, NO_ITEM, RayIndex, SampleTruth, SolidBox, fronts, judge};
use crate::visibility::{RayProbe, Rays, SampleGrid, Solids};

impl Canvas {
    /// Canvas of a camera, for boxes.
    pub fn of(rays: &Rays, grid: SampleGrid) -> Canvas {
        Canvas::about(rays, grid, DVec3::ZERO)
    }
}

fn all(solids: &Solids) -> Vec<SolidBox> {
    Boxes::of(solids).all
}

/// All boxes in list order and reversed, as items and as bodies.
fn orders(solids: &Solids) -> [(Vec<ItemId>, Vec<SolidBox>); 2] {
    let listed = all(solids);
    let items: Vec<ItemId> = listed.iter().map(|body| body.item).collect();
    let reversed: Vec<ItemId> = items.iter().rev().copied().collect();
    [items, reversed].map(|items| {
        let bodies = SolidBox::some(&solids.boxes, &items).collect();
        (items, bodies)
    })
}

/// Fragment counts of boxes in this order, ray by ray.
fn tallied(rays: &Rays, grid: SampleGrid, index: &RayIndex, order: &[ItemId]) -> FragmentCounts {
    let place = |item: ItemId| order.iter().position(|&other| other == item);
    let mut counts = FragmentCounts::default();
    for ray in rays.of_grid(grid) {
        let probe = index.probe(&ray);
        let mut met = index.all_hits(&ray);
        met.sort_by(|(a, at_a), (b, at_b)| a.cmp(b).then(probe.compare(at_a, at_b)));
        met.dedup_by_key(|(item, _)| *item);
        met.sort_by_key(|(item, _)| place(*item));
        counts.fragment_count += met.len() as u64;
        counts.covered_count += u64::from(!met.is_empty());
        let mut front = None;
        for layer in &met {
            let is_nearer = front.is_none_or(|(item, at)| {
                probe.compare(&layer.1, at).then(layer.0.cmp(item)).is_lt()
            });
            if is_nearer {
                front = Some((&layer.0, &layer.1));
                counts.shaded_count += 1;
            }
        }
    }
    counts
}

/// Draws bodies in this order on an empty image.
fn draw(canvas: &Canvas, bodies: impl IntoIterator<Item = SolidBox>, tests: &Tests<'_>) -> Drawn {
    let mut drawn = Drawn::new(canvas.screen.grid.samples());
    drawn.draw(canvas, bodies, tests);
    drawn
}

/// Cameras on the ground and above the scene, with all lenses.
pub fn cameras(solids: &Solids, seed: u64) -> Vec<Camera> {
    let low = solids
        .boxes
        .iter()
        .fold(DVec3::INFINITY, |low, b| low.min(b.min));
    let high = solids
        .boxes
        .iter()
        .fold(DVec3::NEG_INFINITY, |high, b| high.max(b.max));
    let mut rng = SeededRng::new(seed);
    let mut cameras = Vec::new();
    for lens in [
        Lens::perspective(60.0, 1.5, 0.25, None),
        Lens::off_axis([-0.1, 0.3, -0.2, 0.1], 0.25, Some(300.0)),
        Lens::orthographic(60.0, 1.5, -5.0, 800.0),
    ] {
        for (height, down) in [(low.z + (high.z - low.z) / 8.0, 0.0), (high.z + 20.0, -0.7)] {
            let at = low + (high - low) * rng.point();
            // Roughly towards the middle.
            let to = low + (high - low) * (rng.point() * 0.5 + 0.25) - at;
            let forward = DVec3::new(to.x, to.y, to.truncate().length() * down);
            let eye = DVec3::new(at.x, at.y, height);
            let frame = Frame::looking_along(eye, forward, DVec3::Z).unwrap();
            let lens = lens.clone().unwrap();
            cameras.push(Camera { frame, lens });
        }
    }
    cameras
}

const GRID: SampleGrid = SampleGrid::new(48, 32);

#[test]
fn the_z_test_leaves_the_sample_truth_whatever_the_order() {
    let mut seen = 0;
    for name in ["city:n=800", "rooms:n=800", "clustered:n=800"] {
        let solids = Solids::of(&load(name, &Default::default()).unwrap());
        let index = RayIndex::build(&solids);
        for camera in cameras(&solids, 4) {
            let rays = Rays::of(&camera).unwrap();
            let canvas = Canvas::of(&rays, GRID);
            let truth = SampleTruth::of(&index, &rays, GRID, 1);
            let fronts = fronts(&index, &|_, _, _| true, &rays, GRID);
            seen += truth.visible.len();
            for (n, (_, bodies)) in orders(&solids).into_iter().enumerate() {
                let drawn = draw(&canvas, bodies, &Tests::default());
                assert_eq!(drawn.ids(), fronts, "{name} {n}");
                assert_eq!(drawn.visible(&canvas), truth.visible, "{name} {n}");
                assert!(drawn.counts.shaded_count >= drawn.counts.covered_count);
            }
        }
    }
    assert!(seen > 100, "the premise: {seen}");
}

#[test]
fn worlds_full_of_ties_are_drawn_as_they_are_seen() {
    let mut rng = SeededRng::new(8);
    let grid = SampleGrid::new(8, 6);
    let mut tied = 0;
    for _ in 0..150 {
        let count = 1 + rng.below(10);
        let solids = judge::solids(&judge::ties(&mut rng, count));
        let camera = judge::camera(&mut rng);
        let rays = Rays::of(&camera).unwrap();
        let index = RayIndex::build(&solids);
        let truth = SampleTruth::of(&index, &rays, grid, 1);
        let fronts = fronts(&index, &|_, _, _| true, &rays, grid);
        let canvas = Canvas::of(&rays, grid);
        for (items, bodies) in orders(&solids) {
            let counts = tallied(&rays, grid, &index, &items);
            let drawn = draw(&canvas, bodies, &Tests::default());
            assert_eq!(
                drawn.ids(),
                fronts,
                "{items:?} {camera:?} {:?}",
                solids.boxes
            );
            assert_eq!(drawn.visible(&canvas), truth.visible, "{items:?}");
            // The same fragments are shaded, ray by ray.
            let asked_count = 0;
            assert_eq!(
                counts,
                FragmentCounts {
                    asked_count,
                    ..drawn.counts
                },
                "{items:?}"
            );
        }
        let samples: u32 = truth.samples_of.iter().sum();
        let covered = fronts.iter().filter(|&&id| id != NO_ITEM).count();
        tied += samples as usize - covered;
    }
    assert!(tied > 40, "the premise: {tied}");
}
