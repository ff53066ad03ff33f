//! The second opinion on certificates: whether each proof is one, by exact arithmetic
//! and without any code of the search. It is meant to be read.
//!
//! All that is compared here are depths along lines, which are fractions. A line goes
//! through `place / unit` in `direction`; it crosses the plane x_k = c at
//! t = (c * unit - place_k) / (unit * direction_k). With gap = c * unit - place_k,
//! t(a) < t(b) is gap(a) * direction(b) < gap(b) * direction(a), turned round once
//! for each direction that is below zero. All lines of a view share the eye or the
//! direction, so this form is linear in the three numbers of a line: what it says of
//! the corners of a cell it says of every line through it.

use super::certificate::{Cell, Certificates, Edge, Proof, View};
use crate::arithmetic::Expansion;
use crate::query::ItemId;
use crate::scene::WorldBox;

/// What a set of certificates proves.
#[derive(Clone, Copy, PartialEq, Eq, Default, Debug)]
#[non_exhaustive]
pub struct Counts {
    /// Items proven visible.
    pub visible: usize,
    /// Items proven hidden.
    pub hidden: usize,
    /// Items proven to be in front only where one of a lower number is as near.
    pub tied: usize,
    /// Items of which nothing is claimed.
    pub undecided: usize,
    /// Parts of images that were found to lie behind a box.
    pub cells: usize,
}

/// The first proof that is none.
#[derive(Clone, Copy, PartialEq, Eq, Debug, thiserror::Error)]
#[error("the certificate of item {item} does not hold: {reason}")]
pub struct Rejected {
    /// Whose it is; of the view as a whole, 0.
    pub item: ItemId,
    /// What is wrong with it.
    pub reason: &'static str,
}

type Exact = Expansion;
type Three = [Exact; 3];

/// A line of the view.
struct Line {
    /// Its three numbers, as [`View`] explains them.
    numbers: Three,
    place: Three,
    unit: Exact,
    direction: Three,
}

fn exact(numbers: [f64; 3]) -> Three {
    numbers.map(Exact::from)
}

fn dot(a: &Three, b: &Three) -> Exact {
    &(&(&a[0] * &b[0]) + &(&a[1] * &b[1])) + &(&a[2] * &b[2])
}

fn cross(a: &Three, b: &Three) -> Three {
    let minor = |i: usize, j: usize| (&(&a[i] * &b[j]) - &(&a[j] * &b[i])).compressed();
    [minor(1, 2), minor(2, 0), minor(0, 1)]
}

/// The sign of `a * b - c * d`. The nearest doubles decide where the difference is
/// more than 2^-40 of the products, which are true to 2^-48.
fn sign_of_difference(a: &Exact, b: &Exact, c: &Exact, d: &Exact) -> i32 {
    let (left, right) = (a.estimate() * b.estimate(), c.estimate() * d.estimate());
    let clear = (left.abs() + right.abs()) / (1u64 << 40) as f64;
    if (left - right).abs() > clear {
        return if left > right { 1 } else { -1 };
    }
    (&(a * b) - &(c * d)).sign()
}

/// The axis along which the direction is longest, the first of equals.
fn main_axis(view: &View) -> usize {
    let size = |axis: usize| view.forward[axis].abs();
    (1..3).fold(
        0,
        |most, axis| if size(axis) > size(most) { axis } else { most },
    )
}

