//! Whether one box hides another from all lines of sight in a polygon: decided at the
//! polygon's corners, since all that is asked is convex or linear.

use super::super::sight::{Polygon, Sight, Triple, sign};
use crate::scene::WorldBox;

/// How much nearer a box must be than the one that it hides.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum Nearer {
    Everywhere,
    /// It may be as near.
    OrTied,
    /// It may be as near along lines of the image, or in points.
    ButAlongLines,
}

/// Whether all rays through the polygon enter `front` from where boxes hide on,
/// and before they enter `back`, if they do, but for what is excepted.
pub fn hides(
    sight: &Sight,
    front: &WorldBox,
    back: &WorldBox,
    image: &Polygon,
    nearer: Nearer,
) -> bool {
    let corners = &image.corners[..];
    // Rays that pierce a convex box are a convex set: the corners are enough.
    if !corners.iter().all(|line| pierces(sight, line, front)) {
        return false;
    }
    // The way of all rays along each axis, 0 where they differ.
    let ways = [0, 1, 2].map(|axis: usize| {
        let way = sign(sight.slope(&corners[0], axis));
        let same = corners
            .iter()
            .all(|line| sign(sight.slope(line, axis)) == way);
        if same { way } else { 0 }
    });
    let entry = |b: &WorldBox, axis: usize, way: i32| {
        (axis, if way > 0 { b.min[axis] } else { b.max[axis] })
    };
    // Entered last through the plane of any one axis: not before that plane.
    let visible = |axis: usize| {
        let plane = entry(front, axis, ways[axis]);
        let reached = |line: &Triple| sight.hides_from(line, plane, ways[axis]);
        ways[axis] != 0 && corners.iter().all(reached)
    };
    if !(0..3).any(visible) {
        return false;
    }
    (0..3).any(|axis| {
        // `back` is not entered before its plane across this axis ..
        let way = match sight.view.parallel {
            true => ways[axis],
            false => side_of(sight.view.eye[axis], back, axis),
        };
        if way == 0 {
            return false;
        }
        let behind = entry(back, axis, way);
        // .. and `front` is entered before it, through whichever plane.
        (0..3).all(|k| {
            let free = match sight.view.parallel {
                true => sight.view.forward[k] == 0.0,
                false => side_of(sight.view.eye[k], front, k) == 0,
            };
            let before =
                |line: &Triple| sight.order(line, entry(front, k, ways[k]), behind) * ways[k] * way;
            let at_most = || corners.iter().all(|line| before(line) <= 0);
            let always = || match nearer {
                Nearer::Everywhere => image.below_zero(before),
                Nearer::OrTied => at_most(),
                // A form is zero on all of a polygon or along a line of it.
                Nearer::ButAlongLines => at_most() && corners.iter().any(|line| before(line) < 0),
            };
            free || ways[k] != 0 && always()
        })
    })
}

/// On which side of a point the box lies along an axis: 1 is above it, 0 at it.
pub fn side_of(at: f64, b: &WorldBox, axis: usize) -> i32 {
    i32::from(b.min[axis] > at) - i32::from(b.max[axis] < at)
}

/// Whether the whole line meets the closed box.
pub fn pierces(sight: &Sight, line: &Triple, b: &WorldBox) -> bool {
    let ways = [0, 1, 2].map(|axis: usize| sign(sight.slope(line, axis)));
    let ends = |axis: usize| {
        let (low, high) = ((axis, b.min[axis]), (axis, b.max[axis]));
        if ways[axis] < 0 {
            (high, low)
        } else {
            (low, high)
        }
    };
    (0..3).all(|axis| {
        let (from, to) = ends(axis);
        if ways[axis] == 0 {
            return sight.gap_sign(line, from) <= 0 && sight.gap_sign(line, to) >= 0;
        }
        (0..3).all(|other| {
            let leaves = ends(other).1;
            ways[other] == 0
                || other == axis
                || sight.order(line, from, leaves) * ways[axis] * ways[other] <= 0
        })
    })
}
