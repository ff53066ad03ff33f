//! Generated boxes, a function per family.
//!
//! Cities, forests, clusters, layouts of other benchmarks (Bevy's `many_cubes`, `sseculling`, the
//! trees of bepuphysics), and extreme shapes: a line, a plane, piles, a lattice.

use std::f64::consts::TAU;

use glam::DVec3;

use super::WorldBox;
use super::rng::{SeededRng, fractal, mix64, octaves, on_sphere};
use crate::spec::{Spec, SpecError};

/// The boxes of a family, or the error of a parameter.
pub type Made = Result<Vec<WorldBox>, SpecError>;

/// Boxes scattered evenly in a cube: a scene without structure.
///
/// Edges vary between half and one and a half times the mean, per axis.
pub fn uniform(spec: &mut Spec, n: usize, rng: &mut SeededRng) -> Made {
    let side = spec.number_between("side", 1000.0, 0.0, f64::INFINITY)?;
    let fitting = 0.2 * side / libm::cbrt(n.max(1) as f64);
    let size = spec.number_between("size", fitting, 0.0, f64::INFINITY)?;
    Ok(scattered(n, rng, DVec3::splat(side), size))
}

/// Boxes of this mean edge with centres anywhere in a block.
fn scattered(n: usize, rng: &mut SeededRng, block: DVec3, size: f64) -> Vec<WorldBox> {
    let boxes = (0..n).map(|_| {
        let centre = rng.point() * block;
        WorldBox::around(centre, (rng.point() + 0.5) * size)
    });
    boxes.collect()
}

/// Gaussian clusters of uneven weight.
///
/// Dense spots in mostly empty space, as in asset-heavy levels or point-like survey data.
///
/// Cluster k attracts items in proportion to 1/(k+1) (Zipf), so that a few clusters hold
/// most of the scene.
pub fn clustered(spec: &mut Spec, n: usize, rng: &mut SeededRng) -> Made {
    let clusters = spec.whole("clusters", 64, 1..=1_000_000)? as usize;
    let side = spec.number_between("side", 1000.0, 0.0, f64::INFINITY)?;
    let spread = spec.number_between("spread", 0.02, 0.0, 10.0)? * side;
    let centres: Vec<_> = (0..clusters).map(|_| rng.point() * side).collect();
    let mut total = 0.0;
    let weights = (1..=clusters).map(|k| {
        total += 1.0 / k as f64;
        total
    });
    let cumulative: Vec<f64> = weights.collect();
    let size = 0.2 * spread / libm::cbrt(n.max(1) as f64 / clusters as f64).max(1.0);
    let boxes = (0..n).map(|_| {
        let draw = rng.unit() * total;
        let k = cumulative.partition_point(|&c| c < draw).min(clusters - 1);
        let centre = centres[k] + rng.normal3() * spread;
        WorldBox::around(centre, (rng.point() + 0.5) * size)
    });
    Ok(boxes.collect())
}

/// Average number of items per block: a city keeps its density as it grows.
const ITEMS_PER_BLOCK: f64 = 40.0;
/// Share of the items that are buildings; the others stand in the streets.
const BUILDINGS: f64 = 0.25;

/// The blocks of a city along one axis, and the streets between them.
#[derive(Debug)]
pub struct CityGrid {
    /// Width of a block.
    pub block: f64,
    /// Width of a street, which follows each block.
    pub street: f64,
    /// Number of blocks.
    pub blocks: usize,
    /// Lower end of the first block.
    pub corner: f64,
}

impl CityGrid {
    /// The grid of a city of `n` items.
    pub fn of(spec: &mut Spec, n: usize) -> Result<CityGrid, SpecError> {
        let block = spec.number_between("block", 80.0, 0.0, f64::INFINITY)?;
        let street = spec.number_between("street", 16.0, 0.0, f64::INFINITY)?;
        let blocks = (n as f64 / ITEMS_PER_BLOCK).sqrt().ceil().max(1.0) as usize;
        Ok(CityGrid {
            block,
            street,
            blocks,
            // Centred on zero: the tallest houses stand in the middle.
            corner: -(blocks as f64) * (block + street) / 2.0,
        })
    }
}

/// A flat city: tall buildings in square blocks, tiny furniture in the streets.
///
/// Wide in two axes and thin in the third, with sizes from decimetres to a hundred metres.
pub fn city(spec: &mut Spec, n: usize, rng: &mut SeededRng) -> Made {
    let grid = CityGrid::of(spec, n)?;
    let (block, street, corner) = (grid.block, grid.street, grid.corner);
    let pitch = block + street;
    let boxes = (0..n).map(|_| {
        let mut along = || rng.below(grid.blocks) as f64;
        let cell = DVec3::new(along(), along(), 0.0);
        let low = cell * pitch + DVec3::new(corner, corner, 0.0);
        match rng.unit() < BUILDINGS {
            true => building(low, block, -corner, rng),
            false => furniture(low, block, street, rng),
        }
    });
    Ok(boxes.collect())
}

