//! Exact order of points along a ray.

use std::cmp::Ordering;
use std::fmt::Debug;

/// A ray prepared for exact tests against one kind of body.
pub trait Along: Copy {
    /// A point of the ray on the surface of a body.
    type At: Copy + Debug;

    /// Exact order of two such points along the ray.
    fn order(&self, a: &Self::At, b: &Self::At) -> Ordering;

    /// Depth of a point, rounded.
    fn depth(at: &Self::At) -> f64;

    /// Upper bound of the true depth of a point.
    fn at_most(at: &Self::At) -> f64;
}
