//! Slab tests of a ray against sixteen boxes in f32, with the error analysis.
//!
//! Per-ray constants bound the depths of entry and exit from both sides.
//!
//! A box side `b` (f32, local) is crossed at `t = (s - o) / d`. Here `s` is the true side, within
//! 2^-23 `|b|` of `b` (the box was rounded outward by less than one unit in the last place), `o`
//! the ray's origin, both relative to the origin of the tree, and `d` the component of the
//! direction. The code computes `fl(fl(b * i) + c)` with `i` the f32 next to `1 / d` and `c` near
//! `-o * i`, computed in f64. With u = 2^-24 the errors are at most, in units of `u * |i|`:
//!
//! - the inverse, `|b - o|` off by one part in 2^24: 1.01 (|b| + |o|)
//! - the product: |b|
//! - the sum: |b| + |o| + slack
//! - the rounding of the box: 2 |b|
//! - `c` minus or plus the slack, rounded to f32: |o| + slack
//! - `o` and `c` in f64: far below 0.1 |o|
//!
//! Together they are 5.01 |b| + 3.1 |o| and two roundings of the slack, which `6 R + 4 |o| + 2^-80`
//! exceeds for all `|b| <= R` (2^-80 exceeds all underflow). So `t` lies between the values
//! computed with `c` minus and plus this slack. The computation is monotone in the sides of a box,
//! so a node's bounds bound those of its items. (No rounding direction is chosen by a branch on
//! sign or size: such branches cost more than the test of a node.)
//!
//! An axis along which the ray moves by less than 2^-80 per unit of depth gets the inverse 2^64 and
//! at least 2^44 of slack. All depths at which such a ray can meet a box are below 2^40 (one
//! component of the direction is 1/4 or more and all lengths are at most 2^36), so it moves less
//! than 2^-40 along that axis. If such a ray meets a box, its origin lies between the box's sides,
//! up to that distance, so the lower bound of entry comes out below -2^43 and the upper bound of
//! exit above 2^43: neither rejects the box.

use glam::{DVec3, Vec3};

use crate::kernel::{Isa, LANES, LaneMask};
use crate::visibility::Ray;

/// Largest coordinate for which the analysis holds.
const MOST_REACH: f64 = (1u64 << 36) as f64;
/// Direction components below this count as zero.
const LEAST_ALONG: f64 = 1.0 / (1u128 << 80) as f64;
/// Reciprocal used for such a component.
const INVERSE_OF_NONE: f32 = (1u128 << 64) as f32;
/// Least slack of such an axis.
const SLACK_OF_NONE: f64 = (1u64 << 44) as f64;

/// Upper bound of a depth as an f32.
///
/// The margin covers the rounding (one part in 2^24) and, on underflow, less than 1e-37.
#[inline(always)]
pub fn round_up(depth: f64) -> f32 {
    (depth + (depth.abs() * f64::from(f32::EPSILON) + 1e-37)) as f32
}

/// Sixteen boxes as six rows: min x, y, z, then max x, y, z.
pub type Rows = [[f32; LANES]; 6];

/// Constants of a ray for the slab test.
#[derive(Clone, Copy, Debug)]
pub struct RaySlabTest {
    /// Rows that are crossed first and last, by axis.
    first: [usize; 3],
    last: [usize; 3],
    inverse: [f32; 3],
    /// `c` minus and plus the slack.
    low: [f32; 3],
    high: [f32; 3],
    /// Near, rounded down, and far, rounded up.
    near: f32,
    pub far: f32,
}

/// Result of the test of sixteen boxes.
pub struct SlabHits<I: Isa> {
    /// Lanes of the boxes that the ray may meet.
    pub lanes: LaneMask,
    /// Lower bound of the depth of entry into each box, negated.
    pub neg_entry: I::Floats,
}

impl RaySlabTest {
    /// Prepares a ray; `None` for a ray that the analysis does not cover.
    #[inline(always)]
    pub fn of(ray: &Ray, zero: DVec3, reach: Vec3) -> Option<RaySlabTest> {
        let start = ray.origin - zero;
        let largest = ray.direction.abs().max_element();
        // Written so that a NaN fails.
        let covered = start.abs().max_element() <= MOST_REACH
            && f64::from(reach.max_element()) <= MOST_REACH
            && (0.25..=1024.0).contains(&largest)
            && ray.near.is_finite()
            && !ray.far.is_nan();
        if !covered || start.is_nan() || ray.direction.is_nan() {
            return None;
        }
        let mut slabs = RaySlabTest {
            first: [0, 1, 2],
            last: [3, 4, 5],
            inverse: [0.0; 3],
            low: [0.0; 3],
            high: [0.0; 3],
            near: -round_up(-ray.near),
            far: round_up(ray.far),
        };
        for axis in 0..3 {
            let along = ray.direction[axis];
            let (inverse, least_slack) = match along.abs() >= LEAST_ALONG {
                true => ((1.0 / along) as f32, 0.0),
                false => (INVERSE_OF_NONE, SLACK_OF_NONE),
            };
            if inverse < 0.0 {
                slabs.first[axis] = axis + 3;
                slabs.last[axis] = axis;
            }
            let i = f64::from(inverse);
            let size = 6.0 * f64::from(reach[axis]) + 4.0 * start[axis].abs() + LEAST_ALONG;
            let slack = size * i.abs() * (f64::from(f32::EPSILON) / 2.0);
            let slack = slack.max(least_slack);
            let centre = -start[axis] * i;
            slabs.inverse[axis] = inverse;
            slabs.low[axis] = (centre - slack) as f32;
            slabs.high[axis] = (centre + slack) as f32;
        }
        Some(slabs)
    }

    /// Boxes that the ray may meet at a depth of `most` or less.
    #[inline(always)]
    pub fn test<I: Isa>(&self, isa: I, rows: &Rows, most: f32) -> SlabHits<I> {
        let entry = |axis: usize| {
            let sides = isa.load(&rows[self.first[axis] % 6]);
            let product = isa.mul(sides, isa.splat(-self.inverse[axis]));
            isa.add(product, isa.splat(-self.low[axis]))
        };
        let exit = |axis: usize| {
            let sides = isa.load(&rows[self.last[axis] % 6]);
            let product = isa.mul(sides, isa.splat(self.inverse[axis]));
            isa.add(product, isa.splat(self.high[axis]))
        };
        let neg_entry = isa.min(entry(0), isa.min(entry(1), entry(2)));
        let exit = isa.min(isa.min(exit(0), exit(1)), isa.min(exit(2), isa.splat(most)));
        let neg_first = isa.min(neg_entry, isa.splat(-self.near));
        SlabHits {
            // A rounded sum has the sign of the true one.
            lanes: isa.not_below(isa.add(neg_first, exit), 0.0),
            neg_entry,
        }
    }
}
