//! Random numbers from a seed, a hash, and value noise in octaves.
//!
//! The only randomness of generated scenes, the same on every machine.

use glam::{DVec3, IVec3};
use rand::{Rng, RngExt, SeedableRng};
use rand_pcg::Pcg64;

/// Seeded randomness with the few distributions that the families need.
#[derive(Clone, Debug)]
pub struct SeededRng(Pcg64);

impl SeededRng {
    /// The stream of a seed.
    pub fn new(seed: u64) -> Self {
        SeededRng(Pcg64::seed_from_u64(seed))
    }

    /// Uniform in `[0, 1)`: 53 random bits.
    pub fn unit(&mut self) -> f64 {
        self.0.random::<f64>()
    }

    /// Uniform in `[low, high)`.
    pub fn between(&mut self, low: f64, high: f64) -> f64 {
        low + (high - low) * self.unit()
    }

    /// Uniform in `0..count`; 0 for an empty range.
    pub fn below(&mut self, count: usize) -> usize {
        // Widening multiply (Lemire 2019); the bias is below 2^-32 here.
        ((u128::from(self.0.next_u64()) * count as u128) >> 64) as usize
    }

    /// Shuffles a slice (Fisher and Yates, in Durstenfeld's form of 1964).
    pub fn shuffle<T>(&mut self, all: &mut [T]) {
        for last in (1..all.len()).rev() {
            all.swap(last, self.below(last + 1));
        }
    }

    /// A point in the unit cube.
    pub fn point(&mut self) -> DVec3 {
        DVec3::new(self.unit(), self.unit(), self.unit())
    }

    /// Standard normal number (Box and Muller 1958).
    ///
    /// Through `libm`, so that every platform rounds alike.
    pub fn normal(&mut self) -> f64 {
        let radius = (-2.0 * libm::log(1.0 - self.unit())).sqrt();
        radius * libm::cos(std::f64::consts::TAU * self.unit())
    }

    /// Three independent standard normals.
    pub fn normal3(&mut self) -> DVec3 {
        DVec3::new(self.normal(), self.normal(), self.normal())
    }
}

/// The point of the unit sphere at height `z`, rotated about the z axis.
pub fn on_sphere(z: f64, turn: f64) -> DVec3 {
    let radius = (1.0 - z * z).sqrt();
    DVec3::new(radius * libm::cos(turn), radius * libm::sin(turn), z)
}

/// A hash of a number: a step of SplitMix64 (Steele et al. 2014).
pub fn mix64(key: u64) -> u64 {
    let mut z = key.wrapping_add(0x9E37_79B9_7F4A_7C15);
    z = (z ^ (z >> 30)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
    z = (z ^ (z >> 27)).wrapping_mul(0x94D0_49BB_1331_11EB);
    z ^ (z >> 31)
}

/// Smooth noise that interpolates values at the corners of a unit lattice.
fn noise(p: DVec3, corner: impl Fn(IVec3) -> f64) -> f64 {
    let cell = p.floor();
    let smooth = (p - cell) * (p - cell) * (DVec3::splat(3.0) - (p - cell) * 2.0);
    let base = cell.as_ivec3();
    let corner = |i: i32| corner(base + IVec3::new(i & 1, i >> 1 & 1, i >> 2));
    let mix = |a: f64, b: f64, t: f64| a + (b - a) * t;
    let row = |i: i32| mix(corner(i), corner(i + 1), smooth.x);
    let sheet = |i: i32| mix(row(i), row(i + 2), smooth.y);
    mix(sheet(0), sheet(4), smooth.z)
}

/// Octaves of noise in `[0, 1)`.
///
/// `hash` returns a value in `[0, 1)` for an octave and a lattice point.
pub fn octaves(p: DVec3, octaves: u64, hash: impl Fn(u64, IVec3) -> f64) -> f64 {
    let (mut at, mut amplitude, mut sum) = (p, 0.5, 0.0);
    for octave in 0..octaves {
        sum += amplitude * noise(at, |corner| hash(octave, corner));
        at *= 2.0;
        amplitude *= 0.5;
    }
    sum
}

/// Octaves of noise in `[0, 1)` from a seed.
pub fn fractal(p: DVec3, count: u64, seed: u64) -> f64 {
    octaves(p, count, |octave, corner| {
        let [x, y, z] = corner.to_array().map(|v| v as i64 as u64);
        let key = seed
            ^ (octave << 56)
            ^ x.wrapping_mul(0x9E37_79B9_7F4A_7C15)
            ^ y.wrapping_mul(0xC2B2_AE3D_27D4_EB4F)
            ^ z.wrapping_mul(0x1656_67B1_9E37_79F9);
        (mix64(key) >> 11) as f64 / (1u64 << 53) as f64
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn noise_is_continuous_and_within_its_range() {
        for i in 0..500 {
            let p = DVec3::new(f64::from(i) * 0.37 - 60.0, f64::from(i) * 0.11, 3.0);
            let here = fractal(p, 6, 5);
            assert!((0.0..1.0).contains(&here));
            assert!((fractal(p + DVec3::X * 1e-9, 6, 5) - here).abs() < 1e-6);
        }
        assert_ne!(
            fractal(DVec3::splat(0.5), 1, 1),
            fractal(DVec3::splat(0.5), 1, 2)
        );
    }
}
