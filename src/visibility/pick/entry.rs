//! Where a ray enters a box, exactly. A depth at which a ray crosses the plane of
//! a face is a quotient of f64 numbers; it is kept as that quotient, and two of
//! them are compared by their rounded values where these differ by more than
//! their errors, else by expansions.
//!
//! Exact as long as no product of a coordinate and a component of a direction
//! leaves the range of [`two_product`](crate::arithmetic::two_product): for
//! magnitudes of zero or 2^-400 to 2^400.

use std::cmp::Ordering;

use crate::arithmetic::{Expansion, two_sum};
use crate::scene::WorldBox;
use crate::visibility::Ray;

/// What the sum of two rounded depths is multiplied with to bound the error of
/// their difference. A depth is a difference and a quotient, each rounded once:
/// an error below (2 + 2^-50) 2^-53 of it. Two of those, the rounding of the
/// difference and of this product are below 5 * 2^-53 of the sum.
const ERROR: f64 = 4.0 * f64::EPSILON;

/// More than a quotient that underflows can lose.
const TINY: f64 = 1e-300;

/// The depth `(side - origin[axis]) / direction[axis]` of a ray: a number that
/// need not be an f64.
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct Crossing {
    axis: usize,
    side: f64,
    /// Rounded.
    depth: f64,
}

impl Crossing {
    #[inline(always)]
    fn of(ray: &Ray, axis: usize, side: f64) -> Crossing {
        Crossing {
            axis,
            side,
            depth: (side - ray.origin[axis]) / ray.direction[axis],
        }
    }

    /// The depth, rounded: true to 2^-51 of it.
    #[inline(always)]
    pub fn depth(&self) -> f64 {
        self.depth
    }

    /// The axis that the crossed plane is perpendicular to: 0, 1 or 2.
    #[inline(always)]
    pub fn axis(&self) -> usize {
        self.axis
    }

    /// Which of two depths of the same ray is the smaller one. Exact.
    #[inline]
    pub fn order(&self, other: &Crossing, ray: &Ray) -> Ordering {
        by_error(self.depth, other.depth).unwrap_or_else(|| self.exact_order(other, ray))
    }

    #[cold]
    fn exact_order(&self, other: &Crossing, ray: &Ray) -> Ordering {
        let (along, across) = (ray.direction[self.axis], ray.direction[other.axis]);
        if self.axis == other.axis {
            // Bounds are no NaN.
            let order = self.side.partial_cmp(&other.side);
            return turned(order.unwrap_or(Ordering::Equal), along < 0.0);
        }
        let a = &self.distance(ray) * &Expansion::from(across);
        let b = &other.distance(ray) * &Expansion::from(along);
        // Both were multiplied with both components.
        let order = (&a - &b).sign().cmp(&0);
        turned(order, (along < 0.0) != (across < 0.0))
    }

    /// Whether the depth is below, at or above a number. Exact.
    #[inline]
    pub fn order_depth(&self, depth: f64, ray: &Ray) -> Ordering {
        if depth.is_infinite() {
            return 0.0_f64.total_cmp(&depth);
        }
        by_error(self.depth, depth).unwrap_or_else(|| self.exact_order_depth(depth, ray))
    }

    #[cold]
    fn exact_order_depth(&self, depth: f64, ray: &Ray) -> Ordering {
        let along = ray.direction[self.axis];
        let moved = Expansion::product(depth, along);
        let order = (&self.distance(ray) - &moved).sign().cmp(&0);
        turned(order, along < 0.0)
    }

    /// `side - origin` along the axis, without any error.
    fn distance(&self, ray: &Ray) -> Expansion {
        let (sum, lost) = two_sum(self.side, -ray.origin[self.axis]);
        &Expansion::from(lost) + &Expansion::from(sum)
    }
}

#[inline(always)]
fn turned(order: Ordering, reversed: bool) -> Ordering {
    if reversed { order.reverse() } else { order }
}

/// The order of two depths where their rounded values tell.
#[inline(always)]
fn by_error(a: f64, b: f64) -> Option<Ordering> {
    let (difference, error) = (a - b, (a.abs() + b.abs()) * ERROR + TINY);
    // No comparison with a NaN holds; that of infinities tells nothing.
    if difference.abs() > error && error.is_finite() {
        Some(if difference > 0.0 {
            Ordering::Greater
        } else {
            Ordering::Less
        })
    } else {
        None
    }
}

