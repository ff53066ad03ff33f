//! Doom maps as triangles: walls and things are the items of the scene.
//!
//! Floors and ceilings follow the items; they hide too. They are triangulated in plan view with
//! integers, so that they meet each other and the walls exactly.

use std::sync::Arc;

use glam::Vec3;

use super::super::graph::RegionId;
use super::DoomMap;
use crate::scene::{Dispute, Linedef, Scene, Shape, SurfaceKind, Surfaces};

/// Triangles of a scene's items, unless they are solid boxes.
///
/// Those of a map's floors and ceilings follow the items.
pub fn surfaces_of(scene: &Scene) -> Option<Arc<Surfaces>> {
    let of_map = || Some(Arc::new(DoomMap::of_scene(scene)?.surfaces(scene)));
    scene.surfaces.clone().or_else(of_map)
}

/// Part of a linedef's wall: the side that it faces, lower and upper height.
type WallPart = (usize, [f64; 2]);

impl DoomMap {
    /// Triangles of the map; `scene` must come from [`WadMap::into_scene`].
    ///
    /// Items are those of the scene, with the same ids: each linedef as its walls, visible from the
    /// side that they face, and each thing as its box. A two-sided linedef has a lower part where
    /// floors differ and an upper one where ceilings do; textures between them (fences, bars) are
    /// left open. Things are sprites and hide nothing. An item lies inside its box.
    ///
    /// After the scene's items follows one item for each sector, in file order: its floor, its
    /// ceiling, and, if it moves, the walls around it.
    ///
    /// Moving parts are open, as in [`DoomMap::graph`]. Walls that end at a moving floor or ceiling
    /// are visible where the file has them but hide nothing there (cut-outs); the part that hides
    /// at every position of the sector belongs to the sector's item. Such a sector has no floor and
    /// no ceiling. Only heights decide: a ceiling drawn as sky hides like any other.
    ///
    /// A sector whose linedefs do not close, or disagree about a place, has no floor and no ceiling
    /// either, which can only make more visible; [`DoomMap::unclosed`] lists these.
    ///
    /// # Panics
    /// If the scene has fewer items than the map has linedefs.
    ///
    /// [`WadMap::into_scene`]: crate::scene::WadMap::into_scene
    pub fn surfaces(&self, scene: &Scene) -> Surfaces {
        let things = &scene.items[self.file.lines.len()..];
        let mut all = Surfaces::about(scene.origin);
        let zero = scene.origin.as_vec3();
        let heights = |sector: RegionId| self.file.sectors[sector as usize].heights;
        for line in &self.file.lines {
            let mut shape = Shape::default();
            let has_length = line.ends[0] != line.ends[1];
            let moves = |sector: &RegionId| self.moves(*sector);
            let kind = match has_length && line.sectors.iter().flatten().any(moves) {
                true => SurfaceKind::CutOut,
                false => SurfaceKind::Opaque,
            };
            if has_length {
                parts(line, heights).for_each(|part| shape.wall(line, part));
            }
            shape.push(&mut all, kind, zero);
        }
        for thing in things {
            all.push_box(SurfaceKind::CutOut, thing);
        }
        for sector in 0..self.sectors.len() as RegionId {
            let mut shape = Shape::default();
            if self.moves(sector) {
                // Walls that hide at every position of the sector.
                for line in &self.lines {
                    let moving = line.sectors.iter().flatten().filter(|&&s| self.moves(s));
                    // Walls between two moving sectors belong to the lower number.
                    if moving.min() == Some(&sector) {
                        let open = |of: RegionId| self.sectors[of as usize];
                        parts(line, open).for_each(|part| shape.wall(line, part));
                    }
                }
            } else {
                let [floor, ceiling] = heights(sector);
                for corners in self.triangles(sector).unwrap_or_default() {
                    let [a, b, c] = corners;
                    shape.triangle([a, c, b], floor);
                    shape.triangle([a, b, c], ceiling);
                }
            }
            shape.push(&mut all, SurfaceKind::Opaque, zero);
        }
        all
    }

    /// Sectors without surfaces of floor and ceiling, ascending.
    ///
    /// Their linedefs do not determine where they are.
    pub fn unclosed(&self) -> Vec<RegionId> {
        let sectors = 0..self.sectors.len() as RegionId;
        sectors.filter(|&s| self.triangles(s).is_none()).collect()
    }

    /// Triangles of a sector in plan view.
    ///
    /// `None` if its linedefs do not close, or disagree with others about a part of it.
    pub(super) fn triangles(&self, sector: RegionId) -> Option<Vec<[Point; 3]>> {
        let is_of = |dispute: &Dispute| dispute.sectors.contains(&Some(sector));
        match self.file.disputes().iter().any(is_of) {
            true => None,
            false => triangles(&self.outline(sector)),
        }
    }

    /// Tests for a sector whose floor or ceiling may move.
    fn moves(&self, sector: RegionId) -> bool {
        let sector = sector as usize;
        self.sectors[sector] != self.file.sectors[sector].heights
    }

    /// Linedefs of a sector, split at each other's ends.
    fn outline(&self, sector: RegionId) -> Vec<[[i32; 2]; 2]> {
        let edges = &self.edges[sector as usize];
        let ends: Vec<Point> = edges.iter().map(|[from, _]| *from).collect();
        edges.iter().flat_map(|edge| split(*edge, &ends)).collect()
    }
}

