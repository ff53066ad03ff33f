//! Exact entry of a ray into a box: f64 with an error bound, else expansions.

use std::cmp::Ordering;

use crate::arithmetic::Expansion;
use crate::kernel::each;
use crate::scene::WorldBox;
use crate::visibility::{Ray, RayProbe};

/// Bound of the relative error of a rounded depth.
///
/// `(plane - origin)`, the reciprocal of the direction and their product each round by at most
/// 2^-53, so the depth is accurate to 3.01 * 2^-53 of itself; `x + GUARD * |x|` and similar terms
/// round once or twice more. 8 * 2^-53 exceeds the sum.
const GUARD: f64 = 8.0 / (1u64 << 53) as f64;

/// Returns `true` if the rounded depths prove that the true ones differ.
#[inline(always)]
fn apart(a: f64, b: f64) -> bool {
    (a - b).abs() > GUARD * (a.abs() + b.abs())
}

/// Crossing of a ray and a plane across an axis.
///
/// The true depth is the fraction `(plane - origin[axis]) / direction[axis]`.
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct BoxHit {
    /// Depth in f64, accurate to 2^-50 of itself.
    pub depth: f64,
    /// Bound of the box that is crossed, in world coordinates.
    pub plane: f64,
    /// Axis that the plane is perpendicular to.
    pub axis: usize,
}

/// Ray prepared for exact tests against boxes.
///
/// Exact for coordinates and direction components that are 0 or from 2^-400 to 2^400 in size.
#[derive(Clone, Copy, Debug)]
pub struct Probe {
    /// The ray as given.
    pub ray: Ray,
    /// Reciprocal direction; infinite, and unused, where the component is zero.
    inverse: [f64; 3],
}

impl RayProbe for Probe {
    type Hit = BoxHit;

    #[inline]
    fn compare(&self, a: &BoxHit, b: &BoxHit) -> Ordering {
        if a.axis == b.axis {
            let order = a.plane.total_cmp(&b.plane);
            let same = a.plane == b.plane;
            return match self.ray.direction[a.axis] > 0.0 {
                _ if same => Ordering::Equal,
                true => order,
                false => order.reverse(),
            };
        }
        match apart(a.depth, b.depth) {
            true if a.depth > b.depth => Ordering::Greater,
            true => Ordering::Less,
            false => self.compare_exactly(a, b),
        }
    }

    #[inline(always)]
    fn max_depth(at: &BoxHit) -> f64 {
        at.depth + GUARD * at.depth.abs()
    }
}

impl Probe {
    /// Prepares a ray.
    #[inline]
    pub fn new(ray: Ray) -> Probe {
        let inverse = each(ray.direction.to_array(), |d| 1.0 / d);
        Probe { ray, inverse }
    }

    #[inline(always)]
    fn crossing(&self, axis: usize, plane: f64) -> BoxHit {
        let depth = (plane - self.ray.origin[axis]) * self.inverse[axis];
        BoxHit { depth, plane, axis }
    }

    /// Entry of the ray into the closed box, if that is from near to far.
    ///
    /// This is the truth of [`Solids`](crate::visibility::Solids). Also `None` if the ray certainly
    /// enters beyond `limit`.
    #[inline]
    pub fn enter(&self, b: &WorldBox, limit: f64) -> Option<BoxHit> {
        let ray = &self.ray;
        let (mut entries, mut exits) = ([f64::NEG_INFINITY; 3], [f64::INFINITY; 3]);
        let (mut first, mut last) = (f64::NEG_INFINITY, f64::INFINITY);
        for axis in 0..3 {
            let (d, o) = (ray.direction[axis], ray.origin[axis]);
            let (low, high) = (b.min[axis], b.max[axis]);
            if d == 0.0 {
                if o < low || o > high {
                    return None;
                }
                continue;
            }
            let (near_side, far_side) = if d > 0.0 { (low, high) } else { (high, low) };
            entries[axis] = self.crossing(axis, near_side).depth;
            exits[axis] = self.crossing(axis, far_side).depth;
            first = first.max(entries[axis]);
            last = last.min(exits[axis]);
        }
        // x -> x + GUARD |x| is monotone, so a bound of the largest rounded entry also bounds the
        // largest true one; the same holds for the least exit.
        let slack = |x: f64| GUARD * x.abs();
        let (enters_from, enters_to) = (first - slack(first), first + slack(first));
        let leaves_from = last - slack(last);
        if enters_from > last + slack(last)
            || enters_to < ray.near
            || enters_from > ray.far
            || enters_from > limit
        {
            return None;
        }
        // The rounded depths nearly always decide which entry is the last.
        let mut latest = 0;
        for axis in 1..3 {
            latest = if entries[axis] > entries[latest] {
                axis
            } else {
                latest
            };
        }
        let beaten = |axis: usize| apart(first, entries[axis]) || axis == latest;
        let enters = match beaten(0) && beaten(1) && beaten(2) {
            true => self.crossing(latest, self.entered(b, latest)),
            false => self.latest_entry(b)?,
        };
        if enters_to > leaves_from && self.leaves_before(b, &enters) {
            return None;
        }
        if enters_from < ray.near && self.compare_with(&enters, ray.near).is_lt() {
            return None;
        }
        if enters_to > ray.far && self.compare_with(&enters, ray.far).is_gt() {
            return None;
        }
        Some(enters)
    }