impl Line {
    fn new(view: &View, numbers: Three) -> Line {
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
    fn through(view: &View, point: [f64; 3]) -> Line {
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
    fn gap(&self, axis: usize, plane: f64) -> Exact {
        &(&self.unit * &plane.into()) - &self.place[axis]
    }

    fn way(&self, axis: usize) -> i32 {
        self.direction[axis].sign()
    }

    /// The form of two planes: gap(a) direction(b) - gap(b) direction(a).
    fn form(&self, a: (usize, f64), b: (usize, f64)) -> i32 {
        let (gap_a, gap_b) = (self.gap(a.0, a.1), self.gap(b.0, b.1));
        sign_of_difference(&gap_a, &self.direction[b.0], &gap_b, &self.direction[a.0])
    }

    /// Whether the whole line meets the closed box: no plane is entered behind one
    /// that is left.
    fn meets(&self, b: &WorldBox) -> bool {
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
    fn is_as_deep(&self, view: &View, (axis, plane): (usize, f64), least: f64) -> bool {
        let (eye, forward) = (exact(view.eye), exact(view.forward));
        let from_eye = [0, 1, 2].map(|k: usize| &self.place[k] - &(&eye[k] * &self.unit));
        let still = &(&self.unit * &least.into()) - &dot(&from_eye, &forward);
        let rate = dot(&self.direction, &forward);
        let gap = self.gap(axis, plane);
        sign_of_difference(&gap, &rate, &still, &self.direction[axis]) * self.way(axis) >= 0
    }
}

/// The bound of a box that a line enters by which goes `way` along the axis.
fn face(b: &WorldBox, axis: usize, way: i32) -> f64 {
    if way > 0 { b.min[axis] } else { b.max[axis] }
}

/// Corner k of a box: bit i says whether it is at the upper bound on axis i.
fn corner(b: &WorldBox, k: u8) -> [f64; 3] {
    [0, 1, 2].map(|axis: usize| {
        if k >> axis & 1 == 1 {
            b.max[axis]
        } else {
            b.min[axis]
        }
    })
}

/// Verifies every proof, for the boxes as they were written.
///
/// It takes the view as it is: that it is the camera's is for the caller to compare
/// ([`View::of`]). O(boxes) a witness; a few microseconds a corner of a cell.
///
/// # Errors
/// The first certificate that does not hold.
pub fn check(certificates: &Certificates, boxes: &[WorldBox]) -> Result<Counts, Rejected> {
    let view = &certificates.view;
    sound(view, certificates.boxes, boxes).map_err(|reason| Rejected { item: 0, reason })?;
    let mut counts = Counts::default();
    for (item, proof) in &certificates.proofs {
        let reject = |reason| Rejected {
            item: *item,
            reason,
        };
        let own = boxes
            .get(*item as usize)
            .ok_or(reject("there is no such item"))?;
        match proof {
            Proof::Undecided => counts.undecided += 1,
            Proof::Witness { origin, direction } => {
                witness(view, *origin, *direction, *item, boxes).map_err(reject)?;
                counts.visible += 1;
            }
            Proof::AroundEye => {
                let around = !view.parallel && view.near > 0.0 && holds(own, view.eye);
                around.then_some(()).ok_or(reject("the eye is not in it"))?;
                counts.hidden += 1;
            }
            Proof::Cover {
                outline,
                ties,
                cell,
            } => {
                let image = image(view, own, outline).map_err(reject)?;
                let sides = view.sides.map(|side| Side {
                    line: exact(side),
                    open: false,
                });
                let seen = sides
                    .iter()
                    .try_fold(image, |image, side| image.cut(view, side));
                let judge = Judge {
                    view,
                    boxes,
                    item: *item,
                    ties: *ties,
                };
                counts.cells += judge.cell(seen.as_ref(), cell).map_err(reject)?;
                match ties {
                    true => counts.tied += 1,
                    false => counts.hidden += 1,
                }
            }
        }
    }
    Ok(counts)
}

/// Whether the view and the boxes can be spoken about at all.
fn sound(view: &View, count: usize, boxes: &[WorldBox]) -> Result<(), &'static str> {
    let View {
        eye,
        forward,
        sides,
        near,
        far,
        hides_from,
        ..
    } = view;
    let numbers = eye
        .iter()
        .chain(forward)
        .chain(sides.as_flattened())
        .chain([near, hides_from]);
    let far = far.unwrap_or(f64::INFINITY);
    let finite = |b: &WorldBox| b.min.is_finite() && b.max.is_finite() && b.min.cmple(b.max).all();
    match () {
        () if count != boxes.len() => Err("they are of another number of boxes"),
        () if !numbers.copied().all(f64::is_finite) => Err("a number of the view is not finite"),
        () if !(near <= hides_from && *near < far) => Err("the view's depths are not in order"),
        () if !view.parallel && *near <= 0.0 => Err("an eye's near plane is behind it"),
        () if *forward == [0.0; 3] => Err("the view has no direction"),
        () if !boxes.iter().all(finite) => Err("a box is not one"),
        () => Ok(()),
    }
}

fn holds(b: &WorldBox, point: [f64; 3]) -> bool {
    (0..3).all(|k| b.min[k] <= point[k] && point[k] <= b.max[k])
}

/// A ray of the view that enters the item from near to far, and no other before it.
fn witness(
    view: &View,
    origin: [f64; 3],
    direction: [f64; 3],
    item: ItemId,
    boxes: &[WorldBox],
) -> Result<(), &'static str> {
    let line = match view.parallel {
        false if origin == view.eye => Line::new(view, exact(direction)),
        true if direction == view.forward => Line::through(view, origin),
        _ => return Err("its ray does not begin where the view's rays do"),
    };
    if view
        .sides
        .iter()
        .any(|&side| dot(&line.numbers, &exact(side)).sign() < 0)
    {
        return Err("its ray is not in the view");
    }
    let scale: f64 = (0..3).map(|k| direction[k] * view.forward[k]).sum();
    if (scale - 1.0).abs() > 1e-9 {
        return Err("its ray does not count depth as the view does");
    }
    let own = entry(view, origin, direction, &boxes[item as usize]);
    let own = own.ok_or("its ray does not meet the item")?;
    let before = |b: &WorldBox| {
        let guess = guess(origin, direction, b);
        let possible = guess.is_none_or(|[enters, leaves]| {
            enters <= leaves
                && enters <= roomy(own.0.estimate() / own.1, 1.0)
                && leaves >= roomy(view.near, -1.0)
        });
        possible && entry(view, origin, direction, b).is_some_and(|other| less(&other, &own))
    };
    match boxes.iter().any(before) {
        true => Err("another item is in front of it"),
        false => Ok(()),
    }
}

/// A depth as numerator and denominator, which is above zero.
type Depth = (Exact, f64);

fn less(a: &Depth, b: &Depth) -> bool {
    sign_of_difference(&a.0, &b.1.into(), &b.0, &a.1.into()) < 0
}

/// Where a ray enters a box, if it does from near to far; exactly.
fn entry(view: &View, origin: [f64; 3], direction: [f64; 3], b: &WorldBox) -> Option<Depth> {
    let (mut enters, mut leaves): (Option<Depth>, Option<Depth>) = (None, None);
    for k in 0..3 {
        let (d, o) = (direction[k], Exact::from(origin[k]));
        if d == 0.0 {
            if origin[k] < b.min[k] || origin[k] > b.max[k] {
                return None;
            }
            continue;
        }
        let way = if d > 0.0 { 1 } else { -1 };
        let depth = |plane: f64| {
            (
                &(&Exact::from(plane) - &o) * &f64::from(way).into(),
                d.abs(),
            )
        };
        let (from, to) = (depth(face(b, k, way)), depth(face(b, k, -way)));
        enters = Some(enters.filter(|enters| !less(enters, &from)).unwrap_or(from));
        leaves = Some(leaves.filter(|leaves| !less(&to, leaves)).unwrap_or(to));
    }
    let (enters, leaves) = (enters?, leaves?);
    let depth = |x: f64| (Exact::from(x), 1.0);
    let met = !less(&leaves, &enters)
        && !less(&enters, &depth(view.near))
        && view.far.is_none_or(|far| !less(&depth(far), &enters));
    met.then_some(enters)
}

/// A depth moved by more than it can have been rounded.
fn roomy(depth: f64, by: f64) -> f64 {
    depth + by * depth.abs() * 1e-14
}

/// Not above the depth where the ray enters and not below the one where it leaves:
/// to pass over boxes far from it. `None` where that is not so simple.
fn guess(origin: [f64; 3], direction: [f64; 3], b: &WorldBox) -> Option<[f64; 2]> {
    let (mut enters, mut leaves) = (f64::NEG_INFINITY, f64::INFINITY);
    for k in 0..3 {
        if direction[k].abs() < 1e-100 {
            return None;
        }
        let low = (b.min[k] - origin[k]) / direction[k];
        let high = (b.max[k] - origin[k]) / direction[k];
        enters = enters.max(roomy(low.min(high), -1.0));
        leaves = leaves.min(roomy(low.max(high), 1.0));
    }
    Some([enters, leaves])
}

/// A side of a part of the image.
#[derive(Clone)]
struct Side {
    /// What has no scalar product below zero with any line in the part.
    line: Three,
    /// Whether the lines along it are proven hidden with another part.
    open: bool,
}

/// A convex part of the image: corners, each with the side to the next.
struct Part {
    corners: Vec<(Line, Side)>,
}

/// The image of a box with these corners round it.
fn image(view: &View, b: &WorldBox, outline: &[u8]) -> Result<Part, &'static str> {
    if !view.parallel && holds(b, view.eye) {
        return Err("the eye is in it: its image has no outline");
    }
    let distinct =
        (0..outline.len()).all(|k| outline[k] < 8 && !outline[..k].contains(&outline[k]));
    if outline.len() < 3 || !distinct {
        return Err("its outline is not one");
    }
    let all: Vec<Line> = (0..8).map(|k| Line::through(view, corner(b, k))).collect();
    let next = |k: usize| outline[(k + 1) % outline.len()];
    let corners = (0..outline.len()).map(|k| {
        let (from, to) = (&all[usize::from(outline[k])], &all[usize::from(next(k))]);
        let side = cross(&from.numbers, &to.numbers);
        let turns = all.iter().map(|line| dot(&line.numbers, &side).sign());
        // A closed walk along supporting lines, the box on the left and none of them
        // without a direction, leads round the whole image.
        let (least, most) =
            turns.fold((1, -1), |(low, high), turn| (turn.min(low), turn.max(high)));
        match (least, most) {
            (0, 1) => {
                let side = Side {
                    line: side,
                    open: false,
                };
                Ok((Line::new(view, from.numbers.clone()), side))
            }
            _ => Err("its outline does not go round the box"),
        }
    });
    Ok(Part {
        corners: corners.collect::<Result<_, _>>()?,
    })
}

