//! The BSP tree: planes of any orientation divide the items, and region search
//! descends by the planes alone. Includes the import of a map's own tree;
//! `bsp_split_planes` has the choice of planes.

use std::ops::ControlFlow;

use glam::Vec3;
use serde::{Deserialize, Serialize};

use super::bsp_split_planes::{
    between_layers, by_own_planes, by_principal_axis, by_surface_area, divide,
};
use crate::geometry::{Plane, PlaneTree};
use crate::index::items::Record;
use crate::index::tree::kd_treelets::{DESCENT_LEAF, Treelets};
use crate::index::tree::node::Stack;
use crate::index::tree::{Descent, PackedTree, Part, Splitter, Tree, TreeBuilder, build_top_down};
use crate::index::{BuildError, Info, Input, Kind, Origin, check_range};
use crate::kernel::Isa;
use crate::query::{ManySink, Predicate, Recorder, Sink};

/// A binary space partition (Fuchs, Kedem and Naylor 1980, "On visible surface
/// generation by a priori tree structures").
///
/// An item that a plane cuts is neither split nor stored twice: it goes to the
/// side of its centre, and the node keeps how far each side reaches across the
/// plane (two offsets, as in a bounding interval hierarchy, Waechter and Keller
/// 2006, but for planes of any direction). A point takes both sides where the
/// sides overlap.
pub type Bsp = Tree<BspBuilder>;

/// Builder of [`Bsp`].
pub struct BspBuilder;

/// Planes by which region search descends.
pub enum Planes {
    /// Planes of any direction, one per node; unused for leaves.
    Any(Vec<Split>),
    /// Axis-parallel planes.
    Axes(Treelets),
}

/// The direction of a node's plane and how far its two sides reach along it.
#[derive(Clone, Copy, Default, Debug)]
pub struct Split {
    normal: Vec3,
    /// Nothing on the back side reaches farther than this along the normal.
    back_high: f32,
    /// Nothing on the front side reaches back beyond this.
    front_low: f32,
}

impl Split {
    /// Position along the normal, by the plane test's own arithmetic: being
    /// monotone, it never puts a point of an item beyond the item's corner.
    #[inline(always)]
    fn along(&self) -> Plane {
        Plane::new(self.normal, 0.0)
    }
}

/// Source of the dividing planes.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
#[non_exhaustive]
pub enum PlaneSource {
    /// `import` if the scene has its own tree, else `median`.
    Auto,
    /// Axis-parallel planes by the surface area heuristic, 16 bins (Wald 2007,
    /// "On fast construction of SAH-based bounding volume hierarchies").
    Sah,
    /// The median of the centres along the widest axis: perfectly balanced.
    Median,
    /// The median across the direction of largest spread (principal axis of
    /// the centres): planes of any orientation.
    Oblique,
    /// Auto-partition: of the planes that the items' faces and diagonals offer,
    /// the one that balances best for the fewest cut items.
    Faces,
    /// The map's own tree (a Doom WAD has one); items that its branches leave
    /// together are divided by `sah`.
    Import,
}

/// Parameters: `bsp:builder=faces,leaf=32,cut=2`.
#[derive(Clone, Copy, Debug, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct BspParams {
    /// Source of the dividing planes.
    pub builder: PlaneSource,
    /// Most items of a leaf (1 to 4096).
    pub leaf: u32,
    /// For `faces`: how many items of imbalance one cut item counts as (0 to
    /// 1000).
    pub cut: f32,
}

impl Default for BspParams {
    fn default() -> Self {
        BspParams {
            builder: PlaneSource::Auto,
            leaf: 32,
            cut: 1.0,
        }
    }
}

impl BspParams {
    /// The builder in effect, with the scene's own tree if it uses that.
    fn chosen<'a>(
        &self,
        own_tree: Option<&'a PlaneTree>,
    ) -> Result<(PlaneSource, Option<&'a PlaneTree>), BuildError> {
        Ok(match self.builder {
            PlaneSource::Auto => match own_tree.filter(|own| own.root.is_some()) {
                Some(own) => (PlaneSource::Import, Some(own)),
                None => (PlaneSource::Median, None),
            },
            PlaneSource::Import if own_tree.is_none() => {
                return Err(BuildError::Params {
                    structure: BspBuilder::INFO.name,
                    reason: "builder=import, but the scene has no tree of its own".to_owned(),
                });
            }
            PlaneSource::Import => (PlaneSource::Import, own_tree),
            builder => (builder, None),
        })
    }
}

struct PlaneSplitter<'a> {
    source: PlaneSource,
    cut: f32,
    imported: Option<&'a PlaneTree>,
    splits: Vec<Split>,
    /// Number of items before the plane, for each division within a leaf of more
    /// than [`DESCENT_LEAF`] items.
    cuts: Vec<u32>,
}

/// The imported node to divide a group by.
type ImportedNode = Option<u32>;

