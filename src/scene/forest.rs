//! A forest on terrain: ground tiles, trees, bushes and rocks on a fractal
//! heightfield. Flat as a city, but nothing lies on a grid or at one height.

use glam::DVec3;

use super::WorldBox;
use super::rng::SeededRng;
use super::world::World;
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
        let (x, y) = (
            (i % tiles_per_side) as f64 * tile,
            (i / tiles_per_side) as f64 * tile,
        );
        boxes.push(land.tile(x, y, tile));
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
    Ok(boxes.into())
}

/// Value noise in octaves: each doubles the frequency and halves the height
/// (Musgrave in Ebert et al., "Texturing and Modeling", ch. 16).
struct Terrain {
    width: f64,
    height: f64,
    seed: u64,
}

impl Terrain {
    fn altitude(&self, x: f64, y: f64) -> f64 {
        let (mut frequency, mut amplitude, mut sum) = (4.0 / self.width, 0.5, 0.0);
        for octave in 0..6 {
            sum += amplitude * self.noise(x * frequency, y * frequency, octave);
            frequency *= 2.0;
            amplitude *= 0.5;
        }
        sum * self.height
    }

    /// Lattice noise in `[0, 1)`, smoothstep between lattice points.
    fn noise(&self, x: f64, y: f64, octave: u64) -> f64 {
        let (cell_x, cell_y) = (x.floor(), y.floor());
        let smooth = |t: f64| t * t * (3.0 - 2.0 * t);
        let (u, v) = (smooth(x - cell_x), smooth(y - cell_y));
        let corner = |dx: f64, dy: f64| {
            let (i, j) = ((cell_x + dx) as i64 as u64, (cell_y + dy) as i64 as u64);
            unit_hash(self.seed ^ (octave << 56) ^ i.wrapping_mul(0x9E37_79B9) ^ (j << 32))
        };
        let mix = |a: f64, b: f64, t: f64| a + (b - a) * t;
        mix(
            mix(corner(0.0, 0.0), corner(1.0, 0.0), u),
            mix(corner(0.0, 1.0), corner(1.0, 1.0), u),
            v,
        )
    }

    /// A ground tile: it spans the heights at its corners and centre.
    fn tile(&self, x: f64, y: f64, edge: f64) -> WorldBox {
        let samples = [(0.0, 0.0), (1.0, 0.0), (0.0, 1.0), (1.0, 1.0), (0.5, 0.5)];
        let heights = samples.map(|(u, v)| self.altitude(x + u * edge, y + v * edge));
        let low = heights.iter().copied().fold(f64::INFINITY, f64::min);
        let high = heights.iter().copied().fold(f64::NEG_INFINITY, f64::max);
        WorldBox::new(DVec3::new(x, y, low), DVec3::new(x + edge, y + edge, high))
    }
}

/// A hash in `[0, 1)`: the SplitMix64 finaliser (Steele et al. 2014).
fn unit_hash(key: u64) -> f64 {
    let mut z = key.wrapping_add(0x9E37_79B9_7F4A_7C15);
    z = (z ^ (z >> 30)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
    z = (z ^ (z >> 27)).wrapping_mul(0x94D0_49BB_1331_11EB);
    (z ^ (z >> 31)) as f64 / (1u128 << 64) as f64
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
