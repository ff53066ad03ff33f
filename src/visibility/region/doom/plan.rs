//! Triangulation of the polygons of a map, seen from above.
//!
//! Whole numbers throughout, so that floors meet each other and the walls exactly.

/// Map coordinates.
pub type Point = [i32; 2];

/// Twice the area of a triangle, above zero where it turns to the left. Map
/// coordinates have 16 bits, so nothing overflows.
pub fn turn(a: Point, b: Point, c: Point) -> i64 {
    let minus = |p: Point| [0, 1].map(|k| i64::from(p[k]) - i64::from(a[k]));
    let ([x, y], [u, v]) = (minus(b), minus(c));
    x * v - y * u
}

/// Tests for a point in a closed triangle that turns right, other than its corners.
fn holds([a, b, c]: [Point; 3], p: Point) -> bool {
    p != a && p != b && p != c && turn(a, b, p) <= 0 && turn(b, c, p) <= 0 && turn(c, a, p) <= 0
}

/// Tests whether two segments cross in a point that is the end of neither.
fn cross([a, b]: [Point; 2], [c, d]: [Point; 2]) -> bool {
    turn(a, b, c).signum() * turn(a, b, d).signum() < 0
        && turn(c, d, a).signum() * turn(c, d, b).signum() < 0
}

/// The parts of an edge between those of some points that lie on it.
pub fn parted([from, to]: [Point; 2], points: &[Point]) -> Vec<[Point; 2]> {
    let away = |p: Point| [0, 1].map(|k| (p[k] - from[k]).abs()).iter().sum::<i32>();
    let within =
        |p: &Point| (0..2).all(|k| (from[k].min(to[k])..=from[k].max(to[k])).contains(&p[k]));
    let on = points
        .iter()
        .copied()
        .filter(|p| within(p) && turn(from, to, *p) == 0);
    let mut stops: Vec<Point> = on.chain([from, to]).collect();
    stops.sort_unstable_by_key(|&p| away(p));
    stops.dedup();
    stops.windows(2).map(|pair| [pair[0], pair[1]]).collect()
}

