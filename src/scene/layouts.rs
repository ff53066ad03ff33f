//! Layouts of other benchmarks (Bevy's `many_cubes`, `sseculling`, the trees of
//! bepuphysics), and the extremes of shape: a line, a plane, piles, a lattice.

use std::f64::consts::TAU;

use glam::DVec3;

use super::WorldBox;
use super::noise::fractal;
use super::rng::SeededRng;
use super::tiling::World;
use crate::spec::{Spec, SpecError};

/// A world of boxes alone.
fn of(boxes: impl Iterator<Item = WorldBox>) -> Result<World, SpecError> {
    Ok(World {
        boxes: boxes.collect(),
        ..World::default()
    })
}

/// Unit cubes on a spiral over a sphere (Bevy's `many_cubes`).
///
/// From the centre every view of one lens shows about as many.
pub fn shell(spec: &mut Spec, n: usize, _: &mut SeededRng) -> Result<World, SpecError> {
    /// Widens the gaps at the poles (Roberts 2018).
    const POLES: f64 = 0.36;
    let natural = 1.25 * (n.max(1) as f64).sqrt();
    let radius = spec.number_between("radius", natural, 0.0, f64::INFINITY)?;
    let golden = (1.0 + 5f64.sqrt()) / 2.0;
    of((0..n).map(|i| {
        let z = 1.0 - 2.0 * (i as f64 + POLES) / (n as f64 - 1.0 + 2.0 * POLES);
        let turn = TAU * (i as f64 / golden).fract();
        let across = (1.0 - z * z).max(0.0).sqrt();
        let unit = DVec3::new(across * libm::cos(turn), across * libm::sin(turn), z);
        WorldBox::around(unit * radius, DVec3::ONE)
    }))
}

/// Boxes of unit spheres on a cubic grid of spacing 2, in rows or shuffled.
pub fn grid3(spec: &mut Spec, n: usize, rng: &mut SeededRng) -> Result<World, SpecError> {
    let shuffled = spec.whole("shuffled", 0, 1)? == 1;
    let side = side_of(n, 3);
    let half = (side / 2) as f64;
    let mut boxes: Vec<WorldBox> = (0..n)
        .map(|i| {
            let cell = [i % side, i / side % side, i / side / side];
            let centre = DVec3::from(cell.map(|c| 2.0 * (c as f64 - half)));
            WorldBox::around(centre, DVec3::splat(2.0))
        })
        .collect();
    for last in (1..n * usize::from(shuffled)).rev() {
        boxes.swap(last, rng.below(last + 1));
    }
    of(boxes.into_iter())
}

/// Boxes with edges 1 + 99 X^10, X even in 0..1 per axis, scattered in a cube.
pub fn bepu(spec: &mut Spec, n: usize, rng: &mut SeededRng) -> Result<World, SpecError> {
    let natural = 15.625 * libm::cbrt(n.max(1) as f64);
    let side = spec.number_between("side", natural, 0.0, f64::INFINITY)?;
    of((0..n).map(|_| {
        let x = rng.point();
        let to_5 = x * x * x * x * x;
        let edges = DVec3::ONE + 99.0 * to_5 * to_5;
        WorldBox::around(rng.point() * side, edges)
    }))
}

/// Boxes scattered evenly in a block that is far longer than wide and high.
pub fn corridor(spec: &mut Spec, n: usize, rng: &mut SeededRng) -> Result<World, SpecError> {
    let width = spec.number_between("width", 10.0, 0.0, f64::INFINITY)?;
    let length = spec.number_between("length", 1000.0 * width, 0.0, f64::INFINITY)?;
    let block = DVec3::new(length, width, width);
    let size = 0.2 * libm::cbrt(length / n.max(1) as f64 * width * width);
    of((0..n).map(|_| {
        let centre = rng.point() * block;
        WorldBox::around(centre, (rng.point() + 0.5) * size)
    }))
}

/// Rectangles of the plane z = 0 that tile a square.
///
/// Each cut is across the longer side; neighbours share exact coordinates.
pub fn tiles2d(spec: &mut Spec, n: usize, rng: &mut SeededRng) -> Result<World, SpecError> {
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
    of(boxes.into_iter())
}

/// Piles of coincident boxes: no plane separates the items of one.
pub fn stack(spec: &mut Spec, n: usize, rng: &mut SeededRng) -> Result<World, SpecError> {
    let piles = spec.count("piles", 16, 1_000_000)? as usize;
    let places: Vec<WorldBox> = (0..piles)
        .map(|_| WorldBox::around(rng.point() * 1000.0, (rng.point() + 0.5) * 20.0))
        .collect();
    of((0..n).map(|i| places[i % piles]))
}

/// Unit cubes on whole coordinates under a fractal surface, four to a column.
///
/// Every face is a tie.
pub fn voxels(spec: &mut Spec, n: usize, rng: &mut SeededRng) -> Result<World, SpecError> {
    const DEEP: usize = 4;
    let relief = spec.number_between("relief", 0.2, -1.0, 10.0)?;
    let side = side_of(n.div_ceil(DEEP), 2);
    let seed = rng.below(1 << 32) as u64;
    of((0..n).map(|i| {
        let column = i / DEEP;
        let at = DVec3::new((column % side) as f64, (column / side) as f64, 0.0);
        let height = fractal(at * (4.0 / side as f64), 6, seed) * relief * side as f64;
        let low = at + DVec3::Z * (height.floor() - (i % DEEP) as f64);
        WorldBox::new(low, low + DVec3::ONE)
    }))
}

/// The least side whose power holds `n` cells; at least 1.
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

    type Build = fn(&mut Spec, usize, &mut SeededRng) -> Result<World, SpecError>;

    fn boxes(build: Build, text: &str, n: usize) -> Vec<WorldBox> {
        let mut spec = Spec::parse(text).unwrap();
        build(&mut spec, n, &mut SeededRng::new(3)).unwrap().boxes
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

    /// Pairs that overlap in the published test: 65,600 to 66,300 while it runs.
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
