//! Numbers, vectors and boxes for property tests.
//!
//! Ordinary ones, and ones for which f32 arithmetic ties, overflows or underflows.

use glam::Vec3;
use proptest::prelude::*;

use super::Aabb;

/// Integers (ties), ordinary numbers, all exponents (overflow), tiny ones, -0.
pub fn number() -> impl Strategy<Value = f32> {
    prop_oneof![
        (-8i8..8).prop_map(f32::from),
        (-8i8..8).prop_map(f32::from),
        -9f32..9.0,
        prop::num::f32::NORMAL,
        prop::num::f32::SUBNORMAL,
        Just(-0.0),
    ]
}

/// Three such numbers.
pub fn vector() -> impl Strategy<Value = Vec3> {
    [number(), number(), number()].prop_map(Vec3::from_array)
}

prop_compose! {
    /// A box between two such points, ordered axis by axis.
    pub fn any_box()(a in vector(), b in vector()) -> Aabb {
        Aabb::new(a.min(b), a.max(b))
    }
}
