//! Lines of a view and what they cross, in exact numbers.

use super::super::certificate::View;
use crate::arithmetic::Expansion;
use crate::scene::WorldBox;

pub type Exact = Expansion;
pub type Three = [Exact; 3];

/// A line of the view.
pub struct Line {
    /// Its three numbers, as [`View`] explains them.
    pub numbers: Three,
    pub place: Three,
    pub unit: Exact,
    pub direction: Three,
}

pub fn exact(numbers: [f64; 3]) -> Three {
    numbers.map(Exact::from)
}

pub fn dot(a: &Three, b: &Three) -> Exact {
    &(&(&a[0] * &b[0]) + &(&a[1] * &b[1])) + &(&a[2] * &b[2])
}

pub fn cross(a: &Three, b: &Three) -> Three {
    let minor = |i: usize, j: usize| (&(&a[i] * &b[j]) - &(&a[j] * &b[i])).compressed();
    [minor(1, 2), minor(2, 0), minor(0, 1)]
}

/// The sign of `a * b - c * d`. The nearest doubles decide where the difference is
/// more than 2^-40 of the products, which are true to 2^-48.
pub fn sign_of_difference(a: &Exact, b: &Exact, c: &Exact, d: &Exact) -> i32 {
    let (left, right) = (a.estimate() * b.estimate(), c.estimate() * d.estimate());
    let clear = (left.abs() + right.abs()) / (1u64 << 40) as f64;
    if (left - right).abs() > clear {
        return if left > right { 1 } else { -1 };
    }
    (&(a * b) - &(c * d)).sign()
}

/// The axis along which the direction is longest, the first of equals.
pub fn main_axis(view: &View) -> usize {
    let size = |axis: usize| view.forward[axis].abs();
    (1..3).fold(
        0,
        |most, axis| if size(axis) > size(most) { axis } else { most },
    )
}

impl Line {
    pub fn new(view: &View, numbers: Three) -> Line {
        if !view.parallel {
            let (place, direction) = (exact(view.eye), numbers.clone());
            return Line {
                numbers,
                place,
                unit: 1.0.into(),
                direction,
            };
        }
        let m = main_axis(view);
        let (mut place, unit) = (numbers.clone(), numbers[m].clone());
        place[m] = Exact::ZERO;
        Line {
            numbers,
            place,
            unit,
            direction: exact(view.forward),
        }
    }

    /// The line of the view through a point.
    pub fn through(view: &View, point: [f64; 3]) -> Line {
        let (point, eye, forward) = (exact(point), exact(view.eye), exact(view.forward));
        if !view.parallel {
            return Line::new(view, [0, 1, 2].map(|k: usize| &point[k] - &eye[k]));
        }
        // (point - forward * point_m / forward_m) * |forward_m|, and |forward_m|.
        let m = main_axis(view);
        let turn = Exact::from(view.forward[m].signum());
        let slid = |k: usize| &(&point[k] * &forward[m]) - &(&point[m] * &forward[k]);
        let numbers =
            [0, 1, 2].map(|k: usize| &turn * &if k == m { forward[m].clone() } else { slid(k) });
        Line::new(view, numbers)
    }

    /// From the line's place to the plane across an axis, times the unit.
    pub fn gap(&self, axis: usize, plane: f64) -> Exact {
        &(&self.unit * &plane.into()) - &self.place[axis]
    }

    pub fn way(&self, axis: usize) -> i32 {
        self.direction[axis].sign()
    }

    /// The form of two planes: gap(a) direction(b) - gap(b) direction(a).
    pub fn form(&self, a: (usize, f64), b: (usize, f64)) -> i32 {
        let (gap_a, gap_b) = (self.gap(a.0, a.1), self.gap(b.0, b.1));
        sign_of_difference(&gap_a, &self.direction[b.0], &gap_b, &self.direction[a.0])
    }

    /// Whether the whole line meets the closed box: no plane is entered behind one
    /// that is left.
    pub fn meets(&self, b: &WorldBox) -> bool {
        (0..3).all(|k| match self.way(k) {
            0 => self.gap(k, b.min[k]).sign() <= 0 && self.gap(k, b.max[k]).sign() >= 0,
            way => (0..3).filter(|&i| self.way(i) != 0).all(|i| {
                let (enters, leaves) = ((k, face(b, k, way)), (i, face(b, i, -self.way(i))));
                self.form(enters, leaves) * way * self.way(i) <= 0
            }),
        })
    }

    /// Whether the depth where it crosses a plane is at least `least`:
    /// (place / unit - eye) . forward + t * (direction . forward).
    pub fn is_as_deep(&self, view: &View, (axis, plane): (usize, f64), least: f64) -> bool {
        let (eye, forward) = (exact(view.eye), exact(view.forward));
        let from_eye = [0, 1, 2].map(|k: usize| &self.place[k] - &(&eye[k] * &self.unit));
        let still = &(&self.unit * &least.into()) - &dot(&from_eye, &forward);
        let rate = dot(&self.direction, &forward);
        let gap = self.gap(axis, plane);
        sign_of_difference(&gap, &rate, &still, &self.direction[axis]) * self.way(axis) >= 0
    }
}

/// The bound of a box that a line enters by which goes `way` along the axis.
pub fn face(b: &WorldBox, axis: usize, way: i32) -> f64 {
    if way > 0 { b.min[axis] } else { b.max[axis] }
}

/// Corner k of a box: bit i says whether it is at the upper bound on axis i.
pub fn corner(b: &WorldBox, k: u8) -> [f64; 3] {
    [0, 1, 2].map(|axis: usize| {
        if k >> axis & 1 == 1 {
            b.max[axis]
        } else {
            b.min[axis]
        }
    })
}

/// Whether the point is in the closed box.
pub fn holds(b: &WorldBox, point: [f64; 3]) -> bool {
    (0..3).all(|k| b.min[k] <= point[k] && point[k] <= b.max[k])
}