/// A house on one of 4 x 4 plots of the block; towers grow towards the centre.
fn building(block_low: DVec3, block: f64, half_city: f64, rng: &mut SeededRng) -> WorldBox {
    let plot = block / 4.0;
    let cell = DVec3::new(rng.below(4) as f64, rng.below(4) as f64, 0.0);
    let centre = block_low + (cell + DVec3::new(0.5, 0.5, 0.0)) * plot;
    let downtown = 1.0 - (centre.x.abs().max(centre.y.abs()) / half_city).min(1.0);
    let floors = 2.0 + 4.0 * rng.unit() + 40.0 * downtown * downtown * rng.unit();
    let mut edge = || rng.between(0.5, 0.95) * plot;
    WorldBox::standing(centre, DVec3::new(edge(), edge(), 3.0 * floors))
}

/// A lamp, bin, sign or car on the street that borders the block.
fn furniture(block_low: DVec3, block: f64, street: f64, rng: &mut SeededRng) -> WorldBox {
    let along = rng.between(0.0, block + street);
    let across = block + rng.unit() * street;
    let place = match rng.unit() < 0.5 {
        true => DVec3::new(along, across, 0.0),
        false => DVec3::new(across, along, 0.0),
    };
    let size = match rng.below(4) {
        0 => DVec3::new(0.2, 0.2, 5.0),
        1 => DVec3::new(0.5, 0.5, 1.0),
        2 => DVec3::new(0.1, 0.6, 2.2),
        _ => DVec3::new(4.2, 1.8, 1.5),
    };
    WorldBox::standing(block_low + place, size)
}

/// Share of the items that are ground tiles.
const GROUND: f64 = 0.1;

/// A forest: ground tiles, trees, bushes and rocks on a fractal heightfield.
///
/// Flat like a city, but nothing lies on a grid or at a common height.
pub fn forest(spec: &mut Spec, n: usize, rng: &mut SeededRng) -> Made {
    let relief = spec.number_between("relief", 0.12, -1.0, 10.0)?;
    let spacing = spec.number_between("spacing", 5.0, 0.0, f64::INFINITY)?;
    let width = spacing * (n.max(1) as f64).sqrt();
    let land = Terrain {
        width,
        height: width * relief,
        seed: rng.below(1 << 32) as u64,
    };
    let tiles_per_side = (n as f64 * GROUND).sqrt().floor() as usize;
    let mut boxes = Vec::with_capacity(n);
    let tile = width / tiles_per_side.max(1) as f64;
    for i in 0..tiles_per_side * tiles_per_side {
        let at = [i % tiles_per_side, i / tiles_per_side].map(|i| i as f64 * tile);
        boxes.push(land.tile(at, tile));
    }
    boxes.extend((boxes.len()..n).map(|_| {
        let (x, y) = (rng.unit() * width, rng.unit() * width);
        let base = DVec3::new(x, y, land.altitude(x, y));
        let size = match rng.below(10) {
            0 => DVec3::splat(rng.between(0.3, 2.0)),
            1..=3 => DVec3::new(1.2, 1.2, rng.between(0.5, 1.5)),
            _ => {
                let tall = rng.between(4.0, 30.0);
                DVec3::new(tall * 0.3, tall * 0.3, tall)
            }
        };
        WorldBox::standing(base, size)
    }));
    Ok(boxes)
}

/// A square fractal heightfield.
struct Terrain {
    width: f64,
    height: f64,
    seed: u64,
}

impl Terrain {
    fn altitude(&self, x: f64, y: f64) -> f64 {
        let frequency = 4.0 / self.width;
        let at = DVec3::new(x * frequency, y * frequency, 0.0);
        let height = octaves(at, 6, |octave, corner| {
            let [i, j] = [corner.x, corner.y].map(|v| v as i64 as u64);
            let key = self.seed ^ (octave << 56) ^ i.wrapping_mul(0x9E37_79B9) ^ (j << 32);
            mix64(key) as f64 / (1u128 << 64) as f64
        });
        height * self.height
    }

    /// A ground tile: spans the heights at its corners and centre.
    fn tile(&self, [x, y]: [f64; 2], edge: f64) -> WorldBox {
        let samples = [(0.0, 0.0), (1.0, 0.0), (0.0, 1.0), (1.0, 1.0), (0.5, 0.5)];
        WorldBox::union_of(samples.map(|(u, v)| {
            let (x, y) = (x + u * edge, y + v * edge);
            WorldBox::at(DVec3::new(x, y, self.altitude(x, y)))
        }))
    }
}

