//! Axis-aligned boxes in f32: containment, union and outward rounding.

use glam::{DVec3, Vec3};
use serde::{Deserialize, Serialize};

use crate::arithmetic::rounding::{difference_down, difference_up, sum_down, sum_up};

/// A closed axis-aligned box `[min, max]` in scene-local f32 coordinates.
///
/// Zero thickness is allowed. A box with `min > max` on any axis is the empty set: nothing sees it,
/// and it meets nothing. [`Aabb::union_of`] skips such boxes; [`Aabb::union`] only [`Aabb::EMPTY`].
#[derive(Clone, Copy, PartialEq, Debug, Serialize, Deserialize)]
#[repr(C)]
pub struct Aabb {
    /// Lower corner.
    pub min: Vec3,
    /// Upper corner; part of the box.
    pub max: Vec3,
}

impl Default for Aabb {
    fn default() -> Aabb {
        Aabb::EMPTY
    }
}

impl Aabb {
    /// The empty box: the neutral element of [`Aabb::union`].
    ///
    /// Its centre is NaN, its extent minus infinity, its area meaningless.
    pub const EMPTY: Aabb = Aabb {
        min: Vec3::INFINITY,
        max: Vec3::NEG_INFINITY,
    };

    /// The box between two corners; empty if `min > max` on any axis.
    pub const fn new(min: Vec3, max: Vec3) -> Self {
        Aabb { min, max }
    }

    /// The box between `centre - half` and `centre + half`.
    pub fn around(centre: Vec3, half: Vec3) -> Self {
        Aabb::new(centre - half, centre + half)
    }

    /// The smallest f32 box relative to `origin` that contains the f64 box exactly.
    ///
    /// Both bounds are rounded outward, so nothing inside is ever lost.
    ///
    /// Bounds beyond the range of f32 become infinite; check [`Aabb::is_finite`].
    pub fn rounded_outward(min: DVec3, max: DVec3, origin: DVec3) -> Self {
        let down = |axis: usize| difference_down(min[axis], origin[axis]);
        let up = |axis: usize| difference_up(max[axis], origin[axis]);
        Aabb::new([0, 1, 2].map(down).into(), [0, 1, 2].map(up).into())
    }

    /// Both corners in world coordinates; the box is relative to `origin`.
    ///
    /// Rounded outward in the rare case that f64 cannot hold the sum.
    pub fn in_world(&self, origin: DVec3) -> (DVec3, DVec3) {
        let (min, max) = (self.min.as_dvec3(), self.max.as_dvec3());
        let down = |axis: usize| sum_down(origin[axis], min[axis]);
        let up = |axis: usize| sum_up(origin[axis], max[axis]);
        ([0, 1, 2].map(down).into(), [0, 1, 2].map(up).into())
    }

    /// The box relative to `eye`.
    ///
    /// Each bound minus the eye's coordinate, rounded to nearest and clamped to finite numbers.
    ///
    /// Rounding is monotone and so is the clamp: a box within another stays within it, bound by
    /// bound. (Without the clamp an overflow times a zero of a normal would be a NaN, in an item
    /// but not in its node.)
    #[inline(always)]
    pub fn relative_to(&self, eye: Vec3) -> Aabb {
        let (low, high) = (self.min - eye, self.max - eye);
        let kept = |v: Vec3| Vec3::new(held(v.x), held(v.y), held(v.z));
        Aabb::new(kept(low), kept(high))
    }

    /// Returns whether the box contains no point (`min > max` on some axis).
    pub fn is_empty(&self) -> bool {
        !self.min.cmple(self.max).all()
    }

    /// Returns whether all six bounds are finite.
    pub fn is_finite(&self) -> bool {
        self.min.is_finite() && self.max.is_finite()
    }

    /// The smallest box that contains both. Exact: min and max never round.
    ///
    /// Neither may be empty, except for [`Aabb::EMPTY`]; [`Aabb::union_of`] takes any.
    pub fn union(&self, other: &Aabb) -> Aabb {
        Aabb::new(self.min.min(other.min), self.max.max(other.max))
    }

