//! Random numbers from a seed, and a hash: the only randomness of generated scenes.

use glam::DVec3;
use rand::{Rng, RngExt, SeedableRng};
use rand_pcg::Pcg64;

/// Seeded randomness with the few distributions that the families need.
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

    /// A point in the unit cube.
    pub fn point(&mut self) -> DVec3 {
        DVec3::new(self.unit(), self.unit(), self.unit())
    }

    /// Standard normal (Box and Muller 1958), through `libm` so that every
    /// platform rounds alike.
    pub fn normal(&mut self) -> f64 {
        let radius = (-2.0 * libm::log(1.0 - self.unit())).sqrt();
        radius * libm::cos(std::f64::consts::TAU * self.unit())
    }

    /// Three independent standard normals.
    pub fn normal3(&mut self) -> DVec3 {
        DVec3::new(self.normal(), self.normal(), self.normal())
    }
}

/// A hash of a number: a step of SplitMix64 (Steele et al. 2014).
pub fn mix64(key: u64) -> u64 {
    let mut z = key.wrapping_add(0x9E37_79B9_7F4A_7C15);
    z = (z ^ (z >> 30)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
    z = (z ^ (z >> 27)).wrapping_mul(0x94D0_49BB_1331_11EB);
    z ^ (z >> 31)
}