/// Unit cubes on a spiral over a sphere (Bevy's `many_cubes`).
///
/// From the centre every view through the same lens shows about the same number.
pub fn shell(spec: &mut Spec, n: usize, _: &mut SeededRng) -> Made {
    /// Widens the gaps at the poles (Roberts 2018).
    const POLES: f64 = 0.36;
    let natural = 1.25 * (n.max(1) as f64).sqrt();
    let radius = spec.number_between("radius", natural, 0.0, f64::INFINITY)?;
    let golden = (1.0 + 5f64.sqrt()) / 2.0;
    let boxes = (0..n).map(|i| {
        let z = 1.0 - 2.0 * (i as f64 + POLES) / (n as f64 - 1.0 + 2.0 * POLES);
        let turn = TAU * (i as f64 / golden).fract();
        WorldBox::around(on_sphere(z, turn) * radius, DVec3::ONE)
    });
    Ok(boxes.collect())
}

/// Boxes of unit spheres on a cubic grid of spacing 2, in rows or shuffled.
pub fn grid3(spec: &mut Spec, n: usize, rng: &mut SeededRng) -> Made {
    let shuffled = spec.whole("shuffled", 0, 0..=1)? == 1;
    let side = side_of(n, 3);
    let half = (side / 2) as f64;
    let boxes = (0..n).map(|i| {
        let centre = (lattice_cell(i, side) - half) * 2.0;
        WorldBox::around(centre, DVec3::splat(2.0))
    });
    let mut boxes: Vec<WorldBox> = boxes.collect();
    rng.shuffle(&mut boxes[..n * usize::from(shuffled)]);
    Ok(boxes)
}

/// Boxes with edges 1 + 99 X^10, X even in 0..1 per axis, scattered in a cube.
pub fn bepu(spec: &mut Spec, n: usize, rng: &mut SeededRng) -> Made {
    let natural = 15.625 * libm::cbrt(n.max(1) as f64);
    let side = spec.number_between("side", natural, 0.0, f64::INFINITY)?;
    let boxes = (0..n).map(|_| {
        let x = rng.point();
        let to_5 = x * x * x * x * x;
        let edges = DVec3::ONE + 99.0 * to_5 * to_5;
        WorldBox::around(rng.point() * side, edges)
    });
    Ok(boxes.collect())
}

/// Boxes scattered evenly in a block much longer than wide and high.
pub fn corridor(spec: &mut Spec, n: usize, rng: &mut SeededRng) -> Made {
    let width = spec.number_between("width", 10.0, 0.0, f64::INFINITY)?;
    let length = spec.number_between("length", 1000.0 * width, 0.0, f64::INFINITY)?;
    let block = DVec3::new(length, width, width);
    let size = 0.2 * libm::cbrt(length / n.max(1) as f64 * width * width);
    Ok(scattered(n, rng, block, size))
}

/// Rectangles that tile a square of the plane z = 0.
///
/// Each cut is across the longer side; neighbours share exact coordinates.
pub fn tiles2d(spec: &mut Spec, n: usize, rng: &mut SeededRng) -> Made {
    let side = spec.number_between("side", 1000.0, 0.0, f64::INFINITY)?;
    let mut boxes = Vec::with_capacity(n);
    let square = WorldBox::new(DVec3::ZERO, DVec3::new(side, side, 0.0));
    let mut open = vec![(square, n)];
    while let Some((tile, count)) = open.pop() {
        match count {
            0 => {}
            1 => boxes.push(tile),
            _ => {
                let size = tile.max - tile.min;
                let axis = usize::from(size.y > size.x);
                let share = (count / 2) as f64 / count as f64 * rng.between(0.6, 1.4);
                let (mut low, mut high) = (tile, tile);
                low.max[axis] = tile.min[axis] + share * size[axis];
                high.min[axis] = low.max[axis];
                open.extend([(high, count - count / 2), (low, count / 2)]);
            }
        }
    }
    Ok(boxes)
}

/// Piles of coincident boxes: no plane separates the items of a pile.
pub fn stack(spec: &mut Spec, n: usize, rng: &mut SeededRng) -> Made {
    let piles = spec.whole("piles", 16, 1..=1_000_000)? as usize;
    let place = |_| WorldBox::around(rng.point() * 1000.0, (rng.point() + 0.5) * 20.0);
    let places: Vec<WorldBox> = (0..piles).map(place).collect();
    Ok((0..n).map(|i| places[i % piles]).collect())
}

/// Unit cubes on whole coordinates under a fractal surface, four to a column.
///
/// Every face is a tie.
pub fn voxels(spec: &mut Spec, n: usize, rng: &mut SeededRng) -> Made {
    const DEEP: usize = 4;
    let relief = spec.number_between("relief", 0.2, -1.0, 10.0)?;
    let side = side_of(n.div_ceil(DEEP), 2);
    let seed = rng.below(1 << 32) as u64;
    let boxes = (0..n).map(|i| {
        let column = i / DEEP;
        let at = DVec3::new((column % side) as f64, (column / side) as f64, 0.0);
        let height = fractal(at * (4.0 / side as f64), 6, seed) * relief * side as f64;
        let low = at + DVec3::Z * (height.floor() - (i % DEEP) as f64);
        WorldBox::new(low, low + DVec3::ONE)
    });
    Ok(boxes.collect())
}