impl Splitter for PlaneSplitter<'_> {
    type Cell = ImportedNode;

    fn split(
        &mut self,
        records: &mut [Record],
        mut at: ImportedNode,
        node: usize,
        parts: &mut Vec<Part<ImportedNode>>,
    ) {
        let count = records.len();
        // Skips imported planes with everything on one side.
        let imported = loop {
            let Some(imported) = at.and_then(|at| self.imported?.nodes.get(at as usize)) else {
                break None;
            };
            let back = divide(records, |r| {
                !imported.plane.contains_point(r.bounds.centre())
            });
            let [front_child, back_child] = imported.children;
            match back {
                0 => at = front_child,
                all if all == count => at = back_child,
                _ => break Some((imported.plane.normal, back, [back_child, front_child])),
            }
        };
        let (normal, back, cells) = imported.unwrap_or_else(|| {
            let chosen = match self.source {
                PlaneSource::Sah | PlaneSource::Import => by_surface_area(records),
                PlaneSource::Auto | PlaneSource::Median => None,
                PlaneSource::Oblique => by_principal_axis(records),
                PlaneSource::Faces => by_own_planes(records, self.cut),
            };
            let divides = |&(_, back): &(Vec3, usize)| (1..count).contains(&back);
            let (normal, back) = chosen
                .filter(divides)
                .unwrap_or_else(|| between_layers(records));
            (normal, back, [None; 2])
        });
        if self.splits.len() <= node {
            self.splits.resize(node + 1, Split::default());
        }
        self.splits[node].normal = normal;
        let halves = [back, count - back].into_iter().zip(cells.map(Some));
        parts.extend(halves.map(|(items, cell)| Part { items, cell }));
    }

    fn arrange(&mut self, records: &mut [Record]) {
        if self.source != PlaneSource::Median || records.len() <= DESCENT_LEAF {
            return;
        }
        let (_, back) = between_layers(records);
        self.cuts.push(back as u32);
        let (back, front) = records.split_at_mut(back);
        self.arrange(back);
        self.arrange(front);
    }
}

/// Computes how far the two sides of a node reach along its normal, from the bounds
/// of its children.
fn measure_reach(splits: &mut [Split], tree: &PackedTree, node: usize) {
    if tree.is_leaf(node) {
        return;
    }
    let back = &tree.nodes()[node + 1];
    let front = &tree.nodes()[back.after()];
    let split = &mut splits[node];
    let along = split.along();
    split.back_high = along.value_at(along.p_vertex(&back.bounds));
    split.front_low = along.value_at(along.n_vertex(&front.bounds));
}

impl Descent for Planes {
    fn bytes(&self) -> usize {
        match self {
            Planes::Any(splits) => size_of_val(&splits[..]),
            Planes::Axes(treelets) => treelets.bytes(),
        }
    }

    fn refit(&mut self, tree: &PackedTree, node: usize) {
        match self {
            Planes::Any(splits) => measure_reach(splits, tree, node),
            Planes::Axes(treelets) => treelets.fit(tree, node),
        }
    }

    /// One dot product per node.
    #[inline(always)]
    fn locate<I: Isa, S: Sink, R: Recorder>(
        &self,
        isa: I,
        tree: &PackedTree,
        p: Vec3,
        sink: &mut S,
        recorder: &mut R,
    ) -> ControlFlow<()> {
        let splits = match self {
            Planes::Any(splits) => splits,
            Planes::Axes(treelets) => return treelets.locate(isa, tree, p, sink, recorder),
        };
        let nodes = tree.nodes();
        let mut open = Stack::new((0, ()));
        while let Some((at, ())) = open.pop() {
            let mut at = at as usize;
            // An empty tree has no node 0.
            while let Some(node) = nodes.get(at) {
                recorder.nodes_tested(1);
                if tree.is_leaf(at) {
                    tree.test_items(isa, node.items(), (&p, p.mask()), sink, recorder)?;
                    break;
                }
                let split = &splits[at];
                let value = split.along().value_at(p);
                let front = nodes[at + 1].after();
                // Not `<=`: a NaN (coordinates beyond f32) enters both sides.
                let beyond_back = value > split.back_high;
                let before_front = value < split.front_low;
                at = match (beyond_back, before_front) {
                    (true, true) => break,
                    (true, false) => front,
                    (false, true) => at + 1,
                    (false, false) => {
                        open.push((front as u32, ()));
                        at + 1
                    }
                };
            }
        }
        ControlFlow::Continue(())
    }

    #[inline(always)]
    fn locate_many<I: Isa, S: ManySink>(
        &self,
        isa: I,
        tree: &PackedTree,
        points: &[Vec3],
        sink: &mut S,
    ) -> ControlFlow<()> {
        match self {
            Planes::Any(_) => tree.query_many(isa, points, sink),
            Planes::Axes(treelets) => treelets.query_many(tree, points, sink),
        }
    }
}

impl TreeBuilder for BspBuilder {
    const INFO: Info = Info::new(
        "bsp",
        "binary space partition by planes of any orientation; region search by plane descent",
        Kind::Tree,
        Origin::Ours,
    );
    type Params = BspParams;
    type Descent = Planes;

    fn build(input: &Input<'_>, params: &BspParams) -> Result<(PackedTree, Planes), BuildError> {
        check_range(Self::INFO.name, "leaf", params.leaf.into(), 1.0, 4096.0)?;
        check_range(Self::INFO.name, "cut", params.cut.into(), 0.0, 1000.0)?;
        let (source, imported) = params.chosen(input.own_tree)?;
        let mut splitter = PlaneSplitter {
            source,
            cut: params.cut,
            imported,
            splits: Vec::new(),
            cuts: Vec::new(),
        };
        let root = imported.and_then(|planes| planes.root);
        let records = Record::all(input.items)?;
        let tree = build_top_down(records, params.leaf as usize, root, &mut splitter);
        if source == PlaneSource::Median {
            let treelets = Treelets::over(&tree, splitter.cuts);
            return Ok((tree, Planes::Axes(treelets)));
        }
        let mut splits = splitter.splits;
        splits.resize(tree.nodes().len(), Split::default());
        splits.shrink_to_fit();
        for node in 0..splits.len() {
            measure_reach(&mut splits, &tree, node);
        }
        Ok((tree, Planes::Any(splits)))
    }
}
