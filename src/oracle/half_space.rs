//! A half-space in numbers without error: what volumes are made of here.

use super::number::Number;

/// One constraint `normal . x + d >= 0`.
#[derive(Clone, Debug)]
pub(super) struct HalfSpace {
    pub normal: [Number; 3],
    pub d: Number,
}
