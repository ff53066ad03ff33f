//! Drawn images against the exact truth of their samples.

mod images;

use glam::DVec3;

use super::*;
use crate::camera::{Camera, Frame, Lens};
use crate::query::ItemId;
use crate::scene::{SeededRng, WorldBox, load};
use crate::visibility::truth::{Along, Boxes, NO_ITEM, RayIndex, SampleTruth, SolidBox, judge};
use crate::visibility::{Guarantee, Rays, SampleGrid, Solids};
use order::{ORDERS, OrderRow, Partition, parted, parted_within};

fn all(solids: &Solids) -> Vec<SolidBox> {
    Boxes::of(solids).all
}

/// The items of pieces as bodies, in this order.
fn bodies(solids: &Solids, pieces: &[Piece]) -> Vec<SolidBox> {
    let body = |piece: &Piece| SolidBox {
        b: solids.boxes[piece.item as usize],
        item: piece.item,
    };
    pieces.iter().map(body).collect()
}

/// Draws bodies in this order on an empty image.
fn draw(canvas: &Canvas, bodies: impl IntoIterator<Item = SolidBox>, tests: &Tests<'_>) -> Drawn {
    let mut drawn = Drawn::new(canvas.grid().samples());
    drawn.draw(canvas, bodies, tests);
    drawn
}

/// Samples at which an item is entered through a piece of it.
fn entered(canvas: &Canvas, solids: &Solids, piece: &Piece) -> Vec<usize> {
    let is_in = |sample: &usize| {
        let probe = canvas.probe(*sample);
        let enters = |b: &WorldBox| probe.enter(b, f64::INFINITY);
        let Some(at) = enters(&solids.boxes[piece.item as usize]) else {
            return false;
        };
        let Some(part) = &piece.part else {
            return true;
        };
        enters(part).is_some_and(|of_part| probe.compare(&at, &of_part).is_eq())
    };
    (0..canvas.grid().samples()).filter(is_in).collect()
}

/// Cost and errors of one order of all boxes.
fn drawn_in(
    solids: &Solids,
    rays: &Rays,
    grid: SampleGrid,
    pieces: &[Piece],
) -> (Tally, OrderErrors) {
    let left: Vec<ItemId> = (0..solids.boxes.len() as ItemId).collect();
    let index = RayIndex::build(solids);
    let orders = [pieces.to_vec()];
    let mut drawn = draw_orders(rays, grid, &index, &left, &|_, _, _| true, &orders);
    let (tally, errors) = drawn.remove(0);
    (tally, errors.unwrap())
}

/// The orders of boxes, ready for them.
fn orders(solids: &Solids) -> Vec<(&'static OrderRow, Box<dyn DepthOrder>)> {
    let built = ORDERS.iter().filter_map(|row| {
        let order = (row.build)(solids, true)?;
        Some((row, order))
    });
    built.collect()
}

/// Cameras in a scene: on the ground and above it, of all lenses.
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
            // Towards the middle, more or less.
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
        let orders = orders(&solids);
        for camera in cameras(&solids, 4) {
            let rays = Rays::of(&camera).unwrap();
            let canvas = Canvas::of(&rays, GRID);
            let truth = SampleTruth::of(&index, &rays, GRID, 1);
            seen += truth.visible.len();
            let mut pieces = Vec::new();
            for (row, order) in &orders {
                order.order(&camera, &mut pieces);
                let drawn = draw(&canvas, bodies(&solids, &pieces), &Tests::default());
                assert_eq!(drawn.ids(), truth.front, "{name} {}", row.name);
                assert_eq!(drawn.visible(&canvas), truth.visible, "{name} {}", row.name);
                assert!(drawn.tally.shaded_count >= drawn.tally.covered_count);
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
        let canvas = Canvas::of(&rays, grid);
        let mut pieces = Vec::new();
        for (row, order) in orders(&solids) {
            order.order(&camera, &mut pieces);
            let drawn = draw(&canvas, bodies(&solids, &pieces), &Tests::default());
            assert_eq!(
                drawn.ids(),
                truth.front,
                "{} {camera:?} {:?}",
                row.name,
                solids.boxes
            );
            assert_eq!(drawn.visible(&canvas), truth.visible, "{}", row.name);
        }
        let samples: u32 = truth.samples_of.iter().sum();
        let covered = truth.front.iter().filter(|&&id| id != NO_ITEM).count();
        tied += samples as usize - covered;
    }
    assert!(tied > 40, "the premise: {tied}");
}

