//! Parts of the image: polygons of lines, which edges cut.

use super::super::certificate::View;
use super::line::{Line, Three, corner, cross, dot, holds};
use crate::scene::WorldBox;

/// A side of a part of the image.
#[derive(Clone)]
pub struct Side {
    /// What has no scalar product below zero with any line in the part.
    pub line: Three,
    /// Whether the lines along it are proven hidden with another part.
    pub open: bool,
}

/// A convex part of the image: corners, each with the side to the next.
pub struct Part {
    pub corners: Vec<(Line, Side)>,
}

/// Whether the image of a box, seen from outside it, is no more than a line.
pub fn has_no_area(view: &View, b: &WorldBox) -> bool {
    let all = [0, 1, 2, 3, 4, 5, 6, 7].map(|k: u8| Line::through(view, corner(b, k)).numbers);
    let outside = view.parallel || !holds(b, view.eye);
    let flat = |p: usize, q: usize, r: usize| dot(&cross(&all[p], &all[q]), &all[r]).sign() == 0;
    outside && (0..8).all(|p| (0..p).all(|q| (0..q).all(|r| flat(p, q, r))))
}

/// The image of a box with these corners round it.
pub fn image(view: &View, b: &WorldBox, outline: &[u8]) -> Result<Part, &'static str> {
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
    pub fn cut(&self, view: &View, by: &Side) -> Option<Part> {
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
    pub fn below(&self, form: impl Fn(&Line) -> i32) -> bool {
        let count = self.corners.len();
        let signs: Vec<i32> = self.corners.iter().map(|(line, _)| form(line)).collect();
        let spared = |side: usize, k: usize| k == side || k == (side + 1) % count;
        let but_for =
            |side: usize| (0..count).all(|k| signs[k] < 0 || signs[k] == 0 && spared(side, k));
        signs.iter().all(|&sign| sign < 0)
            || (0..count).any(|side| self.corners[side].1.open && but_for(side))
    }

    /// The way of all its lines along an axis; 0 if they differ or stand still.
    pub fn way(&self, axis: usize) -> i32 {
        let way = self.corners[0].0.way(axis);
        let same = self.corners.iter().all(|(line, _)| line.way(axis) == way);
        if same { way } else { 0 }
    }

    pub fn all(&self, holds: impl Fn(&Line) -> bool) -> bool {
        self.corners.iter().all(|(line, _)| holds(line))
    }
}
