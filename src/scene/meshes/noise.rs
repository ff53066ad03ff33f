//! Value noise in octaves: each doubles the frequency and halves the height
//! (Musgrave in Ebert et al., "Texturing and Modeling", ch. 16). Sums, products
//! and a hash only, so that it is the same on every machine.

use glam::{DVec3, IVec3};

/// Smooth noise in `[0, 1)` with a lattice of unit cells.
pub fn noise(p: DVec3, seed: u64) -> f64 {
    let cell = p.floor();
    let smooth = (p - cell) * (p - cell) * (DVec3::splat(3.0) - (p - cell) * 2.0);
    let base = cell.as_ivec3();
    let corner = |i: i32| unit_hash(seed, base + IVec3::new(i & 1, i >> 1 & 1, i >> 2));
    let mix = |a: f64, b: f64, t: f64| a + (b - a) * t;
    let row = |i: i32| mix(corner(i), corner(i + 1), smooth.x);
    let sheet = |i: i32| mix(row(i), row(i + 2), smooth.y);
    mix(sheet(0), sheet(4), smooth.z)
}

/// Octaves of it, in `[0, 1)`.
pub fn fractal(p: DVec3, octaves: u64, seed: u64) -> f64 {
    let (mut at, mut amplitude, mut sum) = (p, 0.5, 0.0);
    for octave in 0..octaves {
        sum += amplitude * noise(at, seed ^ (octave << 56));
        at *= 2.0;
        amplitude *= 0.5;
    }
    sum
}

/// A hash in `[0, 1)`: the SplitMix64 finaliser (Steele et al. 2014).
fn unit_hash(seed: u64, cell: IVec3) -> f64 {
    let [x, y, z] = cell.to_array().map(|v| v as i64 as u64);
    let key = seed
        ^ x.wrapping_mul(0x9E37_79B9_7F4A_7C15)
        ^ y.wrapping_mul(0xC2B2_AE3D_27D4_EB4F)
        ^ z.wrapping_mul(0x1656_67B1_9E37_79F9);
    let mut h = key.wrapping_add(0x9E37_79B9_7F4A_7C15);
    h = (h ^ (h >> 30)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
    h = (h ^ (h >> 27)).wrapping_mul(0x94D0_49BB_1331_11EB);
    ((h ^ (h >> 31)) >> 11) as f64 / (1u64 << 53) as f64
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
        assert_ne!(noise(DVec3::splat(0.5), 1), noise(DVec3::splat(0.5), 2));
    }
}