    /// The smallest box that contains all non-empty boxes of `boxes`.
    pub fn union_of<'a>(boxes: impl IntoIterator<Item = &'a Aabb>) -> Aabb {
        let filled = boxes.into_iter().filter(|b| !b.is_empty());
        filled.fold(Aabb::EMPTY, |all, b| all.union(b))
    }

    /// The smallest box around points; empty without any.
    pub fn of_points(points: impl IntoIterator<Item = Vec3>) -> Aabb {
        let around = |b: Aabb, p: Vec3| Aabb::new(b.min.min(p), b.max.max(p));
        points.into_iter().fold(Aabb::EMPTY, around)
    }

    /// Returns whether the point lies in the closed box.
    #[inline(always)]
    pub fn contains_point(&self, p: Vec3) -> bool {
        p.cmpge(self.min).all() && p.cmple(self.max).all()
    }

    /// Returns whether `other` lies wholly in the closed box.
    #[inline(always)]
    pub fn contains(&self, other: &Aabb) -> bool {
        other.min.cmpge(self.min).all() && other.max.cmple(self.max).all()
    }

    /// Returns whether the two closed boxes share a point.
    ///
    /// Touching counts. An empty box shares none.
    #[inline(always)]
    pub fn intersects(&self, other: &Aabb) -> bool {
        let overlap = self.min.cmple(other.max).all() && other.min.cmple(self.max).all();
        overlap && !self.is_empty() && !other.is_empty()
    }

    /// Midpoint; NaN for [`Aabb::EMPTY`].
    ///
    /// Halves before adding, so that huge bounds do not overflow.
    #[inline(always)]
    pub fn centre(&self) -> Vec3 {
        self.min * 0.5 + self.max * 0.5
    }

    /// Half of the edge lengths; finite even for a box as wide as all of f32.
    #[inline(always)]
    pub fn half_extent(&self) -> Vec3 {
        self.max * 0.5 - self.min * 0.5
    }

    /// Bits of the six bounds, as a key of identical boxes.
    #[inline]
    pub fn bits(&self) -> [[u32; 3]; 2] {
        let of = |p: Vec3| [p.x.to_bits(), p.y.to_bits(), p.z.to_bits()];
        [of(self.min), of(self.max)]
    }

    /// Edge lengths, zero for a point, negative for an empty box.
    pub fn extent(&self) -> Vec3 {
        self.max - self.min
    }

    /// Half the surface; meaningless for an empty box.
    pub fn half_area(&self) -> f32 {
        let e = self.extent();
        e.x * e.y + e.y * e.z + e.z * e.x
    }

    /// The box scaled by `scale` about its origin.
    pub fn scaled(&self, scale: f32) -> Aabb {
        Aabb::new(self.min * scale, self.max * scale)
    }

    /// Power of two that scales a scene with these bounds so that areas fit f32.
    ///
    /// 1 for coordinates between 2^-40 and 2^40; beyond, areas that are compared would overflow or
    /// vanish, so the scene is scaled to about unit size.
    pub fn scale_for_areas(&self) -> f32 {
        let largest = self.reach().max_element();
        let exponent = libm::ilogbf(largest);
        if largest == 0.0 || !largest.is_finite() || exponent.abs() <= 40 {
            return 1.0;
        }
        // Clamped to normal numbers: a subnormal scene is scaled to 2^-23.
        libm::ldexpf(1.0, (-exponent).clamp(-126, 126))
    }

    /// Largest absolute coordinate on each axis.
    ///
    /// Nothing in the box is farther from the local origin; zero for an empty box.
    pub fn reach(&self) -> Vec3 {
        if self.is_empty() {
            return Vec3::ZERO;
        }
        self.min.abs().max(self.max.abs())
    }

    /// Corner `i` of eight: bit k of `i` selects `max` on axis k.
    pub fn corner(&self, i: usize) -> Vec3 {
        let ends = [self.min, self.max];
        Vec3::new(ends[i & 1].x, ends[i >> 1 & 1].y, ends[i >> 2 & 1].z)
    }
}

/// Clamps infinities to the largest finite number of their sign.
#[inline(always)]
pub(super) fn held(x: f32) -> f32 {
    let x = if x < f32::MAX { x } else { f32::MAX };
    if x > f32::MIN { x } else { f32::MIN }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn closed_bounds_touch_and_inverted_boxes_are_empty() {
        let unit = Aabb::new(Vec3::ZERO, Vec3::ONE);
        let next = Aabb::new(Vec3::X, Vec3::new(2.0, 1.0, 1.0));
        assert!(unit.intersects(&next) && unit.contains_point(Vec3::ONE));
        let inverted = Aabb::new(Vec3::ONE, Vec3::ZERO);
        assert!(inverted.is_empty() && !unit.is_empty());
        let within = Aabb::new(Vec3::splat(0.75), Vec3::splat(0.25));
        assert!(!within.intersects(&unit) && !unit.intersects(&within));
        assert_eq!(Aabb::union_of(&[unit, inverted]), unit);
        let nothing = Aabb::union_of(&[inverted]);
        assert!(nothing.is_empty() && Aabb::union_of(&[]).is_empty());
        // An empty union must not make the sums of planes infinite.
        assert_eq!(nothing.reach(), Vec3::ZERO);
    }

    #[test]
    fn outward_rounding_never_loses_a_point() {
        let (min, max) = (DVec3::splat(0.1), DVec3::splat(0.3));
        let origin = DVec3::new(0.0, 1e7, -0.1);
        let b = Aabb::rounded_outward(min, max, origin);
        for axis in 0..3 {
            assert!(f64::from(b.min[axis]) <= min[axis] - origin[axis]);
            assert!(f64::from(b.max[axis]) >= max[axis] - origin[axis]);
        }
    }
}