/// Parts of a linedef's wall between sectors of these heights.
fn parts(line: &Linedef, range: impl Fn(RegionId) -> [f64; 2]) -> impl Iterator<Item = WallPart> {
    let parts = match line.sectors.map(|sector| sector.map(&range)) {
        [Some(a), Some(b)] => {
            // The lower part is visible from the side of the lower floor, the upper part from the
            // side of the higher ceiling.
            let lower = (usize::from(b[0] < a[0]), [a[0].min(b[0]), a[0].max(b[0])]);
            let upper = (usize::from(b[1] > a[1]), [a[1].min(b[1]), a[1].max(b[1])]);
            [Some(lower), Some(upper)]
        }
        [front, behind] => {
            let side = usize::from(front.is_none());
            [front.or(behind).map(|heights| (side, heights)), None]
        }
    };
    let parts = parts.into_iter().flatten();
    parts.filter(|(_, [low, high])| low < high)
}

/// Triangles of an item under construction, map coordinates.
///
/// Integers of 17 bits, exact in f32.
impl Shape {
    fn point(&mut self, [x, y]: [i32; 2], z: f64) -> u32 {
        self.points.push(Vec3::new(x as f32, y as f32, z as f32));
        self.points.len() as u32 - 1
    }

    fn wall(&mut self, line: &Linedef, (side, [low, high]): WallPart) {
        let [mut from, mut to] = line.ends;
        // Seen from its right side, a linedef runs to the right.
        if side == 1 {
            (from, to) = (to, from);
        }
        let corners = [(from, low), (to, low), (to, high), (from, high)];
        let [a, b, c, d] = corners.map(|(at, z)| self.point(at, z));
        self.triangles.extend([[a, b, c], [a, c, d]]);
    }

    fn triangle(&mut self, corners: [[i32; 2]; 3], z: f64) {
        let corners = corners.map(|at| self.point(at, z));
        self.triangles.push(corners);
    }

    fn push(mut self, all: &mut Surfaces, kind: SurfaceKind, zero: Vec3) {
        self.points.iter_mut().for_each(|p| *p -= zero);
        all.push(kind, false, &self.points, &self.triangles);
    }
}

/// Position in plan view, map coordinates.
pub type Point = [i32; 2];

/// Twice the signed area of a triangle, positive if it turns left.
///
/// Map coordinates have 16 bits, so nothing overflows.
pub fn turn(a: Point, b: Point, c: Point) -> i64 {
    let minus = |p: Point| [0, 1].map(|k| i64::from(p[k]) - i64::from(a[k]));
    let ([x, y], [u, v]) = (minus(b), minus(c));
    x * v - y * u
}

/// Tests for a point in a closed triangle that turns right, corners excluded.
fn holds([a, b, c]: [Point; 3], p: Point) -> bool {
    p != a && p != b && p != c && turn(a, b, p) <= 0 && turn(b, c, p) <= 0 && turn(c, a, p) <= 0
}

/// Tests whether two segments cross in a point that is an end of neither.
fn cross([a, b]: [Point; 2], [c, d]: [Point; 2]) -> bool {
    turn(a, b, c).signum() * turn(a, b, d).signum() < 0
        && turn(c, d, a).signum() * turn(c, d, b).signum() < 0
}

/// Splits an edge at all given points that lie on it.
pub fn split([from, to]: [Point; 2], points: &[Point]) -> Vec<[Point; 2]> {
    let away = |p: Point| [0, 1].map(|k| (p[k] - from[k]).abs()).iter().sum::<i32>();
    let within =
        |p: &Point| (0..2).all(|k| (from[k].min(to[k])..=from[k].max(to[k])).contains(&p[k]));
    let on = |p: &&Point| within(p) && turn(from, to, **p) == 0;
    let on = points.iter().filter(on).copied();
    let mut stops: Vec<Point> = on.chain([from, to]).collect();
    stops.sort_unstable_by_key(|&p| away(p));
    stops.dedup();
    stops.windows(2).map(|pair| [pair[0], pair[1]]).collect()
}

/// Triangulates the polygons on the right of all edges; triangles turn right.
///
/// Polygons may have holes. `None` if the edges do not close, cross, or a corner lies in the
/// interior of another edge.
///
/// An advancing front: each triangle takes an edge and a corner visible from it, and leaves a
/// smaller polygon. For each of n triangles O(n^2) at worst, usually about O(n).
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
        // A hole adds two triangles to those of its corners; more than this means that edges cross.
        if made.len() > 2 * edges.len() {
            return None;
        }
        made.push([a, b, c]);
        // The new sides bound the remaining polygon, unless they were sides already.
        for (side, back) in [([a, c], [c, a]), ([c, b], [b, c])] {
            match front.iter().position(|edge| *edge == back) {
                Some(index) => drop(front.swap_remove(index)),
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
        // Triangles do not overlap: no sides cross, and none contains another's centre.
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
        // A hole, and another floor inside the hole.
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
        // Collinear corners.
        check(&ring(&[[0, 0], [0, 2], [0, 4], [3, 4], [3, 0], [1, 0]]));
    }

    #[test]
    fn what_does_not_close_is_told() {
        let mut edges = ring(&[[0, 0], [0, 4], [4, 4], [4, 0]]);
        edges.pop();
        assert_eq!(triangles(&edges), None);
        // Wrong orientation: nothing is on the right.
        let edges = ring(&[[0, 0], [4, 0], [4, 4], [0, 4]]);
        assert_eq!(triangles(&edges), None);
        assert_eq!(triangles(&[]), Some(Vec::new()));
        // Terminates for any edges.
        let mut rng = crate::scene::SeededRng::new(9);
        for _ in 0..300 {
            let corners = [(); 9].map(|()| [(); 2].map(|()| rng.below(6) as i32));
            let _ = triangles(&ring(&corners));
        }
    }
}
