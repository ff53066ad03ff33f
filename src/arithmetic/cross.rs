//! The cross product without cancellation.
//!
//! For nearly parallel vectors, and for small differences of products.

use glam::{DVec3, Vec3Swizzles};

/// `a x b`, each component true to about an ulp despite cancellation.
///
/// Kahan's difference of products; Jeannerod, Louvet and Muller 2013, "Further analysis of Kahan's
/// algorithm for the accurate computation of 2 x 2 determinants".
pub fn cross(a: DVec3, b: DVec3) -> DVec3 {
    fn difference(a: f64, b: f64, c: f64, d: f64) -> f64 {
        let cd = c * d;
        libm::fma(a, b, -cd) + libm::fma(-c, d, cd)
    }
    DVec3::new(
        difference(a.y, b.z, a.z, b.y),
        difference(a.z, b.x, a.x, b.z),
        difference(a.x, b.y, a.y, b.x),
    )
}

/// Bounds of the magnitudes of `a x b`, from bounds of those of `a` and `b`.
///
/// Sums of the products instead of differences.
#[inline(always)]
pub fn cross_sizes(a: DVec3, b: DVec3) -> DVec3 {
    a.yzx() * b.zxy() + a.zxy() * b.yzx()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_cancels_keeps_its_digits() {
        // 1 + 2^-30 and 1 - 2^-30 multiply to 1 - 2^-60, beyond f64.
        let (e, f) = (1.0 + 2f64.powi(-30), 1.0 - 2f64.powi(-30));
        let (a, b) = (DVec3::new(e, 1.0, 0.0), DVec3::new(1.0, f, 0.0));
        assert_eq!(a.cross(b).z, 0.0, "the premise: plain products lose it");
        assert_eq!(cross(a, b).z, -(2f64.powi(-60)));
    }
}
