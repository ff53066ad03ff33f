//! Rays that see an item.

use super::super::certificate::View;
use super::facts::Facts;
use super::line::{Exact, Line, dot, exact, face, sign_of_difference};
use super::rough::{guess, roomy};
use super::triangle::sees;
use crate::query::ItemId;
use crate::scene::WorldBox;

/// A ray of the view that enters the item from near to far, and no other before it.
pub fn witness(
    view: &View,
    origin: [f64; 3],
    direction: [f64; 3],
    item: ItemId,
    facts: &Facts,
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
    if let Some(surfaces) = facts.surfaces {
        return sees(view, origin, direction, item, surfaces);
    }
    if facts.is_cut_out(item) {
        return Err("it has holes: its box does not show it");
    }
    let own = entry(view, origin, direction, &facts.boxes[item as usize]);
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
    match facts.boxes.iter().any(before) {
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
