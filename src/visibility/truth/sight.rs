//! Lines of sight as three exact numbers, and cells of them: convex polygons of the
//! image. It defines the one form that decides everything about boxes and lines:
//! which of two planes a line crosses first. What is hidden is left to `cover`.

use glam::DVec3;

use super::certificate::{Edge, View, longest};
use crate::arithmetic::{Expansion, two_sum};
use crate::scene::WorldBox;

/// Three exact numbers and their nearest doubles (true to 2^-50 of themselves).
#[derive(Clone, Debug)]
pub struct Triple {
    pub exact: [Expansion; 3],
    pub near: [f64; 3],
}

impl From<[Expansion; 3]> for Triple {
    fn from(exact: [Expansion; 3]) -> Triple {
        let exact = exact.map(Expansion::compressed);
        let near = [0, 1, 2].map(|k: usize| exact[k].estimate());
        Triple { exact, near }
    }
}

/// A sum of products of a few rounded factors is true in sign if it is above this
/// share of its terms' sizes: factors are off by 2^-50 each, products of three by
/// less than 2^-48, and sums of six of them by a few 2^-52 more.
const GUARD: f64 = 1.0 / (1u64 << 46) as f64;

impl Triple {
    /// The sign of the scalar product.
    pub fn dot_sign(&self, other: &Triple) -> i32 {
        let products = [0, 1, 2].map(|k: usize| self.near[k] * other.near[k]);
        let size: f64 = products.iter().map(|p| p.abs()).sum();
        let sum: f64 = products.iter().sum();
        if sum.abs() > GUARD * size {
            return if sum > 0.0 { 1 } else { -1 };
        }
        if size == 0.0 {
            return 0;
        }
        let exact = [0, 1, 2].map(|k: usize| &self.exact[k] * &other.exact[k]);
        (&(&exact[0] + &exact[1]) + &exact[2]).sign()
    }

    /// The cross product: the line through two points of the image, or the point on
    /// two lines.
    pub fn cross(&self, other: &Triple) -> Triple {
        let (a, b) = (&self.exact, &other.exact);
        let minor = |i: usize, j: usize| &(&a[i] * &b[j]) - &(&a[j] * &b[i]);
        [minor(1, 2), minor(2, 0), minor(0, 1)].into()
    }

    pub fn negated(&self) -> Triple {
        Triple {
            exact: [0, 1, 2].map(|k: usize| -&self.exact[k]),
            near: self.near.map(|x| -x),
        }
    }

    /// The sign of the determinant of three lines of sight.
    pub fn turn(a: &Triple, b: &Triple, c: &Triple) -> i32 {
        let (p, q, r) = (
            DVec3::from(a.near),
            DVec3::from(b.near),
            DVec3::from(c.near),
        );
        let det = p.cross(q).dot(r);
        let (p, q, r) = (p.abs(), q.abs(), r.abs());
        let size = r.x * (p.y * q.z + p.z * q.y)
            + r.y * (p.z * q.x + p.x * q.z)
            + r.z * (p.x * q.y + p.y * q.x);
        match det {
            _ if size == 0.0 => 0,
            _ if det.abs() > GUARD * size => det.total_cmp(&0.0) as i32,
            _ => a.cross(b).dot_sign(c),
        }
    }
}

/// Where all lines of sight come from.
#[derive(Clone, Debug)]
pub struct Sight {
    pub view: View,
    pub sides: [Triple; 4],
    /// Of parallel lines: the axis along which they are longest.
    across: usize,
}

/// `x` and what its rounding lost, as an exact number.
fn exact_pair((sum, lost): (f64, f64)) -> Expansion {
    let mut exact = Expansion::from(lost);
    exact.grow(sum);
    exact
}

/// A plane across an axis.
pub type Plane = (usize, f64);

impl Sight {
    pub fn new(view: &View) -> Sight {
        Sight {
            sides: view.sides.map(|side| side.map(Expansion::from).into()),
            across: longest(view.forward),
            view: view.clone(),
        }
    }

