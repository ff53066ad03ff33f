//! A flat city: square blocks between streets, tall buildings in the blocks,
//! tiny street furniture along the kerbs. Wide in two axes and thin in the
//! third, with sizes from decimetres to a hundred metres.

use glam::DVec3;

use super::WorldBox;
use super::rng::SeededRng;
use super::tiling::World;
use crate::spec::{Spec, SpecError};

/// Items of one block on average: the city grows with the item count and
/// keeps its density.
const ITEMS_PER_BLOCK: f64 = 40.0;
/// Share of the items that are buildings; the rest stands in the streets.
const BUILDINGS: f64 = 0.25;

/// The blocks of a city along one axis, and the streets between them.
pub struct Grid {
    /// Width of a block.
    pub block: f64,
    /// Width of a street, which follows each block.
    pub street: f64,
    /// Number of blocks.
    pub blocks: usize,
    /// Lower end of the first block.
    pub corner: f64,
}

impl Grid {
    /// The grid of a city of `n` items.
    pub fn of(spec: &mut Spec, n: usize) -> Result<Grid, SpecError> {
        let block = spec.number_between("block", 80.0, 0.0, f64::INFINITY)?;
        let street = spec.number_between("street", 16.0, 0.0, f64::INFINITY)?;
        let blocks = (n as f64 / ITEMS_PER_BLOCK).sqrt().ceil().max(1.0) as usize;
        Ok(Grid {
            block,
            street,
            blocks,
            // Centred on zero: the tallest houses stand in the middle.
            corner: -(blocks as f64) * (block + street) / 2.0,
        })
    }
}

pub fn build(spec: &mut Spec, n: usize, rng: &mut SeededRng) -> Result<World, SpecError> {
    let Grid {
        block,
        street,
        blocks,
        corner,
    } = Grid::of(spec, n)?;
    let pitch = block + street;
    let boxes = (0..n).map(|_| {
        let cell = DVec3::new(rng.below(blocks) as f64, rng.below(blocks) as f64, 0.0);
        let low = cell * pitch + DVec3::new(corner, corner, 0.0);
        if rng.unit() < BUILDINGS {
            building(low, block, -corner, rng)
        } else {
            furniture(low, block, street, rng)
        }
    });
    Ok(World {
        boxes: boxes.collect(),
        ..World::default()
    })
}

/// A house on one of 4 x 4 plots of the block; towers grow towards the centre.
fn building(block_low: DVec3, block: f64, half_city: f64, rng: &mut SeededRng) -> WorldBox {
    let plot = block / 4.0;
    let cell = DVec3::new(rng.below(4) as f64, rng.below(4) as f64, 0.0);
    let centre = block_low + (cell + DVec3::new(0.5, 0.5, 0.0)) * plot;
    let downtown = 1.0 - (centre.x.abs().max(centre.y.abs()) / half_city).min(1.0);
    let floors = 2.0 + 4.0 * rng.unit() + 40.0 * downtown * downtown * rng.unit();
    let size = DVec3::new(
        rng.between(0.5, 0.95) * plot,
        rng.between(0.5, 0.95) * plot,
        3.0 * floors,
    );
    WorldBox::standing(centre, size)
}

/// A lamp, bin, sign or car on the street that borders the block.
fn furniture(block_low: DVec3, block: f64, street: f64, rng: &mut SeededRng) -> WorldBox {
    let along = rng.between(0.0, block + street);
    let across = block + rng.unit() * street;
    let place = if rng.unit() < 0.5 {
        DVec3::new(along, across, 0.0)
    } else {
        DVec3::new(across, along, 0.0)
    };
    let size = match rng.below(4) {
        0 => DVec3::new(0.2, 0.2, 5.0),
        1 => DVec3::new(0.5, 0.5, 1.0),
        2 => DVec3::new(0.1, 0.6, 2.2),
        _ => DVec3::new(4.2, 1.8, 1.5),
    };
    WorldBox::standing(block_low + place, size)
}
