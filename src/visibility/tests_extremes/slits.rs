//! Walls with gaps of a fraction of a pixel: pickets, tiles of a lattice, bricks.

use glam::DVec3;

use super::case::{StageCase, along_x, flat};
use crate::scene::{SeededRng, WorldBox};
use crate::visibility::SampleGrid;

/// Resolutions of the occlusion buffer for fences.
const GRIDS: [SampleGrid; 4] = [
    SampleGrid::new(80, 45),
    SampleGrid::new(160, 90),
    SampleGrid::new(320, 180),
    SampleGrid::new(640, 360),
];
/// Distance of the walls from the eye.
const DISTANCE: f64 = 10.0;
const NEAR: f64 = 0.1;

/// Left, right, bottom and top of the image at the distance of the walls.
fn image() -> [f64; 4] {
    along_x(NEAR).lens.window().map(|slope| DISTANCE * slope)
}

/// A small box behind a wall, on the line of sight through a point of the wall.
fn behind(rng: &mut SeededRng, through: DVec3) -> WorldBox {
    let half = DVec3::new(0.5, rng.between(0.02, 0.3), rng.between(0.02, 0.3));
    WorldBox::around(through * rng.between(1.5, 4.0), half)
}

/// Intervals from `low` to `high` with gaps between them.
///
/// Each is `least` to `most` pixels long.
fn bars(
    rng: &mut SeededRng,
    [low, high]: [f64; 2],
    pixel: f64,
    [least, most]: [f64; 2],
    gap: f64,
) -> Vec<[f64; 2]> {
    let mut bars = Vec::new();
    let mut from = low;
    while from < high {
        let to = from + pixel * rng.between(least, most);
        bars.push([from, to]);
        from = to + gap;
    }
    bars
}

/// A wall with a small box behind each of its gaps.
fn wall(rng: &mut SeededRng, mut boxes: Vec<WorldBox>, aims: Vec<DVec3>) -> StageCase {
    boxes.extend(aims.iter().map(|&aim| behind(rng, aim)));
    StageCase {
        aims,
        ..StageCase::new(rng, boxes, along_x(NEAR))
    }
}

/// Pickets with gaps of 4 to 0.03 pixels at one of four resolutions.
pub fn fence(rng: &mut SeededRng) -> StageCase {
    let grid = GRIDS[rng.below(GRIDS.len())];
    let [left, right, ..] = image();
    let pixel = (right - left) / f64::from(grid.width);
    let gap = pixel * libm::exp2(rng.between(-5.0, 2.0));
    let pickets = bars(rng, [left, right], pixel, [6.0, 40.0], gap);
    let boxes = pickets
        .iter()
        .map(|&across| flat(DISTANCE, across, [-8.0, 8.0]));
    let through = pickets.iter().map(|[_, end]| end + gap / 2.0);
    let aims = through.map(|y| DVec3::new(DISTANCE, y, rng.between(-4.0, 4.0)));
    let aims = aims.collect();
    StageCase {
        grid,
        ..wall(rng, boxes.collect(), aims)
    }
}

/// Tiles with gaps of 4 to 0.1 pixels both across and up.
pub fn lattice(rng: &mut SeededRng) -> StageCase {
    let grid = GRIDS[rng.below(3)];
    let [left, right, bottom, top] = image();
    let pixel = (right - left) / f64::from(grid.width);
    let mut gap = || pixel * libm::exp2(rng.between(-3.3, 2.0));
    let gaps = [gap(), gap()];
    let columns = bars(rng, [left, right], pixel, [10.0, 40.0], gaps[0]);
    let rows = bars(rng, [bottom, top], pixel, [10.0, 40.0], gaps[1]);
    let tiles = columns
        .iter()
        .flat_map(|&across| rows.iter().map(move |&up| flat(DISTANCE, across, up)));
    let aims = (0..60).map(|_| {
        let y = columns[rng.below(columns.len())][1] + gaps[0] / 2.0;
        let z = rows[rng.below(rows.len())][1] + gaps[1] / 2.0;
        // Through a slit, or through a crossing of two slits.
        match rng.below(3) {
            0 => DVec3::new(DISTANCE, y, rng.between(bottom, top)),
            1 => DVec3::new(DISTANCE, rng.between(left, right), z),
            _ => DVec3::new(DISTANCE, y, z),
        }
    });
    let aims = aims.collect();
    StageCase {
        grid,
        ..wall(rng, tiles.collect(), aims)
    }
}

/// Bricks whose seams end on the next course: closed, or open by up to 0.001.
pub fn t_junctions(rng: &mut SeededRng) -> StageCase {
    let (length, height) = (2.0, 0.75);
    let (mut bricks, mut aims) = (Vec::new(), Vec::new());
    for course in -8..8 {
        let low = f64::from(course) * height;
        let shift = rng.below(4) as f64 * 0.5;
        for column in -6..6 {
            let start = f64::from(column) * length + shift;
            let end = start + length;
            let crack = [0.0, end.abs() * f64::EPSILON, 1e-7, 1e-3][rng.below(4)];
            bricks.push(flat(DISTANCE, [start, end - crack], [low, low + height]));
            // Along the seam, often just above the brick at which it ends.
            let up = [rng.unit(), rng.unit() * 1e-6][rng.below(2)];
            aims.push(DVec3::new(DISTANCE, end - crack / 2.0, low + height * up));
        }
    }
    wall(rng, bricks, aims)
}