    /// The line of sight through a point.
    pub fn through(&self, point: [f64; 3]) -> Triple {
        let View { eye, forward, .. } = &self.view;
        if !self.view.parallel {
            return [0, 1, 2]
                .map(|k: usize| exact_pair(two_sum(point[k], -eye[k])))
                .into();
        }
        let m = self.across;
        let line = [0, 1, 2].map(|k: usize| match k == m {
            true => Expansion::from(forward[m]),
            false => {
                &Expansion::product(point[k], forward[m])
                    - &Expansion::product(point[m], forward[k])
            }
        });
        let line = Triple::from(line);
        if forward[m] < 0.0 {
            line.negated()
        } else {
            line
        }
    }

    /// What is between the line's zero and the plane along the plane's axis, in some
    /// unit above zero.
    fn gap(&self, line: &Triple, (axis, plane): Plane) -> f64 {
        match self.view.parallel {
            false => plane - self.view.eye[axis],
            true => self.gap_exactly(line, (axis, plane)).estimate(),
        }
    }

    fn gap_exactly(&self, line: &Triple, (axis, plane): Plane) -> Expansion {
        if !self.view.parallel {
            return exact_pair(two_sum(plane, -self.view.eye[axis]));
        }
        let scaled = &line.exact[self.across] * &Expansion::from(plane);
        match axis == self.across {
            true => scaled,
            false => &scaled - &line.exact[axis],
        }
    }

    /// How fast the line goes along an axis, in some unit above zero.
    pub fn slope(&self, line: &Triple, axis: usize) -> f64 {
        match self.view.parallel {
            false => line.near[axis],
            true => self.view.forward[axis],
        }
    }

    fn slope_exactly(&self, line: &Triple, axis: usize) -> Expansion {
        match self.view.parallel {
            false => line.exact[axis].clone(),
            true => self.view.forward[axis].into(),
        }
    }

    /// The sign of `gap`: whether the plane is up the axis.
    pub fn gap_sign(&self, line: &Triple, plane: Plane) -> i32 {
        sign(self.gap(line, plane))
    }

    /// The sign of gap(a) slope(b) - gap(b) slope(a): of depth(a) - depth(b), times
    /// the signs of both slopes. A linear form of the line.
    pub fn order(&self, line: &Triple, a: Plane, b: Plane) -> i32 {
        let left = self.gap(line, a) * self.slope(line, b.0);
        let right = self.gap(line, b) * self.slope(line, a.0);
        let difference = left - right;
        if difference.abs() > GUARD * (left.abs() + right.abs()) {
            return sign(difference);
        }
        if left == 0.0 && right == 0.0 {
            return 0;
        }
        let product =
            |a: Plane, b: Plane| &self.gap_exactly(line, a) * &self.slope_exactly(line, b.0);
        (&product(a, b) - &product(b, a)).sign()
    }

    /// Whether the line crosses the plane, which it does in the direction of `way`,
    /// where boxes hide.
    pub fn hides_from(&self, line: &Triple, plane: Plane, way: i32) -> bool {
        let View {
            eye,
            forward,
            hides_from,
            ..
        } = &self.view;
        let dot = |line: &[Expansion; 3]| {
            let terms = [0, 1, 2].map(|k: usize| &line[k] * &Expansion::from(forward[k]));
            &(&terms[0] + &terms[1]) + &terms[2]
        };
        // Depth is (gap * rate / slope + begin) / unit.
        let (rate, need) = match self.view.parallel {
            false => (dot(&line.exact), Expansion::from(*hides_from)),
            true => {
                let m = self.across;
                let unit = &line.exact[m];
                let mut place = line.exact.clone();
                place[m] = Expansion::ZERO;
                let of_eye = dot(&eye.map(Expansion::from));
                let begin = &dot(&place) - &(&of_eye * unit);
                let need = &(unit * &Expansion::from(*hides_from)) - &begin;
                (dot(&forward.map(Expansion::from)), need)
            }
        };
        let reached = &self.gap_exactly(line, plane) * &rate;
        let needed = &need * &self.slope_exactly(line, plane.0);
        (&reached - &needed).sign() * way >= 0
    }

