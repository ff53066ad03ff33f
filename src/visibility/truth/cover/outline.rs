//! The outline of a box as it is seen, found exactly.

use glam::DVec3;

use super::super::sight::Triple;
use crate::scene::WorldBox;

/// Corner k of a box: bit i says whether it is at the upper bound on axis i.
pub fn corners_of(b: &WorldBox) -> [[f64; 3]; 8] {
    [0, 1, 2, 3, 4, 5, 6, 7].map(|k: usize| {
        [0, 1, 2].map(|axis: usize| {
            if k >> axis & 1 == 1 {
                b.max[axis]
            } else {
                b.min[axis]
            }
        })
    })
}

/// The corners round the image of a box, anticlockwise; `None` if it has no area.
pub fn outline(corners: &[Triple; 8]) -> Option<Vec<u8>> {
    // From p to q: nothing is on the right, and what is on the line lies between.
    let follows = |p: usize, q: usize| {
        let mut area = false;
        let fits = (0..8).all(|c| {
            let turn = Triple::turn(&corners[p], &corners[q], &corners[c]);
            area |= turn > 0;
            turn > 0 || turn == 0 && between(&corners[p], &corners[c], &corners[q])
        });
        fits && area
    };
    // Corners in one place (flat boxes, one behind the other) count as the first.
    let same = |p: usize, q: usize| parallel(&corners[p], &corners[q]);
    let first: Vec<usize> = (0..8).filter(|&q| !(0..q).any(|p| same(p, q))).collect();
    let next = |p: usize| first.iter().copied().find(|&q| q != p && follows(p, q));
    let start = first.iter().copied().find(|&p| next(p).is_some())?;
    let mut round = vec![start as u8];
    let mut at = next(start)?;
    while at != start {
        round.push(at as u8);
        at = next(at).filter(|_| round.len() < 8)?;
    }
    (round.len() > 2).then_some(round)
}

/// Whether the whole image is one line or point.
pub fn is_flat(corners: &[Triple; 8]) -> bool {
    let flat =
        |p: usize, q: usize, r: usize| Triple::turn(&corners[p], &corners[q], &corners[r]) == 0;
    (0..8).all(|p| (0..p).all(|q| (0..q).all(|r| flat(p, q, r))))
}

/// Whether two lines of sight are the same one, near enough: only a guess is made
/// of it.
fn parallel(a: &Triple, b: &Triple) -> bool {
    let (a, b) = (DVec3::from(a.near), DVec3::from(b.near));
    a.cross(b).length() <= 1e-15 * a.length() * b.length() && a.dot(b) > 0.0
}

/// Whether c is between p and q, all three on a line of the image.
fn between(p: &Triple, c: &Triple, q: &Triple) -> bool {
    let [p, c, q] = [p, c, q].map(|line| DVec3::from(line.near).normalize());
    p.dot(c).min(c.dot(q)) >= p.dot(q) - 1e-12
}