/// The cell of a number in a cubic lattice, row by row.
pub fn lattice_cell(i: usize, side: usize) -> DVec3 {
    DVec3::from([i % side, i / side % side, i / side / side].map(|c| c as f64))
}

/// The least side whose power is at least `n`; at least 1.
fn side_of(n: usize, power: u32) -> usize {
    let root = libm::pow(n as f64, 1.0 / f64::from(power));
    let mut side = (root as usize).saturating_sub(1).max(1);
    while side.pow(power) < n {
        side += 1;
    }
    side
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn plants_stand_on_the_ground() {
        let land = Terrain {
            width: 100.0,
            height: 12.0,
            seed: 5,
        };
        for i in 0..200 {
            let (x, y) = (f64::from(i) * 0.5, f64::from(i * 7 % 100));
            let altitude = land.altitude(x, y);
            assert!((0.0..12.0).contains(&altitude), "{altitude}");
            let step = land.altitude(x + 1e-6, y) - altitude;
            assert!(step.abs() < 1e-4, "continuous: {step}");
        }
    }

    type Build = fn(&mut Spec, usize, &mut SeededRng) -> Made;

    fn boxes(build: Build, text: &str, n: usize) -> Vec<WorldBox> {
        let mut spec = Spec::parse(text).unwrap();
        build(&mut spec, n, &mut SeededRng::new(3)).unwrap()
    }

    fn bits(b: &WorldBox) -> [u64; 6] {
        let [x, y, z] = b.min.to_array();
        let [u, v, w] = b.max.to_array();
        [x, y, z, u, v, w].map(f64::to_bits)
    }

    #[test]
    fn every_octant_of_the_shell_holds_as_many() {
        let mut octants = [0; 8];
        for b in boxes(shell, "shell", 16_000) {
            let p = (b.min + b.max) / 2.0;
            assert!((p.length() - 1.25 * 16_000f64.sqrt()).abs() < 1e-9);
            let sides = [p.x, p.y, p.z].map(|v| usize::from(v > 0.0));
            octants[sides[0] + 2 * sides[1] + 4 * sides[2]] += 1;
        }
        assert!(
            octants.iter().all(|n| (1950..2050).contains(n)),
            "{octants:?}"
        );
    }

    #[test]
    fn a_shuffled_grid_is_the_same_grid() {
        let sorted = |text| {
            let mut all: Vec<_> = boxes(grid3, text, 500).iter().map(bits).collect();
            all.sort_unstable();
            all
        };
        assert_eq!(sorted("g"), sorted("g:shuffled=1"));
        assert_ne!(boxes(grid3, "g", 500), boxes(grid3, "g:shuffled=1", 500));
        let sides = [(0, 1), (1, 1), (8, 2), (9, 3), (512_000, 80), (512_001, 81)];
        assert!(sides.iter().all(|&(n, side)| side_of(n, 3) == side));
    }

    /// Overlapping pairs in the published test: 65,600 to 66,300 while it runs.
    #[test]
    fn boxes_of_bepu_overlap_about_as_often_as_published() {
        let mut all = boxes(bepu, "bepu", 65_536);
        all.sort_by(|a, b| a.min.x.total_cmp(&b.min.x));
        let pairs: usize = (0..all.len())
            .map(|i| {
                let later = all[i + 1..].iter();
                let near = later.take_while(|b| b.min.x <= all[i].max.x);
                near.filter(|b| b.meets(&all[i])).count()
            })
            .sum();
        assert!((62_000..68_000).contains(&pairs), "{pairs}");
    }

    #[test]
    fn tiles_fill_the_square() {
        let tiles = boxes(tiles2d, "tiles2d:side=64", 777);
        let area: f64 = tiles
            .iter()
            .map(|b| (b.max - b.min).x * (b.max - b.min).y)
            .sum();
        assert!((area - 64.0 * 64.0).abs() < 1e-6, "{area}");
        assert!(
            tiles
                .iter()
                .all(|b| b.min.z == 0.0 && b.max.z == 0.0 && b.min.x < b.max.x)
        );
    }

    #[test]
    fn piles_coincide_and_voxels_do_not() {
        let distinct = |build: Build| {
            let mut all: Vec<_> = boxes(build, "s", 1000).iter().map(bits).collect();
            all.sort_unstable();
            all.dedup();
            all.len()
        };
        assert_eq!([distinct(stack), distinct(voxels)], [16, 1000]);
    }
}
