//! What is hidden in a map by its plan: from an eye in its regions, every way to the item
//! crosses a wall that lets nothing through. Floors and ceilings are taken to close the
//! regions, as the map has it: a ray that leaves one by them sees nothing of it.

use std::cmp::Ordering;

use super::super::certificate::View;
use super::facts::Facts;
use super::line::{Exact, sign_of_difference};
use crate::query::ItemId;

type Point = [f64; 2];

/// How far an item is covered.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum Covers {
    /// No ray sees it.
    Everywhere,
    /// None but along upright lines, where it touches a wall that stands before it.
    ButAlongLines,
}

/// Twice the area of a triangle, above zero where it turns to the left.
fn area(a: Point, b: Point, c: Point) -> Exact {
    let less = |p: Point, k: usize| &Exact::from(p[k]) - &Exact::from(a[k]);
    (&(&less(b, 0) * &less(c, 1)) - &(&less(b, 1) * &less(c, 0))).compressed()
}

fn turn(a: Point, b: Point, c: Point) -> i32 {
    area(a, b, c).sign()
}

/// Whether a direction from the eye is between two that are less than half a turn apart,
/// or along one of them.
fn holds(eye: Point, [from, to]: [Point; 2], way: Point) -> bool {
    turn(eye, from, way) >= 0 && turn(eye, way, to) >= 0
}

/// That the walls, one after the other, stand between the eye and the item.
pub fn covers(
    view: &View,
    facts: &Facts,
    item: ItemId,
    walls: &[ItemId],
) -> Result<Covers, &'static str> {
    if view.parallel || facts.walls.is_empty() {
        return Err("the eye is in no region of a map");
    }
    let eye = [view.eye[0], view.eye[1]];
    // The item from above: a line, or a rectangle.
    let own = &facts.boxes[item as usize];
    let shape = match facts.wall(item) {
        Some(wall) => wall.ends.to_vec(),
        None => vec![
            [own.min.x, own.min.y],
            [own.max.x, own.min.y],
            [own.max.x, own.max.y],
            [own.min.x, own.max.y],
        ],
    };
    // Its outermost corners to the right and to the left of the eye's way to it.
    let outermost = |side: i32| {
        let is_last = |&&p: &&Point| shape.iter().all(|&q| turn(eye, p, q) * side <= 0);
        shape.iter().find(is_last).copied()
    };
    let (Some(first), Some(last)) = (outermost(-1), outermost(1)) else {
        return Err("the eye is in the item, from above");
    };
    let ends_of = |number: ItemId| {
        let wall = facts.wall(number).filter(|wall| wall.is_solid);
        let wall = wall.filter(|_| number != item);
        let [a, b] = wall.ok_or("what stands before it is no solid wall")?.ends;
        match turn(eye, a, b) {
            0 => Err("a wall before it is seen edge on"),
            turns => Ok(if turns > 0 { [a, b] } else { [b, a] }),
        }
    };
    let (mut way, mut result) = (first, Covers::Everywhere);
    for (place, &number) in walls.iter().enumerate() {
        let ends = ends_of(number)?;
        if !holds(eye, ends, way) {
            return Err("there is a gap between the walls before it");
        }
        let is_end = holds(eye, ends, last) && turn(eye, way, last) >= 0;
        let next = walls.get(place + 1);
        let next = next.map(|&number| ends_of(number)).transpose()?;
        let to = match next {
            None if is_end => last,
            None => return Err("the walls before it end before it does"),
            Some([from, _]) if turn(eye, way, from) > 0 && holds(eye, [way, ends[1]], from) => from,
            Some(_) => ends[1],
        };
        match nearer(eye, ends, &shape, [way, to]) {
            None => return Err("a wall is not before it throughout its part"),
            Some(Ordering::Less) => {}
            Some(_) => result = Covers::ButAlongLines,
        }
        way = to;
    }
    match walls.is_empty() {
        true => Err("there are no walls before it"),
        false => Ok(result),
    }
}

/// Whether all of a shape within two ways from the eye is behind a wall's line: `Less` if
/// it touches it nowhere, `Equal` if it does but is not all along it.
fn nearer(eye: Point, [a, b]: [Point; 2], shape: &[Point], ways: [Point; 2]) -> Option<Ordering> {
    // The eye is to the left of the wall from a to b: behind it is to the right.
    let mut signs: Vec<i32> = Vec::new();
    let inside = |p: Point| holds(eye, ways, p);
    signs.extend(shape.iter().filter(|p| inside(**p)).map(|p| turn(a, b, *p)));
    let edges = (0..shape.len()).map(|k| [shape[k], shape[(k + 1) % shape.len()]]);
    for [p, q] in edges {
        for way in ways {
            let (of_p, of_q) = (area(eye, way, p), area(eye, way, q));
            // Beyond the eye the same line goes the other way.
            let is_crossed = of_p.sign() * of_q.sign() < 0 && {
                let towards = turn(eye, p, q) * of_p.sign();
                towards < 0
            };
            if is_crossed {
                // Side of the wall's line where the way crosses the edge: a mean of that
                // of its ends, by how far they are from the way.
                let (side_p, side_q) = (area(a, b, p), area(a, b, q));
                let sign = sign_of_difference(&side_q, &of_p, &side_p, &of_q);
                signs.push(sign * (&of_p - &of_q).sign());
            }
        }
    }
    let most = signs.iter().max()?;
    match most {
        -1 => Some(Ordering::Less),
        0 if signs.contains(&-1) => Some(Ordering::Equal),
        _ => None,
    }
}
