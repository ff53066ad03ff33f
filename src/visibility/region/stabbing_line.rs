//! Lines that pass between points: whether a directed line in the plane has all
//! `lefts` strictly on its left and all `rights` strictly on its right. Exact for any
//! f64 coordinates.

use glam::DVec2;

use crate::arithmetic::Expansion;

/// Side of the line from `a` through `b` that the point `c` is on, in rounded
/// arithmetic: 1 for the left, -1 for the right, `None` if rounding hides it (Shewchuk
/// 1997, "Adaptive precision floating-point arithmetic", section 4.2: the bound is the
/// first stage of its orient2d).
pub fn turn_by_rounding(a: DVec2, b: DVec2, c: DVec2) -> Option<i32> {
    const BOUND: f64 = 4.0 / (1u64 << 53) as f64;
    let (left, right) = ((a.x - c.x) * (b.y - c.y), (a.y - c.y) * (b.x - c.x));
    let determinant = left - right;
    let bound = BOUND * (left.abs() + right.abs()) + f64::MIN_POSITIVE;
    (determinant.abs() > bound).then_some(if determinant > 0.0 { 1 } else { -1 })
}

/// The same, exactly: 0 for on the line.
fn turn(a: DVec2, b: DVec2, c: DVec2) -> i32 {
    turn_by_rounding(a, b, c).unwrap_or_else(|| {
        let product = Expansion::product;
        let ab = &product(a.x, b.y) - &product(a.y, b.x);
        let bc = &product(b.x, c.y) - &product(b.y, c.x);
        let ca = &product(c.x, a.y) - &product(c.y, a.x);
        (&(&ab + &bc) + &ca).sign()
    })
}

/// The openings that a line has to pass.
///
/// Each has an end on the line's left and an end on its right.
#[derive(Clone, Default, Debug)]
pub struct Stabbing {
    lefts: Vec<DVec2>,
    rights: Vec<DVec2>,
    /// For each number of openings the right and the left point through which the
    /// line goes that is turned to the left as far as possible.
    extreme: Vec<[usize; 2]>,
}

impl Stabbing {
    /// Adds an opening; `false`, and nothing is added, if no line passes all of them
    /// strictly between their ends. O(k) to O(k^2) for k openings.
    pub fn push(&mut self, left: DVec2, right: DVec2) -> bool {
        self.lefts.push(left);
        self.rights.push(right);
        // There is one such line. If it is another than before, it goes through one of
        // the new points.
        let last = self.extreme.last().copied();
        let found = last.filter(|pair| self.is_extreme(*pair)).or_else(|| {
            let new = self.lefts.len() - 1;
            let pairs = (0..=new).flat_map(|old| [[new, old], [old, new]]);
            pairs.into_iter().find(|pair| self.is_extreme(*pair))
        });
        match found {
            Some(pair) => self.extreme.push(pair),
            None => {
                self.lefts.pop();
                self.rights.pop();
            }
        }
        found.is_some()
    }

    /// Takes the last opening away.
    pub fn pop(&mut self) {
        self.lefts.pop();
        self.rights.pop();
        self.extreme.pop();
    }

