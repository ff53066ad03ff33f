//! Numbers, vectors and boxes for property tests.
//!
//! Those on which f32 arithmetic ties, overflows or vanishes, beside ordinary ones.

use glam::Vec3;
use proptest::prelude::*;

use super::Aabb;

/// Small integers (ties), ordinary numbers, all exponents (overflow), tiny ones
/// and the other zero.
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
    /// A box between two such points, each axis by itself.
    pub fn any_box()(a in vector(), b in vector()) -> Aabb {
        Aabb::new(a.min(b), a.max(b))
    }
}
