//! The textbook trees: how octree, quadtree, BSP tree and BVH divide items.

use glam::Vec3;
use obvhs::BvhBuildParams;
use obvhs::bvh2::Bvh2;
use obvhs::bvh2::node::Bvh2Node;

use super::{Division, Node, Textbook, TextbookParams};
use crate::geometry::{Aabb, Plane, PlaneTree};
use crate::index::build::cells::widest_axes;
use crate::index::items::Record;
use crate::index::{Input, ploc};

/// An octree as the lecture on visibility describes it.
///
/// Meagher 1982, "Geometric modeling using octree encoding"; slides "Visibility", "Region search".
/// O(log n + answers) per query if items are small against their cells.
///
/// An item that crosses the middle of a cell stays with the cell, however small it is, and every
/// query that reaches the cell tests it. Not so in [`Octree`](crate::index::Octree), whose items
/// all descend by their centres, nor in loose octrees (Ulrich 2000).
pub type OctreeTextbook = Textbook<Cells<3>>;

/// A quadtree over boxes as the lecture on visibility describes it.
///
/// Finkel and Bentley 1974, "Quad trees: a data structure for retrieval on composite keys"; slides
/// "Visibility", "Region search".
///
/// An item belongs to the smallest cell that contains it ([`OctreeTextbook`]). Cells are columns
/// through the whole scene, over the two axes in which it is widest, so nothing is culled by
/// height. O(log n + answers) per query if the scene is flat and items are small against their
/// cells.
pub type QuadtreeTextbook = Textbook<Cells<2>>;

/// Division of [`OctreeTextbook`] (three axes) and [`QuadtreeTextbook`] (two).
pub struct Cells<const AXES: usize>;

impl<const AXES: usize> Division for Cells<AXES> {
    const NAME: &str = match AXES {
        3 => "octree-textbook",
        _ => "quadtree-textbook",
    };
    const SUMMARY: &str = match AXES {
        3 => "lecture form: items at the smallest cell that holds them",
        _ => "lecture form: items at the smallest column that holds them",
    };

    fn root(input: &Input<'_>, records: Vec<Record>, params: &TextbookParams) -> Node {
        let scene = Aabb::union_of(input.items);
        let axes = widest_axes::<AXES>(&scene);
        divided(root_cell(&scene, &axes), &axes, records, params, 0)
    }
}

/// The cell of a whole scene: equally wide on each of the axes that are cut.
fn root_cell(scene: &Aabb, axes: &[usize]) -> Aabb {
    // Halved before subtracting and clamped: bounds may span the range of f32.
    let half = scene.half_extent();
    let widest = axes.iter().map(|&axis| half[axis]).fold(0.0, f32::max);
    let cube = Aabb::around(scene.centre(), Vec3::splat(widest));
    let mut cell = *scene;
    for &axis in axes {
        // Rounding may have moved a face of the cube into the scene.
        cell.min[axis] = cube.min[axis].min(scene.min[axis]).max(f32::MIN);
        cell.max[axis] = cube.max[axis].max(scene.max[axis]).min(f32::MAX);
    }
    cell
}

/// A cell with its items and subtrees, without empty children.
///
/// Bit `k` of a child's number is its side of the middle of `axes[k]`.
fn divided(
    bounds: Aabb,
    axes: &[usize],
    records: Vec<Record>,
    params: &TextbookParams,
    level: u32,
) -> Node {
    if params.ends_at(records.len(), level) {
        return Node::with(bounds, &records);
    }
    let cells = (0..1 << axes.len()).map(|child| part(&bounds, axes, child));
    let mut below: Vec<(Aabb, Vec<Record>)> = cells.map(|cell| (cell, Vec::new())).collect();
    let mut own = Vec::new();
    for record in records {
        // Closed bounds: an item on a shared face goes to the first of the cells.
        let mut cells = below.iter_mut();
        match cells.find(|(cell, _)| cell.contains(&record.bounds)) {
            Some((_, items)) => items.push(record),
            None => own.push(record),
        }
    }
    let mut node = Node::with(bounds, &own);
    let some = below.into_iter().filter(|(_, items)| !items.is_empty());
    let children = some.map(|(cell, items)| divided(cell, axes, items, params, level + 1));
    node.children = children.collect();
    node
}

/// An octant (quadrant) of a cell.
///
/// Its faces are the cell's or the middle, so parts meet exactly.
fn part(cell: &Aabb, axes: &[usize], child: usize) -> Aabb {
    let (mut part, middle) = (*cell, cell.centre());
    for (bit, &axis) in axes.iter().enumerate() {
        match child >> bit & 1 {
            0 => part.max[axis] = middle[axis],
            _ => part.min[axis] = middle[axis],
        }
    }
    part
}

/// A BSP tree as the lecture on visibility describes it.
///
/// Fuchs, Kedem and Naylor 1980, "On visible surface generation by a priori tree structures";
/// slides "BSP trees" and "Region search".
///
/// Region search descends to the point's side of each plane: O(log n) if planes cut few items. A
/// frustum is tested against the bounds of each node's items.
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

/// Items by their side of a plane.
struct Sides {
    plane: Plane,
    /// Wholly in front; wholly behind.
    of: [Vec<Record>; 2],
    cut: Vec<Record>,
}