    /// Tests for an extreme line, from right point r through left point l.
    ///
    /// It has all lefts on its left and all rights on its right, or on itself and then all rights before all
    /// lefts. Turned a little to the right about a point between those it has none on
    /// itself: it is a line as wanted. And where there are such lines, one of them
    /// can be turned to the left until it goes through a right point behind and a
    /// left one ahead.
    fn is_extreme(&self, [r, l]: [usize; 2]) -> bool {
        let (from, to) = (self.rights[r], self.lefts[l]);
        if from == to {
            return false;
        }
        // Along the line, of points that are on it.
        let ahead = |a: DVec2, b: DVec2| match to.x - from.x {
            0.0 => (b.y > a.y) == (to.y > from.y) && a.y != b.y,
            dx => (b.x > a.x) == (dx > 0.0) && a.x != b.x,
        };
        let mut first_left = to;
        for &left in &self.lefts {
            match turn(from, to, left) {
                1 => {}
                0 if ahead(left, first_left) => first_left = left,
                0 => {}
                _ => return false,
            }
        }
        self.rights
            .iter()
            .all(|&right| match turn(from, to, right) {
                -1 => true,
                0 => ahead(right, first_left),
                _ => false,
            })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::SeededRng;

    /// Kirchberger's theorem: two sets in the plane are strictly separable if and
    /// only if all of their subsets of four points are.
    fn separable(lefts: &[DVec2], rights: &[DVec2]) -> bool {
        let in_triangle = |p: DVec2, [a, b, c]: [DVec2; 3]| {
            let turns = [turn(a, b, p), turn(b, c, p), turn(c, a, p)];
            let on = |a: DVec2, b: DVec2| {
                turn(a, b, p) == 0 && p.cmpge(a.min(b)).all() && p.cmple(a.max(b)).all()
            };
            let flat = turn(a, b, c) == 0;
            let inside = turns.iter().all(|t| *t >= 0) || turns.iter().all(|t| *t <= 0);
            (inside && !flat) || on(a, b) || on(b, c) || on(c, a)
        };
        let cross = |a: DVec2, b: DVec2, c: DVec2, d: DVec2| {
            turn(a, b, c) * turn(a, b, d) < 0 && turn(c, d, a) * turn(c, d, b) < 0
        };
        let holds = |hull: &[DVec2], p: DVec2| {
            let upto = |i: usize| hull[..i].iter().copied().enumerate();
            upto(hull.len()).any(|(i, a)| {
                upto(i + 1).any(|(j, b)| upto(j + 1).any(|(_, c)| in_triangle(p, [a, b, c])))
            })
        };
        let crossing = lefts.iter().any(|&a| {
            lefts.iter().any(|&b| {
                let each = rights.iter();
                each.clone()
                    .any(|&c| each.clone().any(|&d| cross(a, b, c, d)))
            })
        });
        !crossing
            && !lefts.iter().any(|&p| holds(rights, p))
            && !rights.iter().any(|&p| holds(lefts, p))
    }

    #[test]
    fn stabbing_is_separation_of_the_ends() {
        let mut rng = SeededRng::new(11);
        let (mut yes, mut no) = (0, 0);
        for round in 0..1000 {
            // Few different coordinates: many ties.
            let span = if round % 2 == 0 { 5 } else { 40 };
            let mut point =
                |x: usize| DVec2::new((x * 2 + rng.below(3)) as f64, rng.below(span) as f64 * 0.1);
            let (mut stabbing, mut lefts, mut rights) = (Stabbing::default(), vec![], vec![]);
            for i in 0..5 {
                let (a, b) = (point(i), point(i));
                let (left, right) = if a.y > b.y { (a, b) } else { (b, a) };
                lefts.push(left);
                rights.push(right);
                let wanted = separable(&lefts, &rights);
                assert_eq!(stabbing.push(left, right), wanted, "{lefts:?} {rights:?}");
                if !wanted {
                    no += 1;
                    break;
                }
                yes += 1;
            }
        }
        assert!(yes > 500 && no > 500, "{yes} {no}");
    }

    #[test]
    fn lines_that_only_touch_do_not_pass() {
        let at = DVec2::new;
        let mut stabbing = Stabbing::default();
        assert!(stabbing.push(at(0.0, 1.0), at(0.0, 0.0)));
        assert!(stabbing.push(at(1.0, 2.0), at(1.0, 1.0)));
        // Only the line through all three corners is left, which touches them.
        assert!(!stabbing.push(at(2.0, 5.0), at(2.0, 4.0)));
        assert!(stabbing.push(at(2.0, 5.0), at(2.0, 4.0f64.next_down())));
        stabbing.pop();
        assert!(stabbing.push(at(2.0, 2.0), at(2.0, 1.0)));
    }
}