    /// Bound of a box that the ray crosses first on an axis along which it moves.
    #[inline(always)]
    fn entered(&self, b: &WorldBox, axis: usize) -> f64 {
        match self.ray.direction[axis] > 0.0 {
            true => b.min[axis],
            false => b.max[axis],
        }
    }

    /// Axes along which the ray moves.
    fn crossed(&self) -> impl Iterator<Item = usize> {
        (0..3).filter(|&axis| self.ray.direction[axis] != 0.0)
    }

    /// Last entry into the slabs of a box, exact; `None` for a zero direction.
    #[cold]
    fn latest_entry(&self, b: &WorldBox) -> Option<BoxHit> {
        let entry = |axis| self.crossing(axis, self.entered(b, axis));
        let entries = self.crossed().map(entry);
        entries.reduce(|a, b| if self.compare(&b, &a).is_gt() { b } else { a })
    }

    /// Returns `true` if the ray leaves a slab before it enters the last one.
    #[cold]
    fn leaves_before(&self, b: &WorldBox, enters: &BoxHit) -> bool {
        let mirrored = WorldBox::new(b.max, b.min);
        self.crossed().any(|axis| {
            let left = self.crossing(axis, self.entered(&mirrored, axis));
            self.compare(enters, &left).is_gt()
        })
    }

    /// Compares `N_a / d_a` with `N_b / d_b`, both multiplied by `d_a d_b`.
    #[cold]
    fn compare_exactly(&self, a: &BoxHit, b: &BoxHit) -> Ordering {
        let direction = &self.ray.direction;
        let (da, db) = (direction[a.axis], direction[b.axis]);
        let left = &self.numerator(a) * &Expansion::from(db);
        let right = &self.numerator(b) * &Expansion::from(da);
        let order = (&left - &right).sign().cmp(&0);
        if (da > 0.0) == (db > 0.0) {
            order
        } else {
            order.reverse()
        }
    }

    /// Compares a crossing with a depth, exactly.
    fn compare_with(&self, a: &BoxHit, depth: f64) -> Ordering {
        if depth.is_infinite() {
            return 0.0_f64.total_cmp(&depth);
        }
        let d = self.ray.direction[a.axis];
        let difference = &self.numerator(a) - &Expansion::product(depth, d);
        let order = difference.sign().cmp(&0);
        if d > 0.0 { order } else { order.reverse() }
    }

    /// Computes `plane - origin` exactly.
    fn numerator(&self, a: &BoxHit) -> Expansion {
        Expansion::sum([a.plane, -self.ray.origin[a.axis]])
    }
}

#[cfg(test)]
mod tests {
    use glam::DVec3;

    use super::*;
    use crate::scene::SeededRng;

    #[test]
    fn near_and_far_are_decided_to_the_last_bit() {
        // A third lies between two neighbouring doubles.
        let (below, above) = (1.0 / 3.0, (1.0_f64 / 3.0).next_up());
        let b = WorldBox::new(DVec3::new(1.0, -1.0, -1.0), DVec3::splat(2.0));
        let met = |near, far| {
            let (origin, direction) = (DVec3::ZERO, DVec3::X * 3.0);
            let ray = Ray {
                origin,
                direction,
                near,
                far,
            };
            Probe::new(ray).enter(&b, f64::INFINITY).is_some()
        };
        assert!(met(below, f64::INFINITY) && !met(above, f64::INFINITY));
        assert!(met(0.0, above) && !met(0.0, below));
    }

    #[test]
    fn through_corners_the_last_slab_entered_is_told_exactly() {
        let mut rng = SeededRng::new(5);
        let (mut met, mut close) = (0, 0);
        for _ in 0..20_000 {
            let b = WorldBox::new(rng.point() + 1.0, rng.point() + 3.0);
            let origin = rng.point() * 0.1;
            let direction = b.min - origin;
            let ray = Ray {
                origin,
                direction,
                near: 0.0,
                far: f64::INFINITY,
            };
            let probe = Probe::new(ray);
            let Some(enters) = probe.enter(&b, f64::INFINITY) else {
                continue;
            };
            met += 1;
            for axis in 0..3 {
                let entry = probe.crossing(axis, b.min[axis]);
                assert!(probe.compare(&enters, &entry).is_ge(), "{ray:?} {b:?}");
                // The f64 depths have the opposite order.
                close += usize::from(entry.depth > enters.depth);
            }
        }
        assert!(met > 10_000 && close > 100, "the premise: {met}, {close}");
    }
}
