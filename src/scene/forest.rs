//! A forest on terrain: ground tiles, trees, bushes and rocks on a fractal
//! heightfield. Flat as a city, but nothing lies on a grid or at one height.

use glam::DVec3;

use super::WorldBox;
use super::noise::octaves;
use super::rng::{SeededRng, mix64};
use super::tiling::World;
use crate::spec::{Spec, SpecError};

/// Share of the items that are ground tiles.
const GROUND: f64 = 0.1;

pub fn build(spec: &mut Spec, n: usize, rng: &mut SeededRng) -> Result<World, SpecError> {
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
    Ok(World {
        boxes,
        ..World::default()
    })
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

    /// A ground tile: it spans the heights at its corners and centre.
    fn tile(&self, [x, y]: [f64; 2], edge: f64) -> WorldBox {
        let samples = [(0.0, 0.0), (1.0, 0.0), (0.0, 1.0), (1.0, 1.0), (0.5, 0.5)];
        let heights = samples.map(|(u, v)| self.altitude(x + u * edge, y + v * edge));
        let low = heights.iter().copied().fold(f64::INFINITY, f64::min);
        let high = heights.iter().copied().fold(f64::NEG_INFINITY, f64::max);
        WorldBox::new(DVec3::new(x, y, low), DVec3::new(x + edge, y + edge, high))
    }
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
}