impl Part {
    /// What of it is on the upper side of a line of the image; `None` if nothing is
    /// but, at most, some of its border.
    fn cut(&self, view: &View, by: &Side) -> Option<Part> {
        let signs = self
            .corners
            .iter()
            .map(|(line, _)| dot(&line.numbers, &by.line).sign());
        let signs: Vec<i32> = signs.collect();
        signs.contains(&1).then_some(())?;
        let mut corners = Vec::new();
        for (k, (corner, side)) in self.corners.iter().enumerate() {
            let corner = || Line::new(view, corner.numbers.clone());
            let crossing = |a: &Side, b: &Side| Line::new(view, cross(&a.line, &b.line));
            // A side is p x q times something above zero, and by Lagrange's formula
            // (p x q) x by = q (p . by) - p (q . by): between p and q if p is above.
            match (signs[k], signs[(k + 1) % signs.len()]) {
                (1, -1) => {
                    corners.push((corner(), side.clone()));
                    corners.push((crossing(side, by), by.clone()));
                }
                (-1, 1) => corners.push((crossing(by, side), side.clone())),
                (0, -1) => corners.push((corner(), by.clone())),
                (-1, _) => {}
                _ => corners.push((corner(), side.clone())),
            }
        }
        Some(Part { corners })
    }