/// Boxes that share no inner point, some of them touching.
fn apart(rng: &mut SeededRng, count: usize) -> Vec<WorldBox> {
    let mut boxes: Vec<WorldBox> = Vec::new();
    while boxes.len() < count {
        let whole = |rng: &mut SeededRng, n: usize| rng.below(n) as f64;
        let low = DVec3::from([(); 3].map(|()| whole(rng, 24) - 12.0));
        let size = DVec3::from([(); 3].map(|()| 1.0 + whole(rng, 9)));
        let b = WorldBox::new(low, low + size);
        let meets = |o: &WorldBox| (0..3).all(|k| b.min[k] < o.max[k] && o.min[k] < b.max[k]);
        if !boxes.iter().any(meets) {
            boxes.push(b);
        }
    }
    boxes
}

/// How many parts the items were cut into.
fn parts(tree: &Partition) -> usize {
    let frame = Frame::looking_along(DVec3::ZERO, DVec3::X, DVec3::Z).unwrap();
    let lens = Lens::perspective(70.0, 1.3, 0.5, None).unwrap();
    let mut pieces = Vec::new();
    tree.order(&Camera { frame, lens }, &mut pieces);
    pieces.len()
}

#[test]
fn the_painters_picture_by_bsp_is_exact_and_by_distances_it_is_not() {
    let mut rng = SeededRng::new(12);
    let grid = SampleGrid::new(40, 30);
    let mut wrong = vec![0; ORDERS.len()];
    let (mut pairs, mut cut) = (0, 0);
    for world in 0..12 {
        // Apart, and overlapping at random.
        let boxes = match world % 2 {
            0 => apart(&mut rng, 40),
            _ => judge::ties(&mut rng, 25),
        };
        let solids = judge::solids(&boxes);
        cut += parts(&parted(&solids)) - boxes.len();
        for lens in [
            Lens::perspective(70.0, 1.3, 0.5, None),
            Lens::orthographic(30.0, 1.3, -40.0, 80.0),
        ] {
            let eye = rng.normal3().normalize() * 25.0;
            let frame = Frame::looking_along(eye, -eye, DVec3::Z).unwrap();
            let lens = lens.clone().unwrap();
            let camera = Camera { frame, lens };
            let rays = Rays::of(&camera).unwrap();
            let canvas = Canvas::of(&rays, grid);
            let mut pieces = Vec::new();
            for (i, (row, order)) in orders(&solids).into_iter().enumerate() {
                order.order(&camera, &mut pieces);
                let (tally, errors) = drawn_in(&solids, &rays, grid, &pieces);
                wrong[i] += errors.wrong;
                pairs += errors.pairs;
                // The painter's picture, drawn, is wrong where it was said to be.
                let whole = draw(&canvas, all(&solids), &Tests::default());
                let ids = whole.ids();
                let mut last = vec![NO_ITEM; ids.len()];
                let mut fragments = 0;
                for piece in pieces.iter().rev() {
                    for sample in entered(&canvas, &solids, piece) {
                        last[sample] = piece.item;
                        fragments += 1;
                    }
                }
                let differing = last.iter().zip(&ids).filter(|(last, id)| last != id);
                let tied = |sample: usize| {
                    let probe = canvas.probe(sample);
                    let at =
                        |item: ItemId| probe.enter(&solids.boxes[item as usize], f64::INFINITY);
                    let (a, b) = (at(last[sample]).unwrap(), at(ids[sample]).unwrap());
                    probe.compare(&a, &b).is_eq()
                };
                let ties = (0..ids.len())
                    .filter(|&s| last[s] != ids[s] && tied(s))
                    .count();
                assert_eq!((differing.count() - ties) as u64, errors.wrong_samples);
                if row.guarantee == Guarantee::Exact {
                    assert_eq!(errors.wrong_samples, 0);
                    // Each item once at a sample, in however many parts it comes.
                    assert_eq!(fragments, whole.tally.fragment_count);
                    assert_eq!(tally.fragment_count, fragments);
                    // From front to back nothing is shaded twice, but for ties.
                    assert!(tally.shaded_count <= tally.covered_count + ties as u64);
                }
            }
        }
    }
    let of = |name: &str| wrong[ORDERS.iter().position(|row| row.name == name).unwrap()];
    assert_eq!(of("bsp"), 0, "of {pairs} pairs");
    assert!(cut > 0, "the premise: boxes were cut");
    assert!(of("box-distance") > 0 && of("none") > of("box-distance"));
}

