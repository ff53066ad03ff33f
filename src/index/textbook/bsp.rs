//! The textbook BSP tree: a plane of any orientation puts items in front of it and
//! behind it, and those that it cuts stay at its node. Planes are the map's own, if
//! the scene brings a tree, else faces and diagonals of the items.

use std::ops::ControlFlow;

use glam::Vec3;

use super::{Items, Node, Slice, TextbookParams, memory_of, test_items};
use crate::geometry::{Aabb, Plane, PlaneTree};
use crate::index::partition::Record;
use crate::index::plane_choice::planes_of;
use crate::index::{BuildError, Info, Input, Kind, MemoryUsage, Origin, RegionIndex};
use crate::query::{Context, Predicate, QueryVolume, Recorder};

/// A BSP tree (Fuchs, Kedem and Naylor 1980, "On visible surface generation by a
/// priori tree structures"; lecture on visibility, slides "BSP trees" and "Region
/// search"). Region search takes the side of the plane that the point is on: O(log
/// n) where planes cut few items. A view is tested against the bounds of what lies
/// below a node.
pub struct BspTextbook {
    root: Option<Box<Split>>,
}

/// A plane with its two sides; a leaf has none.
struct Split {
    /// Exact union of all items from here on down.
    bounds: Aabb,
    plane: Option<Plane>,
    /// Those that the plane cuts; all of a leaf.
    items: Items,
    /// In front of the plane, and behind it.
    sides: [Option<Box<Split>>; 2],
}

/// What a plane makes of some items.
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

/// How badly a plane divides: first what its emptier side lacks to a quarter of the
/// items, then the items it cuts, since every search that comes by looks at them.
fn demerit(plane: &Plane, records: &[Record]) -> (usize, usize) {
    let mut sides = [0, 0];
    for side in records.iter().filter_map(|r| side_of(plane, &r.bounds)) {
        sides[side] += 1;
    }
    let [front, back] = sides;
    let lacking = (records.len() / 4).saturating_sub(front.min(back));
    (lacking, records.len() - front - back)
}

/// Where planes come from.
struct Planes<'a> {
    own: Option<&'a PlaneTree>,
    params: &'a TextbookParams,
}

/// Items that planes are taken from, and items that they are judged by, at a node.
const OFFER: usize = 4;
const JUDGES: usize = 512;

impl Planes<'_> {
    /// How some items are divided, and by which of the map's nodes in front and
    /// behind; `at` is the one that is next. Those of its planes with everything on
    /// one side are passed by. `None` if no plane that is looked at parts the items.
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
        let parts = sides.of.iter().all(|side| !side.is_empty());
        parts.then_some((sides, [None; 2]))
    }

    fn divided(&self, records: &[Record], at: Option<u32>, level: u32) -> Box<Split> {
        let bounds = Aabb::union_of(records.iter().map(|record| &record.bounds));
        let ends = self.params.ends_at(records.len(), level);
        let found = if ends { None } else { self.sides(records, at) };
        let Some((found, own)) = found else {
            return Box::new(Split {
                bounds,
                plane: None,
                items: Items::of(records),
                sides: [None, None],
            });
        };
        let side = |side: usize| {
            let records = &found.of[side];
            (!records.is_empty()).then(|| self.divided(records, own[side], level + 1))
        };
        Box::new(Split {
            bounds,
            plane: Some(found.plane),
            items: Items::of(&found.cut),
            sides: [side(0), side(1)],
        })
    }
}

impl Split {
    /// Region search. An item in front of a plane has no point behind it, by the
    /// very arithmetic that the point's side is decided by: it is monotone.
    fn search<C: Context>(&self, p: Vec3, cx: &mut C) -> ControlFlow<()> {
        cx.recorder().node_tested();
        test_items(self.items.all(), &p, p.mask(), cx)?;
        let Some(plane) = self.plane else {
            return ControlFlow::Continue(());
        };
        let value = plane.value_at(p);
        // On the plane, both; a NaN (coordinates beyond f32) is on neither.
        for (side, is_there) in self.sides.iter().zip([value >= 0.0, value <= 0.0]) {
            if let (Some(side), true) = (side, is_there) {
                side.search(p, cx)?;
            }
        }
        ControlFlow::Continue(())
    }
}

impl Node for &Split {
    #[inline]
    fn bounds(&self) -> Aabb {
        self.bounds
    }
    #[inline]
    fn items(&self) -> Slice<'_> {
        self.items.all()
    }
    #[inline]
    fn children(self) -> impl Iterator<Item = Self> {
        self.sides.iter().flatten().map(|side| &**side)
    }
}

impl BspTextbook {
    fn root(&self) -> Option<&Split> {
        self.root.as_deref()
    }
}

impl RegionIndex for BspTextbook {
    const INFO: Info = Info::new(
        "bsp-textbook",
        "lecture form: the map's own planes or item faces, cut items at their plane",
        Kind::Tree,
        Origin::Ours,
    )
    .textbook();
    type Params = TextbookParams;

    fn build(input: &Input<'_>, params: &TextbookParams) -> Result<Self, BuildError> {
        let Input {
            items,
            own_tree: own,
            ..
        } = *input;
        params.check(Self::INFO.name)?;
        let records = Record::all(items)?;
        let first = own.and_then(|own| own.root);
        let planes = Planes { own, params };
        let root = (!records.is_empty()).then(|| planes.divided(&records, first, 0));
        Ok(BspTextbook { root })
    }

    fn memory(&self) -> MemoryUsage {
        memory_of(self.root(), size_of::<Split>())
    }

    fn query<Q: QueryVolume, C: Context>(&self, volume: &Q, cx: &mut C) -> ControlFlow<()> {
        match (volume.as_point(), self.root()) {
            (Some(p), Some(root)) => root.search(p, cx),
            (_, root) => super::query(root, volume, cx),
        }
    }
}