    /// Whether a form is below zero for all its lines but those along an open side:
    /// below zero at all corners, but for those of one such side, where it may be zero.
    fn below(&self, form: impl Fn(&Line) -> i32) -> bool {
        let count = self.corners.len();
        let signs: Vec<i32> = self.corners.iter().map(|(line, _)| form(line)).collect();
        let spared = |side: usize, k: usize| k == side || k == (side + 1) % count;
        let but_for =
            |side: usize| (0..count).all(|k| signs[k] < 0 || signs[k] == 0 && spared(side, k));
        signs.iter().all(|&sign| sign < 0)
            || (0..count).any(|side| self.corners[side].1.open && but_for(side))
    }

    /// The way of all its lines along an axis; 0 if they differ or stand still.
    fn way(&self, axis: usize) -> i32 {
        let way = self.corners[0].0.way(axis);
        let same = self.corners.iter().all(|(line, _)| line.way(axis) == way);
        if same { way } else { 0 }
    }

    fn all(&self, holds: impl Fn(&Line) -> bool) -> bool {
        self.corners.iter().all(|(line, _)| holds(line))
    }
}

/// The cells of one item.
struct Judge<'c> {
    view: &'c View,
    boxes: &'c [WorldBox],
    item: ItemId,
    /// Whether items of lower numbers may be as near.
    ties: bool,
}

