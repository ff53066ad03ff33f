//! The textbook BSP tree: a plane of any orientation puts items in front of it and
//! behind it, and items that it cuts stay at its node. Planes are the map's own, if
//! the scene has a tree, else faces and diagonals of the items.

use super::{Division, Node, Textbook, TextbookParams};
use crate::geometry::{Aabb, Plane, PlaneTree};
use crate::index::Input;
use crate::index::build::bsp_split_planes::planes_of;
use crate::index::items::Record;

/// A BSP tree (Fuchs, Kedem and Naylor 1980, "On visible surface generation by a
/// priori tree structures"; lecture on visibility, slides "BSP trees" and "Region
/// search").
///
/// Region search takes the side of the plane that the point is on: O(log n) where planes
/// cut few items. A frustum is tested against the bounds of each node's items.
pub type BspTextbook = Textbook<DividingPlanes>;

/// Division of [`BspTextbook`].
pub struct DividingPlanes;

impl Division for DividingPlanes {
    const NAME: &str = "bsp-textbook";
    const SUMMARY: &str =
        "lecture form: the map's own planes or item faces, cut items at their plane";
    const BY_HALF_SPACES: bool = true;

    fn root(input: &Input<'_>, records: Vec<Record>, params: &TextbookParams) -> Node {
        let own = input.own_tree;
        let planes = Planes { own, params };
        planes.divided(&records, own.and_then(|own| own.root), 0)
    }
}

/// Items on the sides of a plane.
struct Sides {
    plane: Plane,
    /// Wholly in front, and wholly behind.
    of: [Vec<Record>; 2],
    cut: Vec<Record>,
}

/// In front of a plane (0), behind it (1), or cut by it. Touching is not cut: walls
/// that lie in a plane are on its sides.
fn side_of(plane: &Plane, b: &Aabb) -> Option<usize> {
    if plane.contains(b) {
        return Some(0);
    }
    (plane.value_at(plane.p_vertex(b)) <= 0.0).then_some(1)
}

impl Sides {
    fn of(plane: Plane, records: &[Record]) -> Sides {
        let (mut of, mut cut) = ([const { Vec::new() }; 2], Vec::new());
        for &record in records {
            match side_of(&plane, &record.bounds) {
                Some(side) => of[side].push(record),
                None => cut.push(record),
            }
        }
        Sides { plane, of, cut }
    }
}

/// Rank of a plane, best first.
///
/// First the items that its emptier side lacks to a quarter, then the items it cuts,
/// since every search of the node tests them.
fn demerit(plane: &Plane, records: &[Record]) -> (usize, usize) {
    let mut sides = [0, 0];
    for side in records.iter().filter_map(|r| side_of(plane, &r.bounds)) {
        sides[side] += 1;
    }
    let [front, back] = sides;
    let lacking = (records.len() / 4).saturating_sub(front.min(back));
    (lacking, records.len() - front - back)
}

/// Source of dividing planes.
struct Planes<'a> {
    own: Option<&'a PlaneTree>,
    params: &'a TextbookParams,
}

/// Boxes per node that offer planes, and items by which the planes are ranked.
const OFFER: usize = 4;
const JUDGES: usize = 512;

impl Planes<'_> {
    /// The division of some items, with the map's nodes in front and behind; `at` is
    /// the map's next node. Skips those of its planes with everything on one side.
    /// `None` if no candidate plane divides the items.
    fn sides(&self, records: &[Record], mut at: Option<u32>) -> Option<(Sides, [Option<u32>; 2])> {
        while let Some(own) = at.and_then(|at| self.own?.nodes.get(at as usize)) {
            let sides = Sides::of(own.plane, records);
            match sides.of.iter().position(|side| side.len() == records.len()) {
                Some(side) => at = own.children[side],
                None if sides.cut.len() == records.len() => break,
                None => return Some((sides, own.children)),
            }
        }
        let step = records.len().div_ceil(JUDGES);
        let judges: Vec<Record> = records.iter().step_by(step).copied().collect();
        let best = planes_of(records, OFFER).min_by_key(|plane| demerit(plane, &judges))?;
        let sides = Sides::of(best, records);
        let divides = sides.of.iter().all(|side| !side.is_empty());
        divides.then_some((sides, [None; 2]))
    }

    fn divided(&self, records: &[Record], at: Option<u32>, level: u32) -> Node {
        let bounds = Aabb::union_of(records.iter().map(|record| &record.bounds));
        let ends = self.params.ends_at(records.len(), level);
        let found = if ends { None } else { self.sides(records, at) };
        let Some((Sides { plane, of, cut }, own)) = found else {
            return Node::with(bounds, records);
        };
        let mut node = Node::with(bounds, &cut);
        let half_spaces = [plane, Plane::new(-plane.normal, -plane.d)];
        let sides = of.iter().zip(own).zip(half_spaces);
        node.children = sides
            .filter(|((records, _), _)| !records.is_empty())
            .map(|((records, at), half_space)| Node {
                half_space: Some(half_space),
                ..self.divided(records, at, level + 1)
            })
            .collect();
        node
    }
}
