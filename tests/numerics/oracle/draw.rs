//! A small generator of its own for the oracle's cases.

use cullbench::geometry::Aabb;
use glam::Vec3;

/// SplitMix64 (Steele, Lea and Flood 2014).
pub struct SeededRng(u64);

impl SeededRng {
    pub fn new(seed: u64) -> SeededRng {
        SeededRng(seed.wrapping_mul(0x9E37_79B9_7F4A_7C15))
    }

    pub fn bits(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(0x9E37_79B9_7F4A_7C15);
        let mut z = self.0;
        z = (z ^ z >> 30).wrapping_mul(0xBF58_476D_1CE4_E5B9);
        z = (z ^ z >> 27).wrapping_mul(0x94D0_49BB_1331_11EB);
        z ^ z >> 31
    }

    pub fn below(&mut self, count: usize) -> usize {
        (self.bits() % count as u64) as usize
    }

    pub fn chance(&mut self, share: f64) -> bool {
        self.unit() < share
    }

    /// In [0, 1).
    pub fn unit(&mut self) -> f64 {
        (self.bits() >> 11) as f64 / (1u64 << 53) as f64
    }

    pub fn between(&mut self, low: f64, high: f64) -> f64 {
        low + (high - low) * self.unit()
    }

    /// `10^low` to `10^high`, evenly by magnitude.
    pub fn magnitude(&mut self, low: f64, high: f64) -> f64 {
        10f64.powf(self.between(low, high))
    }

    /// A whole number in [-reach, reach].
    pub fn whole(&mut self, reach: i64) -> i64 {
        self.below(2 * reach as usize + 1) as i64 - reach
    }

    pub fn whole3(&mut self, reach: i64) -> Vec3 {
        Vec3::from_array([0; 3].map(|_| self.whole(reach) as f32))
    }

    /// Any finite f32, every bit pattern alike: subnormals, zeros and all.
    pub fn any_f32(&mut self) -> f32 {
        loop {
            let x = f32::from_bits(self.bits() as u32);
            if x.is_finite() {
                return x;
            }
        }
    }
}

/// A box that begins, ends or has its inside at `point`, axis by axis; some
/// are flat, some points.
pub fn grid_box(rng: &mut SeededRng, point: Vec3) -> Aabb {
    let reach = |rng: &mut SeededRng| {
        let unit = if rng.chance(0.5) { 1.0 } else { 0.5 };
        rng.below(4) as f32 * unit
    };
    let (mut low, mut high) = (point, point);
    for k in 0..3 {
        let side = rng.below(5);
        if side < 3 {
            low[k] -= reach(rng);
        }
        if side == 0 || side > 2 {
            high[k] += reach(rng);
        }
    }
    Aabb::new(low, high)
}