/// Three beams that lie on each other in a circle: no order is right, but that of
/// their parts.
#[test]
fn overlaps_in_a_cycle_are_undone_by_cutting_only() {
    let beam = |low: [f64; 3], high: [f64; 3]| WorldBox::new(low.into(), high.into());
    // x over y over z over x, seen along the diagonal.
    let solids = judge::solids(&[
        beam([0.0, 2.0, 1.0], [6.0, 3.0, 2.0]),
        beam([1.0, 0.0, 2.0], [2.0, 6.0, 3.0]),
        beam([2.0, 1.0, 0.0], [3.0, 2.0, 6.0]),
    ]);
    let eye = DVec3::splat(14.0);
    let forward = DVec3::splat(2.0) - eye;
    let frame = Frame::looking_along(eye, forward, DVec3::new(0.1, 0.2, 1.0)).unwrap();
    let lens = Lens::perspective(60.0, 1.0, 0.5, None).unwrap();
    let camera = Camera { frame, lens };
    let rays = Rays::of(&camera).unwrap();
    let errors = |name: &str| {
        let (order, mut pieces) = (of_boxes(name, &solids), Vec::new());
        order.order(&camera, &mut pieces);
        drawn_in(&solids, &rays, SampleGrid::new(80, 80), &pieces).1
    };
    let (sorted, cut) = (errors("box-distance"), errors("bsp"));
    assert_eq!((cut.wrong, cut.wrong_samples), (0, 0));
    assert!(sorted.wrong > 0 && sorted.wrong_samples > 0);
}

/// Boxes each within the next, hardly larger: hundreds of parts.
#[test]
fn nested_boxes_are_cut_until_the_order_is_exact_or_it_is_said() {
    let cube = |at: [f64; 3], half: f64| {
        let middle = DVec3::from(at) + 1e5;
        WorldBox::new(middle - half, middle + half)
    };
    let boxes = [
        cube([15.0, 0.0, 0.0], 8.0),
        cube([15.0, 0.0, 0.0], 8.000_000_1),
        cube([0.0, 0.0, 0.0], 3.000_000_1),
        cube([15.0, 0.0, 0.0], 7.000_000_1),
        cube([15.0, 0.0, 0.0], 12.0),
        cube([20.0, 0.0, 0.0], 11.000_000_1),
    ];
    let solids = judge::solids(&boxes);
    let tree = parted(&solids);
    let count = parts(&tree);
    assert!(count > 8 * boxes.len(), "the premise: many parts, {count}");
    let eye = DVec3::new(-12.868_988_890, 17.166_524_562, -18.450_470_565) + 1e5;
    let frame = Frame::looking_along(eye, DVec3::X, DVec3::Z).unwrap();
    let lens = Lens::perspective(130.0, 16.0 / 9.0, 2.0, None).unwrap();
    let camera = Camera { frame, lens };
    let (rays, grid) = (Rays::of(&camera).unwrap(), SampleGrid::new(32, 18));
    let mut pieces = Vec::new();
    tree.order(&camera, &mut pieces);
    let (_, errors) = drawn_in(&solids, &rays, grid, &pieces);
    assert_eq!((errors.wrong_samples, tree.exception(&camera)), (0, None));
    assert!(errors.pairs > 6, "the premise: they overlap in the image");
    // What is within a box is never drawn.
    let canvas = Canvas::of(&rays, grid);
    let whole = draw(&canvas, all(&solids), &Tests::default());
    let of_piece = |piece| entered(&canvas, &solids, piece).len() as u64;
    let fragments: u64 = pieces.iter().map(of_piece).sum();
    assert_eq!(fragments, whole.tally.fragment_count);
    // The eye in the plane of a face, and more parts than there is room for.
    let frame = Frame::looking_along(eye.with_x(1e5 + 7.0), DVec3::Y, DVec3::Z).unwrap();
    let within = Camera { frame, lens };
    assert!(tree.exception(&within).unwrap().contains("plane"));
    let tree = parted_within(&solids, 2 * boxes.len());
    assert!(tree.exception(&camera).unwrap().contains("limit on cuts"));
}

fn of_boxes(name: &str, solids: &Solids) -> Box<dyn DepthOrder> {
    (row(name).build)(solids, true).unwrap()
}

fn row(name: &str) -> &'static order::OrderRow {
    ORDERS.iter().find(|row| row.name == name).unwrap()
}
