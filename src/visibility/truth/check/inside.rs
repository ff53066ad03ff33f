//! Whether a box is inside a closed surface, exactly: no triangle of the surface enters
//! it, every edge is gone along both ways, and the surface winds round a point of it.

use std::collections::BTreeMap;

use super::line::{Exact, Three, cross, dot};
use crate::scene::{Surfaces, WorldBox};

/// Triangles that share corners, as indices into the points of all.
type Piece = Vec<[u32; 3]>;

/// Whether the open box is inside one closed piece of the item, and the item within its
/// own box. O(t log t), and exact arithmetic only for the triangles about the box.
pub fn is_inside(surfaces: &Surfaces, item: usize, own: &WorldBox, b: &WorldBox) -> bool {
    let range = surfaces.of_item[item].clone();
    let triangles = &surfaces.triangles[range.start as usize..range.end as usize];
    let held = |corner: &u32| {
        let place = place(surfaces, *corner);
        let beyond = |bound: f64, k: usize| (&place[k] - &Exact::from(bound)).sign();
        (0..3).all(|k| beyond(own.min[k], k) >= 0 && beyond(own.max[k], k) <= 0)
    };
    triangles.iter().flatten().all(held)
        && pieces(triangles).iter().any(|piece| {
            is_closed(piece)
                && piece.iter().all(|corners| is_apart(surfaces, corners, b))
                && winds_round(surfaces, piece, b)
        })
}

/// A corner in the world.
fn place(surfaces: &Surfaces, corner: u32) -> Three {
    let local = surfaces.points[corner as usize];
    [0, 1, 2].map(|k: usize| &Exact::from(surfaces.origin[k]) + &Exact::from(f64::from(local[k])))
}

/// The triangles by what they hang together by.
fn pieces(triangles: &[[u32; 3]]) -> Vec<Piece> {
    // Each corner's piece is that of the corner that it points to, down to the root.
    let mut points_to: BTreeMap<u32, u32> = BTreeMap::new();
    fn root(points_to: &BTreeMap<u32, u32>, mut corner: u32) -> u32 {
        while let Some(&next) = points_to.get(&corner) {
            corner = next;
        }
        corner
    }
    for [a, b, c] in triangles {
        for other in [b, c] {
            let [low, high] = {
                let (p, q) = (root(&points_to, *a), root(&points_to, *other));
                [p.min(q), p.max(q)]
            };
            if low != high {
                points_to.insert(high, low);
            }
            // Short ways for those that are asked again.
            for corner in [*a, *other] {
                if corner != low {
                    points_to.insert(corner, low);
                }
            }
        }
    }
    let mut by_root: BTreeMap<u32, Piece> = BTreeMap::new();
    for corners in triangles {
        let piece = root(&points_to, corners[0]);
        by_root.entry(piece).or_default().push(*corners);
    }
    by_root.into_values().collect()
}

/// Whether each edge is gone along as often one way as the other.
fn is_closed(piece: &Piece) -> bool {
    let mut ways: BTreeMap<[u32; 2], i64> = BTreeMap::new();
    for [a, b, c] in piece {
        for (from, to) in [(a, b), (b, c), (c, a)] {
            let way = if from < to { 1 } else { -1 };
            *ways.entry([*from.min(to), *from.max(to)]).or_default() += way;
        }
    }
    ways.values().all(|sum| *sum == 0)
}