/// Side of a box: in front of a plane (0), behind it (1), `None` if cut.
///
/// Touching is not cutting: a wall that lies in a plane is on one of its sides.
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

/// Rank of a plane, lower is better.
///
/// First the number of items by which its emptier side falls short of a quarter, then the number of
/// items it cuts, since every search of the node tests those.
fn demerit(plane: &Plane, records: &[Record]) -> (usize, usize) {
    let mut sides = [0, 0];
    for side in records.iter().filter_map(|r| side_of(plane, &r.bounds)) {
        sides[side] += 1;
    }
    let [front, back] = sides;
    let lacking = (records.len() / 4).saturating_sub(front.min(back));
    (lacking, records.len() - front - back)
}

/// Source of candidate planes.
struct Planes<'a> {
    own: Option<&'a PlaneTree>,
    params: &'a TextbookParams,
}

/// Boxes per node that supply candidate planes; items by which planes are ranked.
const OFFER: usize = 4;
const JUDGES: usize = 512;

/// Candidate planes: per box its faces and two diagonals through its centre.
///
/// Eight planes per box, from `boxes` of the boxes.
fn planes_of(records: &[Record], boxes: usize) -> impl Iterator<Item = Plane> {
    let step = records.len().div_ceil(boxes).max(1);
    records.iter().step_by(step).flat_map(|r| {
        let faces = Vec3::AXES.map(|n| [(n, r.bounds.min), (n, r.bounds.max)]);
        let diagonals = [Vec3::new(1.0, 1.0, 0.0), Vec3::new(1.0, -1.0, 0.0)];
        let diagonals = diagonals.map(|n| (n, r.bounds.centre()));
        let planes = [faces.as_flattened(), &diagonals].concat().into_iter();
        planes.map(|(normal, at)| Plane::through(at, normal))
    })
}

impl Planes<'_> {
    /// Divides items; returns the map's nodes in front and behind too.
    ///
    /// `at` is the map's next node. Skips the map's planes with all items on one side. `None` if no
    /// candidate plane divides the items.
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
        let sides = sides.filter(|((records, _), _)| !records.is_empty());
        let children = sides.map(|((records, at), half_space)| Node {
            half_space: Some(half_space),
            ..self.divided(records, at, level + 1)
        });
        node.children = children.collect();
        node
    }
}

/// A bounding volume hierarchy in plain recursive form.
///
/// Clark 1976, "Hierarchical geometric models for visible surface algorithms"; built bottom-up by
/// the crate obvhs (PLOC, Meister and Bittner 2018). O(log n + answers) per query.
///
/// The lecture on visibility does not name it; engines use it instead of the lecture's trees.
pub type BvhTextbook = Textbook<ObvhsNodes>;

/// Division of [`BvhTextbook`].
pub struct ObvhsNodes;

impl Division for ObvhsNodes {
    const NAME: &str = "bvh-textbook";
    const SUMMARY: &str = "lecture form: the nodes of crate obvhs, one at a time";

    fn root(input: &Input<'_>, mut records: Vec<Record>, params: &TextbookParams) -> Node {
        // Items with identical bounds are one primitive for the builder: its nearest-neighbour
        // search fails among them.
        let key = |r: &Record| r.bounds.bits();
        records.sort_unstable_by_key(|r| (key(r), r.id));
        let stacks: Vec<&[Record]> = records.chunk_by(|a, b| key(a) == key(b)).collect();
        // Scaled to unit size: the builder compares areas, which must not overflow.
        let reach = Aabb::union_of(input.items).reach().max_element();
        let scale = reach.recip().min(f32::MAX);
        let boxes = stacks.iter().map(|stack| stack[0].bounds.scaled(scale));
        let config = BvhBuildParams {
            max_prims_per_leaf: params.leaf.min(255),
            ..BvhBuildParams::medium_build()
        };
        let built = ploc::build(&boxes.collect::<Vec<_>>(), config);
        subtree(&built, built.nodes[0], params.depth, &stacks)
    }
}

/// A node of obvhs with the exact bounds of its items, which the builder rounds.
///
/// At the depth limit it keeps the items of all leaves below: the builder's trees may be deeper.
fn subtree(built: &Bvh2, node: Bvh2Node, levels: u32, stacks: &[&[Record]]) -> Node {
    let children = |node: &Bvh2Node| {
        let first = node.first_index as usize;
        [built.nodes[first], built.nodes[first + 1]]
    };
    if levels > 0 && !node.is_leaf() {
        let below = children(&node).map(|child| subtree(built, child, levels - 1, stacks));
        let mut inner = Node::with(below[0].bounds.union(&below[1].bounds), &[]);
        inner.children = below.into();
        return inner;
    }
    let (mut records, mut open) = (Vec::new(), vec![node]);
    while let Some(node) = open.pop() {
        let (first, count) = (node.first_index as usize, node.prim_count as usize);
        match node.is_leaf() {
            true => {
                for &stack in &built.primitive_indices[first..first + count] {
                    records.extend_from_slice(stacks[stack as usize]);
                }
            }
            false => open.extend(children(&node)),
        }
    }
    let bounds = Aabb::union_of(records.iter().map(|record| &record.bounds));
    Node::with(bounds, &records)
}