/// Cuts the polygons on the right of all edges into triangles that turn right.
///
/// Polygons may have holes. `None` where the edges do not close, cross, or one
/// has a corner of another between its ends.
///
/// A front advances from edge to edge: each triangle takes an edge and a corner that
/// it sees, and leaves less. O(n^2) for each of n triangles at worst, about O(n).
pub fn triangles(edges: &[[Point; 2]]) -> Option<Vec<[Point; 3]>> {
    let mut degrees: Vec<(Point, i32)> = Vec::new();
    for [from, to] in edges {
        degrees.extend([(*from, 1), (*to, -1)]);
    }
    degrees.sort_unstable();
    let closed = |run: &[(Point, i32)]| run.iter().map(|(_, one)| one).sum::<i32>() == 0;
    if !degrees.chunk_by(|a, b| a.0 == b.0).all(closed) {
        return None;
    }
    let mut front = edges.to_vec();
    let mut made = Vec::new();
    while let Some([a, b]) = front.pop() {
        let far = |c: Point| {
            let twice = [0, 1].map(|k| 2 * i64::from(c[k]) - i64::from(a[k]) - i64::from(b[k]));
            twice[0] * twice[0] + twice[1] * twice[1]
        };
        // Corners on the right, the nearest first; each is the end of some edge.
        let right = front.iter().map(|edge| edge[1]);
        let mut corners: Vec<Point> = right.filter(|&c| turn(a, b, c) < 0).collect();
        corners.sort_unstable_by_key(|&c| (far(c), c));
        corners.dedup();
        let sees = |&c: &Point| {
            front.iter().all(|&edge| {
                !holds([a, b, c], edge[1])
                    && !holds([a, b, c], edge[0])
                    && !cross(edge, [a, c])
                    && !cross(edge, [b, c])
            })
        };
        let c = corners.into_iter().find(sees)?;
        // A hole adds two to the triangles of its corners: beyond this, edges cross.
        if made.len() > 2 * edges.len() {
            return None;
        }
        made.push([a, b, c]);
        // What is beyond the new sides remains, unless they were sides already.
        for (side, back) in [([a, c], [c, a]), ([c, b], [b, c])] {
            match front.iter().position(|edge| *edge == back) {
                Some(place) => drop(front.swap_remove(place)),
                None => front.push(side),
            }
        }
    }
    Some(made)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn ring(corners: &[Point]) -> Vec<[Point; 2]> {
        let next = corners.iter().cycle().skip(1);
        corners.iter().zip(next).map(|(a, b)| [*a, *b]).collect()
    }

    /// Twice the area on the right of the edges.
    fn area(edges: &[[Point; 2]]) -> i64 {
        -edges.iter().map(|[a, b]| turn([0, 0], *a, *b)).sum::<i64>()
    }

    fn check(edges: &[[Point; 2]]) {
        let made = triangles(edges).unwrap();
        let all: i64 = made.iter().map(|&[a, b, c]| -turn(a, b, c)).sum();
        assert_eq!(all, area(edges));
        assert!(made.iter().all(|&[a, b, c]| turn(a, b, c) < 0));
        // None overlaps another: no sides cross, none holds another's middle.
        let sides = |[a, b, c]: [Point; 3]| [[a, b], [b, c], [c, a]];
        for (i, &one) in made.iter().enumerate() {
            for &other in &made[..i] {
                for side in sides(one) {
                    assert!(sides(other).iter().all(|&s| !cross(s, side)));
                }
                let six = |t: [Point; 3]| t.map(|p| p.map(|v| 3 * v));
                let middle = [0, 1].map(|k| other.iter().map(|p| p[k]).sum());
                assert!(!holds(six(one), middle));
            }
        }
    }

    #[test]
    fn polygons_with_holes_and_touching_corners_are_cut_up_whole() {
        check(&ring(&[[0, 0], [0, 4], [4, 4], [4, 0]]));
        // A comb.
        check(&ring(&[
            [0, 0],
            [0, 9],
            [2, 9],
            [2, 1],
            [4, 1],
            [4, 9],
            [6, 9],
            [6, 0],
        ]));
        // A hole, and in the hole another floor.
        let mut edges = ring(&[[0, 0], [0, 9], [9, 9], [9, 0]]);
        edges.extend(ring(&[[2, 2], [7, 2], [7, 7], [2, 7]]));
        check(&edges);
        edges.extend(ring(&[[4, 4], [4, 5], [5, 5], [5, 4]]));
        check(&edges);
        // Two squares that share a corner, and a hole that touches the outline.
        let mut edges = ring(&[[0, 0], [0, 4], [4, 4], [4, 0]]);
        edges.extend(ring(&[[4, 4], [4, 8], [8, 8], [8, 4]]));
        edges.extend(ring(&[[0, 0], [2, 1], [1, 2]]));
        check(&edges);
        // Corners in one line.
        check(&ring(&[[0, 0], [0, 2], [0, 4], [3, 4], [3, 0], [1, 0]]));
    }

    #[test]
    fn what_does_not_close_is_told() {
        let mut edges = ring(&[[0, 0], [0, 4], [4, 4], [4, 0]]);
        edges.pop();
        assert_eq!(triangles(&edges), None);
        // The wrong way round: nothing is on the right.
        let edges = ring(&[[0, 0], [4, 0], [4, 4], [0, 4]]);
        assert_eq!(triangles(&edges), None);
        assert_eq!(triangles(&[]), Some(Vec::new()));
        // Whatever the edges, it comes to an end.
        let mut rng = crate::scene::SeededRng::new(9);
        for _ in 0..300 {
            let corners = [(); 9].map(|()| [(); 2].map(|()| rng.below(6) as i32));
            let _ = triangles(&ring(&corners));
        }
    }
}