/// Where a ray enters a closed box, if it meets it: the depth of entry lies
/// between near and far, both included. A ray that begins inside the box or
/// enters it before the near plane does not meet it; one that only touches a
/// face, an edge or a corner does. Exact.
#[inline]
pub fn entry(ray: &Ray, b: &WorldBox) -> Option<Crossing> {
    let (mut enters, mut leaves): (Option<Crossing>, Option<Crossing>) = (None, None);
    for axis in 0..3 {
        let along = ray.direction[axis];
        if along == 0.0 {
            let at = ray.origin[axis];
            if at < b.min[axis] || at > b.max[axis] {
                return None;
            }
            continue;
        }
        let (first, last) = match along > 0.0 {
            true => (b.min[axis], b.max[axis]),
            false => (b.max[axis], b.min[axis]),
        };
        let (first, last) = (
            Crossing::of(ray, axis, first),
            Crossing::of(ray, axis, last),
        );
        if enters.is_none_or(|enters| first.order(&enters, ray).is_gt()) {
            enters = Some(first);
        }
        if leaves.is_none_or(|leaves| last.order(&leaves, ray).is_lt()) {
            leaves = Some(last);
        }
    }
    let (enters, leaves) = (enters?, leaves?);
    let met = enters.order(&leaves, ray).is_le()
        && enters.order_depth(ray.near, ray).is_ge()
        && enters.order_depth(ray.far, ray).is_le();
    met.then_some(enters)
}

/// The rounded depth of [`entry`] for a box that the ray is known to meet.
#[inline]
pub fn depth_of_met(ray: &Ray, b: &WorldBox) -> Option<f64> {
    let depth = |axis: usize| {
        let along = ray.direction[axis];
        let first = if along > 0.0 {
            b.min[axis]
        } else {
            b.max[axis]
        };
        let depth = (first - ray.origin[axis]) / along;
        if along == 0.0 {
            f64::NEG_INFINITY
        } else {
            depth
        }
    };
    let [x, y, z] = [depth(0), depth(1), depth(2)];
    let deepest = x.max(y).max(z);
    // Where two are within their errors, the deeper one may be rounded less.
    let near = |depth: f64| by_error(deepest, depth).is_none();
    let near = [x, y, z].map(|depth| u32::from(near(depth)));
    if near.iter().sum::<u32>() == 1 && deepest.is_finite() {
        Some(deepest)
    } else {
        entry(ray, b).map(|at| at.depth())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::DVec3;

    fn ray(direction: DVec3, near: f64, far: f64) -> Ray {
        Ray {
            origin: DVec3::ZERO,
            direction,
            near,
            far,
        }
    }

    #[test]
    fn a_box_is_met_where_it_is_entered_between_near_and_far_both_included() {
        let b = WorldBox::new(DVec3::new(2.0, -1.0, -1.0), DVec3::new(4.0, 1.0, 1.0));
        let depth = |near, far| entry(&ray(DVec3::X, near, far), &b).map(|e| e.depth());
        assert_eq!(depth(0.0, 9.0), Some(2.0));
        assert_eq!((depth(2.0, 9.0), depth(0.0, 2.0)), (Some(2.0), Some(2.0)));
        assert_eq!(
            (depth(2.0f64.next_up(), 9.0), depth(0.0, 2.0f64.next_down())),
            (None, None)
        );
        // Seen from within, and past a face that is only touched.
        let inside = WorldBox::new(DVec3::splat(-1.0), DVec3::splat(4.0));
        assert!(entry(&ray(DVec3::X, 0.5, 9.0), &inside).is_none());
        let beside = WorldBox::new(DVec3::new(2.0, 0.0, 0.0), DVec3::new(4.0, 1.0, 1.0));
        assert!(entry(&ray(DVec3::X, 0.5, 9.0), &beside).is_some());
        assert!(entry(&ray(DVec3::new(1.0, -1e-300, 0.0), 0.5, 9.0), &beside).is_none());
    }

    /// A third is no f64: rounded depths are equal on both axes, and only the
    /// exact comparison knows which plane is crossed first.
    #[test]
    fn depths_that_round_alike_are_told_apart() {
        let third = 1.0 / 3.0;
        let along = ray(DVec3::new(3.0, 1.0, 0.0), 0.0, 9.0);
        let one = Crossing::of(&along, 0, 1.0);
        let rounded = Crossing::of(&along, 1, third);
        assert_eq!(one.depth(), rounded.depth());
        assert_eq!(one.order(&rounded, &along), Ordering::Greater);
        assert_eq!(rounded.order(&one, &along), Ordering::Less);
        assert_eq!(one.order_depth(third, &along), Ordering::Greater);
        let back = ray(DVec3::new(-3.0, 1.0, 0.0), 0.0, 9.0);
        let one = Crossing::of(&back, 0, -1.0);
        assert_eq!(
            one.order(&Crossing::of(&back, 1, third), &back),
            Ordering::Greater
        );
        assert_eq!(one.order_depth(third, &back), Ordering::Greater);
    }
}