/// Whether a triangle has no point in the open box: some direction, of the thirteen that
/// can, has the one on one side of a plane and the other on its other side.
fn is_apart(surfaces: &Surfaces, corners: &[u32; 3], b: &WorldBox) -> bool {
    let near = corners.map(|corner| surfaces.origin + surfaces.points[corner as usize].as_dvec3());
    // A rounded sum is not beyond a bound unless the sum is.
    let is_beyond =
        |k: usize| near.iter().all(|p| p[k] > b.max[k]) || near.iter().all(|p| p[k] < b.min[k]);
    if (0..3).any(is_beyond) {
        return true;
    }
    let places = corners.map(|corner| place(surfaces, corner));
    let edges = [0, 1, 2].map(|k: usize| minus(&places[(k + 1) % 3], &places[k]));
    let axis = |k: usize| [0, 1, 2].map(|i: usize| Exact::from(f64::from(u8::from(i == k))));
    let mut directions: Vec<Three> = (0..3).map(axis).collect();
    directions.push(cross(&edges[0], &edges[1]));
    directions.extend((0..9).map(|k| cross(&edges[k / 3], &axis(k % 3))));
    directions.iter().any(|direction| {
        let along = |of_box: bool, most: bool| {
            let sums: Vec<Exact> = match of_box {
                false => places.iter().map(|p| dot(p, direction)).collect(),
                true => {
                    let end = [0, 1, 2].map(|k: usize| {
                        let upper = (direction[k].sign() > 0) == most;
                        Exact::from(if upper { b.max[k] } else { b.min[k] })
                    });
                    vec![dot(&end, direction)]
                }
            };
            let later = |a: Exact, b: Exact| if ((&a - &b).sign() > 0) == most { a } else { b };
            sums.into_iter().reduce(later).expect("a corner")
        };
        let is_none = direction.iter().all(|x| x.sign() == 0);
        let behind = |first: Exact, second: Exact| (&first - &second).sign() <= 0;
        !is_none
            && (behind(along(false, true), along(true, false))
                || behind(along(true, true), along(false, false)))
    })
}

fn minus(a: &Three, b: &Three) -> Three {
    [0, 1, 2].map(|k: usize| &a[k] - &b[k])
}

/// Whether a closed piece winds round the points of a box that it does not enter:
/// triangles passed upward from one of them, those left through count one, those
/// entered through one less.
fn winds_round(surfaces: &Surfaces, piece: &Piece, b: &WorldBox) -> bool {
    // Where the way up meets an edge nothing is said; another point then does.
    let shares = [[0.37, 0.59], [0.71, 0.23], [0.13, 0.83], [0.91, 0.47]];
    shares.iter().any(|share| {
        let within = |k: usize, share: f64| b.min[k] + (b.max[k] - b.min[k]) * share;
        let from = [within(0, share[0]), within(1, share[1]), within(2, 0.5)];
        let is_in = (0..3).all(|k| b.min[k] < from[k] && from[k] < b.max[k]);
        is_in && turns(surfaces, piece, from).is_some_and(|turns| turns > 0)
    })
}

fn turns(surfaces: &Surfaces, piece: &Piece, from: [f64; 3]) -> Option<i64> {
    let mut turns = 0;
    for corners in piece {
        let near =
            corners.map(|corner| surfaces.origin + surfaces.points[corner as usize].as_dvec3());
        let is_aside = (0..2)
            .any(|k| near.iter().all(|p| p[k] > from[k]) || near.iter().all(|p| p[k] < from[k]));
        if is_aside {
            continue;
        }
        let from = from.map(Exact::from);
        let [a, b, c] = corners.map(|corner| minus(&place(surfaces, corner), &from));
        // Twice the areas of the corners with the way up, seen along it.
        let side = |p: &Three, q: &Three| (&(&p[0] * &q[1]) - &(&p[1] * &q[0])).sign();
        let sides = [side(&a, &b), side(&b, &c), side(&c, &a)];
        if sides.contains(&1) && sides.contains(&-1) {
            continue;
        }
        // Above the point is where its plane's height there is above zero: the volume
        // of the three corners over their area.
        let volume = dot(&a, &cross(&b, &c)).sign();
        if sides.contains(&0) || volume == 0 {
            return None;
        }
        // From below, a triangle that turns to the left is left through.
        if volume == sides[0] {
            turns += i64::from(sides[0]);
        }
    }
    Some(turns)
}
