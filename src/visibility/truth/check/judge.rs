//! Covers: whether the parts of an item's image lie behind boxes.

use super::super::certificate::{Cell, Edge, Except, View};
use super::facts::Named;
use super::line::{Line, Three, exact, face};
use super::part::{Part, Side};
use crate::query::ItemId;
use crate::scene::WorldBox;

/// The cells of one item.
pub struct Judge<'c> {
    pub view: &'c View,
    pub named: &'c Named<'c>,
    pub own: &'c WorldBox,
    pub item: ItemId,
    /// What need not be ruled out.
    pub except: Except,
}

impl Judge<'_> {
    /// How many boxes hide the part.
    pub fn cell(&self, part: Option<&Part>, cell: &Cell) -> Result<usize, &'static str> {
        match (cell, part) {
            (Cell::Empty, None) => Ok(0),
            (_, None) => Err("a cell without rays claims something"),
            (Cell::Empty, Some(_)) => Err("a cell with rays is called empty"),
            (Cell::Behind(front), Some(part)) => {
                let hides = self.named.hider(*front)?;
                self.hidden(part, hides, *front < self.item).map(|()| 1)
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

    /// The line through the image where two planes meet: their form, whose three
    /// factors are what it is of the lines (1, 0, 0), (0, 1, 0) and (0, 0, 1).
    fn line(&self, edge: &Edge) -> Result<Three, &'static str> {
        let [i, j] = edge.axes.map(usize::from);
        if i >= j || j > 2 {
            return Err("there is no such edge");
        }
        let bound = |side: usize, axis: usize| {
            let b = self.named.get(edge.items[side])?;
            Some(if edge.upper[side] {
                b.max[axis]
            } else {
                b.min[axis]
            })
        };
        let (Some(at_i), Some(at_j)) = (bound(0, i), bound(1, j)) else {
            return Err("there is no box with that edge");
        };
        Ok([0, 1, 2].map(|k: usize| {
            let mut unit = [0.0; 3];
            unit[k] = 1.0;
            let line = Line::new(self.view, exact(unit));
            &(&line.gap(j, at_j) * &line.direction[i]) - &(&line.gap(i, at_i) * &line.direction[j])
        }))
    }

    /// All rays through the part enter `front`, not before boxes hide, and before they
    /// enter the item if they do, but for what is excepted. `lower`: it has a lower
    /// number than the item.
    fn hidden(&self, part: &Part, front: &WorldBox, lower: bool) -> Result<(), &'static str> {
        let back = self.own;
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
        let nearer = |form: &dyn Fn(&Line) -> i32| match self.except {
            Except::Nothing => part.below(form),
            Except::Ties | Except::Lines if lower => part.all(|line| form(line) <= 0),
            Except::Ties => part.below(form),
            // A form that is not zero at one corner is zero along a line at most.
            Except::Lines => part.all(|line| form(line) <= 0) && !part.all(|line| form(line) == 0),
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