impl Judge<'_> {
    /// How many boxes hide the part.
    fn cell(&self, part: Option<&Part>, cell: &Cell) -> Result<usize, &'static str> {
        match (cell, part) {
            (Cell::Empty, None) => Ok(0),
            (_, None) => Err("a cell without rays claims something"),
            (Cell::Empty, Some(_)) => Err("a cell with rays is called empty"),
            (Cell::Behind(front), Some(part)) => {
                let hides = self
                    .boxes
                    .get(*front as usize)
                    .ok_or("there is no such box in front")?;
                self.hidden(part, hides, self.ties && *front < self.item)
                    .map(|()| 1)
            }
            (
                Cell::Parted {
                    edge,
                    line_in_first,
                    cells,
                },
                Some(part),
            ) => {
                let line = self.line(edge)?;
                let other = [0, 1, 2].map(|k: usize| -&line[k]);
                let first = part.cut(
                    self.view,
                    &Side {
                        line,
                        open: !line_in_first,
                    },
                );
                let second = part.cut(
                    self.view,
                    &Side {
                        line: other,
                        open: *line_in_first,
                    },
                );
                // What is not cut off at all has no side along the line to be open: a
                // part that is left alone is proven with its whole border.
                let cells = [(first, &cells[0]), (second, &cells[1])];
                cells
                    .iter()
                    .map(|(part, cell)| self.cell(part.as_ref(), cell))
                    .sum()
            }
        }
    }

    /// The line through the image along an edge: the form of its two planes, whose
    /// three factors are what it is of the lines (1, 0, 0), (0, 1, 0) and (0, 0, 1).
    fn line(&self, edge: &Edge) -> Result<Three, &'static str> {
        let b = self
            .boxes
            .get(edge.item as usize)
            .ok_or("there is no box with that edge")?;
        let [i, j] = edge.axes.map(usize::from);
        if i >= j || j > 2 {
            return Err("there is no such edge");
        }
        let [at_i, at_j] =
            [(i, edge.upper[0]), (j, edge.upper[1])].map(|(axis, upper)| match upper {
                true => b.max[axis],
                false => b.min[axis],
            });
        Ok([0, 1, 2].map(|k: usize| {
            let mut unit = [0.0; 3];
            unit[k] = 1.0;
            let line = Line::new(self.view, exact(unit));
            &(&line.gap(j, at_j) * &line.direction[i]) - &(&line.gap(i, at_i) * &line.direction[j])
        }))
    }

    /// All rays through the part enter `front`, not before boxes hide, and before they
    /// enter the item if they do; with `ties`, not after that.
    fn hidden(&self, part: &Part, front: &WorldBox, ties: bool) -> Result<(), &'static str> {
        let back = &self.boxes[self.item as usize];
        if !part.all(|line| line.meets(front)) {
            return Err("a box in front does not cover its cell");
        }
        // Entered is the last of three planes: deep enough if any of them is.
        let deep = |k: usize| {
            let plane = (k, face(front, k, part.way(k)));
            part.way(k) != 0
                && part.all(|line| line.is_as_deep(self.view, plane, self.view.hides_from))
        };
        if !(0..3).any(deep) {
            return Err("a box in front begins before the near plane");
        }
        // The item is not entered before its plane across some axis, and the box in
        // front is entered before that, whichever of its planes is the last.
        let nearer = |form: &dyn Fn(&Line) -> i32| match ties {
            true => part.all(|line| form(line) <= 0),
            false => part.below(form),
        };
        let first = |k: usize| {
            let way = self.way_to(back, k, part);
            let behind = (k, face(back, k, way));
            way != 0
                && (0..3).all(|i| {
                    let front_way = self.way_to(front, i, part);
                    let plane = (i, face(front, i, front_way));
                    front_way == 0
                        || front_way == part.way(i)
                            && nearer(&|line: &Line| line.form(plane, behind) * front_way * way)
                })
        };
        match (0..3).any(first) {
            true => Ok(()),
            false => Err("a box in front is not nearer throughout its cell"),
        }
    }

    /// Which way a ray must go along an axis to enter the box through a plane across
    /// it. 0 if it need not cross one: from an eye between the two planes, or where no
    /// ray goes along the axis.
    fn way_to(&self, b: &WorldBox, axis: usize, part: &Part) -> i32 {
        match self.view.parallel {
            true => part.way(axis),
            false if b.min[axis] > self.view.eye[axis] => 1,
            false if b.max[axis] < self.view.eye[axis] => -1,
            false => 0,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::camera::{Camera, Lens, look_at};
    use crate::visibility::truth::{Prover, RayIndex, SampleTruth, certify, judge};
    use crate::visibility::{Rays, SampleGrid};
    use glam::DVec3;

    const POST: ItemId = 0;
    const LEFT: ItemId = 1;
    const HIDDEN: ItemId = 3;
    const BACK: ItemId = 4;
    /// The same box as the hidden one.
    const TWIN: ItemId = 7;

    /// From zero along x: a post, two halves of a wall, two things behind them.
    fn boxes() -> Vec<WorldBox> {
        let b = |x: [f64; 2], y: [f64; 2], z: [f64; 2]| {
            WorldBox::new(DVec3::new(x[0], y[0], z[0]), DVec3::new(x[1], y[1], z[1]))
        };
        let around = b([-0.5, 0.5], [-0.5, 0.5], [-0.5, 0.5]);
        let near = b([0.5, 0.75], [-5.0, 5.0], [-5.0, 5.0]);
        vec![
            b([1.5, 1.75], [-0.125, 0.125], [-2.0, 0.5]),
            b([2.0, 3.0], [0.0, 5.0], [-5.0, 5.0]),
            b([2.0, 3.0], [-5.0, 0.0], [-5.0, 5.0]),
            b([6.0, 7.0], [-1.0, 1.0], [-1.0, 1.0]),
            b([8.0, 9.0], [-2.0, 2.0], [-2.0, 2.0]),
            around,
            near,
            b([6.0, 7.0], [-1.0, 1.0], [-1.0, 1.0]),
        ]
    }

    fn rays(parallel: bool) -> Rays {
        let frame = look_at(DVec3::ZERO, DVec3::X, DVec3::Z).unwrap();
        let lens = match parallel {
            false => Lens::off_axis([-1.0, 1.0, -1.0, 1.0], 1.0, None),
            true => Lens::orthographic(4.0, 1.0, 1.0, 90.0),
        };
        Rays::of(&Camera {
            frame,
            lens: lens.unwrap(),
        })
        .unwrap()
    }

    fn certified(parallel: bool) -> Certificates {
        let solids = judge::solids(&boxes());
        let index = RayIndex::build(&solids);
        let rays = rays(parallel);
        let truth = SampleTruth::of(&solids, &index, &rays, SampleGrid::new(16, 16), 1);
        let prover = Prover::new(&solids, &index, &rays);
        certify("wall", &prover, &rays, &truth, &[0, 1, 2, 3, 4], 2)
    }

    fn doctored(parallel: bool, what: impl Fn(&mut Certificates)) -> &'static str {
        let mut certificates = certified(parallel);
        what(&mut certificates);
        check(&certificates, &boxes())
            .expect_err("not noticed")
            .reason
    }

    fn cell(certificates: &mut Certificates, item: ItemId) -> &mut Cell {
        match &mut certificates.proofs[item as usize].1 {
            Proof::Cover { cell, .. } => cell,
            other => panic!("{other:?}"),
        }
    }

    #[test]
    fn certificates_hold_and_survive_being_written() {
        for parallel in [false, true] {
            let certificates = certified(parallel);
            let read = Certificates::from_json(&certificates.to_json()).unwrap();
            assert_eq!(read, certificates);
            let counts = check(&read, &boxes()).unwrap();
            assert_eq!((counts.visible, counts.hidden, counts.undecided), (3, 2, 0));
            assert!(
                counts.cells >= 4,
                "the premise: a cell for each half of the wall"
            );
            assert_eq!(read.view, View::of(&rays(parallel)));
        }
    }

    #[test]
    fn a_witness_that_was_moved_is_rejected() {
        for parallel in [false, true] {
            let moved = |by: DVec3, item: ItemId| {
                doctored(parallel, move |certificates| {
                    let Proof::Witness { origin, direction } =
                        &mut certificates.proofs[item as usize].1
                    else {
                        panic!("the premise: visible");
                    };
                    let at = if parallel { origin } else { direction };
                    (0..3).for_each(|k| at[k] += by[k]);
                })
            };
            assert_eq!(
                moved(DVec3::Y * 0.5, POST),
                "its ray does not meet the item"
            );
            assert_eq!(moved(DVec3::Y * 9.0, LEFT), "its ray is not in the view");
            if !parallel {
                assert_eq!(
                    moved(DVec3::X, LEFT),
                    "its ray does not count depth as the view does"
                );
            }
            // Onto the half of the wall that the post stands before.
            let hidden = doctored(parallel, |certificates| {
                certificates.proofs[LEFT as usize].1 = certificates.proofs[POST as usize].1.clone();
            });
            assert!(
                [
                    "another item is in front of it",
                    "its ray does not meet the item"
                ]
                .contains(&hidden)
            );
            let through = doctored(parallel, |certificates| {
                let (origin, direction) = ([0.0; 3], [1.0, 0.0, 0.0]);
                certificates.proofs[BACK as usize].1 = Proof::Witness { origin, direction };
            });
            assert_eq!(through, "another item is in front of it");
        }
    }

    #[test]
    fn a_cover_that_was_doctored_is_rejected() {
        for parallel in [false, true] {
            let with = |item: ItemId, other: Cell| {
                doctored(parallel, |certificates| {
                    *cell(certificates, item) = other.clone()
                })
            };
            let not_covering = "a box in front does not cover its cell";
            assert_eq!(with(HIDDEN, Cell::Behind(LEFT)), not_covering);
            assert_eq!(with(HIDDEN, Cell::Behind(POST)), not_covering);
            let behind = "a box in front is not nearer throughout its cell";
            assert_eq!(with(HIDDEN, Cell::Behind(BACK)), behind);
            assert_eq!(with(HIDDEN, Cell::Behind(HIDDEN)), behind);
            assert_eq!(
                with(HIDDEN, Cell::Behind(6)),
                "a box in front begins before the near plane"
            );
            assert_eq!(
                with(HIDDEN, Cell::Behind(99)),
                "there is no such box in front"
            );
            assert_eq!(
                with(HIDDEN, Cell::Empty),
                "a cell with rays is called empty"
            );
            let parts = |change: fn(&mut Edge, &mut [Cell; 2])| {
                doctored(parallel, |certificates| match cell(certificates, HIDDEN) {
                    Cell::Parted { edge, cells, .. } => change(edge, cells),
                    other => panic!("{other:?}"),
                })
            };
            assert_eq!(
                parts(|_, parts| parts[0] = Cell::Empty),
                "a cell with rays is called empty"
            );
            let other_lines = [not_covering, "a cell without rays claims something"];
            assert!(other_lines.contains(&parts(|_, parts| parts.swap(0, 1))));
            assert!(other_lines.contains(&parts(|edge, _| edge.upper[1] ^= true)));
            assert_eq!(parts(|edge, _| edge.axes = [1, 1]), "there is no such edge");
            let outlined = |change: fn(&mut Vec<u8>)| {
                doctored(parallel, |certificates| {
                    match &mut certificates.proofs[HIDDEN as usize].1 {
                        Proof::Cover { outline, .. } => change(outline),
                        other => panic!("{other:?}"),
                    }
                })
            };
            let around = "its outline does not go round the box";
            assert_eq!(outlined(|outline| outline.reverse()), around);
            assert_eq!(outlined(|outline| outline.truncate(3)), around);
            assert_eq!(
                outlined(|outline| outline.clear()),
                "its outline is not one"
            );
            assert_eq!(
                outlined(|outline| outline.push(outline[0])),
                "its outline is not one"
            );
        }
        // Boxes one behind the other, whose corners are one line of sight.
        let line = doctored(true, |certificates| {
            certificates.proofs[HIDDEN as usize].1 = Proof::Cover {
                outline: vec![0, 1, 3],
                ties: false,
                cell: Cell::Empty,
            };
        });
        assert_eq!(line, "its outline does not go round the box");
    }

    #[test]
    fn of_twins_only_the_first_hides_the_other() {
        for parallel in [false, true] {
            let with = |item: ItemId, front: ItemId, allowed: bool| {
                let mut certificates = certified(parallel);
                let Proof::Cover {
                    outline,
                    ties,
                    cell,
                } = &mut certificates.proofs[HIDDEN as usize].1
                else {
                    panic!("the premise: hidden");
                };
                (*ties, *cell) = (allowed, Cell::Behind(front));
                assert_eq!(outline.len(), 4);
                certificates.proofs[HIDDEN as usize].0 = item;
                check(&certificates, &boxes())
            };
            assert_eq!(with(TWIN, HIDDEN, true).map(|counts| counts.tied), Ok(1));
            assert!(with(TWIN, HIDDEN, false).is_err());
            assert!(with(HIDDEN, TWIN, true).is_err());
            assert!(with(TWIN, TWIN, true).is_err());
        }
    }

    #[test]
    fn a_view_that_was_doctored_is_rejected() {
        for parallel in [false, true] {
            let near = doctored(parallel, |certificates| certificates.view.hides_from = 2.5);
            assert_eq!(near, "a box in front begins before the near plane");
            let wide = doctored(parallel, |certificates| {
                let item = &mut certificates.proofs[BACK as usize];
                item.1 = Proof::AroundEye;
            });
            assert_eq!(wide, "the eye is not in it");
            doctored(parallel, |certificates| certificates.view.near = f64::NAN);
            doctored(parallel, |certificates| certificates.boxes += 1);
            doctored(parallel, |certificates| certificates.proofs[0].0 = 77);
        }
    }
}