    /// The line through the image where two faces' planes meet, so that its scalar
    /// product with a line of sight is `order` of the second plane and the first.
    pub fn edge(&self, boxes: [&WorldBox; 2], edge: &Edge) -> Triple {
        let [i, j] = edge.axes.map(usize::from);
        let bound = |place: usize, axis: usize| match edge.upper[place] {
            true => boxes[place].max[axis],
            false => boxes[place].min[axis],
        };
        let (at_i, at_j) = (bound(0, i), bound(1, j));
        let View {
            eye,
            forward,
            parallel,
            ..
        } = &self.view;
        let mut line = [const { Expansion::ZERO }; 3];
        if !parallel {
            line[i] = exact_pair(two_sum(at_j, -eye[j]));
            line[j] = -&exact_pair(two_sum(at_i, -eye[i]));
            return line.into();
        }
        line[i] = forward[j].into();
        line[j] = (-forward[i]).into();
        let m = self.across;
        let along = &Expansion::product(at_j, forward[i]) - &Expansion::product(at_i, forward[j]);
        if m == i || m == j {
            line[m] = Expansion::ZERO;
        }
        line[m] = &line[m] + &along;
        line.into()
    }
}

pub fn sign(x: f64) -> i32 {
    i32::from(x > 0.0) - i32::from(x < 0.0)
}

/// A convex polygon of the image, anticlockwise: for neighbours p and q and any r in
/// it, `turn(p, q, r)` is not below zero.
#[derive(Clone, Debug)]
pub struct Polygon {
    pub corners: Vec<Triple>,
    /// The side from each corner to the next; made when it is cut.
    sides: Vec<Option<Triple>>,
    /// Whether the lines along that side are proven hidden elsewhere.
    open: Vec<bool>,
}

impl Polygon {
    pub fn new(corners: Vec<Triple>) -> Polygon {
        let (sides, open) = (vec![None; corners.len()], vec![false; corners.len()]);
        Polygon {
            corners,
            sides,
            open,
        }
    }

    /// Whether a form that has these signs at the corners is below zero for all lines
    /// in the polygon but those along an open side.
    pub fn below_zero(&self, mut signs: impl FnMut(&Triple) -> i32) -> bool {
        let count = self.corners.len();
        let mut zeros = Vec::new();
        for (k, corner) in self.corners.iter().enumerate() {
            match signs(corner) {
                0 if self.open[k] || self.open[(k + count - 1) % count] => zeros.push(k),
                -1 => {}
                _ => return false,
            }
        }
        let on = |side: usize| zeros.iter().all(|&k| k == side || k == (side + 1) % count);
        zeros.is_empty() || (0..count).any(|side| self.open[side] && on(side))
    }

    /// The part where the scalar product with `line` is not below zero; `None` where
    /// no more than a corner or side of it would be left. `open`: the lines along the
    /// cut are proven hidden elsewhere.
    pub fn cut(&self, line: &Triple, open: bool) -> Option<Polygon> {
        let signs: Vec<i32> = self.corners.iter().map(|c| c.dot_sign(line)).collect();
        if signs.iter().all(|&sign| sign <= 0) {
            return None;
        }
        if signs.iter().all(|&sign| sign >= 0) {
            return Some(self.clone());
        }
        let count = self.corners.len();
        let mut part = Polygon::new(Vec::new());
        let mut push = |corner: Triple, side: Option<Triple>, open: bool| {
            part.corners.push(corner);
            part.sides.push(side);
            part.open.push(open);
        };
        for here in 0..count {
            let next = (here + 1) % count;
            let (a, b) = (signs[here], signs[next]);
            let side = || {
                let known = self.sides[here].clone();
                known.unwrap_or_else(|| self.corners[here].cross(&self.corners[next]))
            };
            let corner = self.corners[here].clone();
            match (a, b) {
                (1, -1) => {
                    let side = side();
                    let crossing = side.cross(line);
                    push(corner, Some(side), self.open[here]);
                    push(crossing, Some(line.clone()), open);
                }
                (-1, 1) => {
                    let side = side();
                    push(line.cross(&side), Some(side), self.open[here]);
                }
                // From a corner on the line out of the part: along the line.
                (0, -1) => push(corner, Some(line.clone()), open),
                (0 | 1, _) => push(corner, self.sides[here].clone(), self.open[here]),
                _ => {}
            }
        }
        Some(part)
    }
}
