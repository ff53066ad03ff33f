//! The BSP tree: planes of any orientation divide the items, and region search
//! goes down by the planes alone. It owns the import of a map's own tree; which
//! planes the builders choose is `plane_choice`'s.

use std::ops::ControlFlow;

use glam::Vec3;
use serde::{Deserialize, Serialize};

use super::batch;
use super::partition::{Part, Record, Splitter, build_top_down};
use super::plane_choice::{
    between_layers, by_own_planes, by_principal_axis, by_surface_area, divide,
};
use super::stack::Stack;
use super::tree::PackedTree;
use super::treelets::{DESCENT_LEAF, Treelets};
use super::{
    BuildError, Info, Input, Kind, MemoryUsage, Origin, RegionIndex, check_range, indexable,
};
use crate::geometry::{Aabb, Plane, PlaneTree};
use crate::kernel::Isa;
use crate::query::{Context, ItemId, ManySink, Predicate, QueryVolume, Recorder, Sink};

/// A binary space partition (Fuchs, Kedem and Naylor 1980, "On visible surface
/// generation by a priori tree structures").
///
/// An item that a plane cuts is neither split nor stored twice: it goes to the
/// side of its centre, and the node keeps how far each side reaches across the
/// plane (two offsets, as in a bounding interval hierarchy, Waechter and Keller
/// 2006, but for planes of any direction). A point takes both sides where the
/// sides overlap.
pub struct Bsp {
    tree: PackedTree,
    planes: Planes,
}

/// What region search goes down by.
enum Planes {
    /// Of any direction, one for each node; unused for leaves.
    Any(Vec<Split>),
    /// Axis-parallel ones.
    Axes(Treelets),
}

/// The direction of a node's plane and how far its two sides reach along it.
#[derive(Clone, Copy, Debug)]
struct Split {
    normal: Vec3,
    /// Nothing on the back side reaches farther than this along the normal.
    back_high: f32,
    /// Nothing on the front side reaches back beyond this.
    front_low: f32,
}

impl Split {
    const NONE: Split = Split {
        normal: Vec3::ZERO,
        back_high: 0.0,
        front_low: 0.0,
    };

    /// Position along the normal, by the plane test's own arithmetic: being
    /// monotone, it never puts a point of an item beyond the item's corner.
    #[inline(always)]
    fn along(&self) -> Plane {
        Plane::new(self.normal, 0.0)
    }
}

/// How planes are chosen.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
#[non_exhaustive]
pub enum BspBuilder {
    /// `import` where the scene brings a tree of its own, else `median`.
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
    /// The map's own tree (a Doom WAD has one); what its branches leave
    /// together is divided by `sah`.
    Import,
}

/// Parameters: `bsp:builder=faces,leaf=32,cut=2`.
#[derive(Clone, Copy, Debug, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct BspParams {
    /// Where the dividing planes come from.
    pub builder: BspBuilder,
    /// Most items of a leaf (1 to 4096).
    pub leaf: u32,
    /// For `faces`: how many items of imbalance one cut item counts as (0 to
    /// 1000).
    pub cut: f32,
}

impl Default for BspParams {
    fn default() -> Self {
        BspParams {
            builder: BspBuilder::Auto,
            leaf: 32,
            cut: 1.0,
        }
    }
}

impl BspParams {
    /// The builder that is meant, with the tree that it goes by.
    fn chosen<'a>(
        &self,
        own_tree: Option<&'a PlaneTree>,
    ) -> Result<(BspBuilder, Option<&'a PlaneTree>), BuildError> {
        Ok(match self.builder {
            BspBuilder::Auto => match own_tree.filter(|own| own.root.is_some()) {
                Some(own) => (BspBuilder::Import, Some(own)),
                None => (BspBuilder::Median, None),
            },
            BspBuilder::Import if own_tree.is_none() => {
                return Err(BuildError::Params {
                    structure: Bsp::INFO.name,
                    reason: "builder=import, but the scene has no tree of its own".to_owned(),
                });
            }
            BspBuilder::Import => (BspBuilder::Import, own_tree),
            builder => (builder, None),
        })
    }
}

struct PlaneSplitter<'a> {
    builder: BspBuilder,
    cut: f32,
    imported: Option<&'a PlaneTree>,
    splits: Vec<Split>,
    /// How many items come before the plane, for each division within a leaf of
    /// more than [`DESCENT_LEAF`] items.
    parts: Vec<u32>,
}

/// What the splitter knows of a group: the imported node to divide it by.
type Source = Option<u32>;

impl Splitter for PlaneSplitter<'_> {
    type Cell = Source;

    fn split(
        &mut self,
        records: &mut [Record],
        source: Source,
        node: usize,
        parts: &mut Vec<Part<Source>>,
    ) {
        let mut at = source;
        // Imported planes with everything on one side are passed by.
        while let Some(imported) = at.and_then(|at| self.imported?.nodes.get(at as usize)) {
            let back = divide(records, |r| {
                !imported.plane.contains_point(r.bounds.centre())
            });
            let [front_child, back_child] = imported.children;
            if back == 0 || back == records.len() {
                at = if back == 0 { front_child } else { back_child };
                continue;
            }
            self.keep(node, imported.plane.normal);
            parts.push(Part {
                items: back,
                cell: Some(back_child),
            });
            parts.push(Part {
                items: records.len() - back,
                cell: Some(front_child),
            });
            return;
        }
        let chosen = match self.builder {
            BspBuilder::Sah | BspBuilder::Import => by_surface_area(records),
            BspBuilder::Auto | BspBuilder::Median => None,
            BspBuilder::Oblique => by_principal_axis(records),
            BspBuilder::Faces => by_own_planes(records, self.cut),
        };
        let (normal, back) = match chosen.filter(|(_, back)| (1..records.len()).contains(back)) {
            Some(chosen) => chosen,
            None => between_layers(records),
        };
        self.keep(node, normal);
        parts.push(Part {
            items: back,
            cell: Some(None),
        });
        parts.push(Part {
            items: records.len() - back,
            cell: Some(None),
        });
    }

    fn arrange(&mut self, records: &mut [Record]) {
        if self.builder != BspBuilder::Median || records.len() <= DESCENT_LEAF {
            return;
        }
        let (_, back) = between_layers(records);
        self.parts.push(back as u32);
        let (back, front) = records.split_at_mut(back);
        self.arrange(back);
        self.arrange(front);
    }
}

impl PlaneSplitter<'_> {
    fn keep(&mut self, node: usize, normal: Vec3) {
        if self.splits.len() <= node {
            self.splits.resize(node + 1, Split::NONE);
        }
        self.splits[node].normal = normal;
    }
}

/// How far the two sides of a node reach along its normal, from the bounds of
/// its children.
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

impl Bsp {
    #[inline(always)]
    fn descend<I: Isa, S: Sink, R: Recorder>(
        &self,
        isa: I,
        p: Vec3,
        sink: &mut S,
        recorder: &mut R,
    ) -> ControlFlow<()> {
        let splits = match &self.planes {
            Planes::Any(splits) => splits,
            Planes::Axes(treelets) => {
                return treelets.locate(isa, &self.tree, p, sink, recorder);
            }
        };
        let nodes = self.tree.nodes();
        let mut open = Stack::new((0, ()));
        while let Some((at, ())) = open.pop() {
            let mut at = at as usize;
            // An empty tree has no node 0.
            while let Some(node) = nodes.get(at) {
                recorder.node_tested();
                if self.tree.is_leaf(at) {
                    self.tree
                        .test_items(isa, node.items(), (&p, p.mask()), sink, recorder)?;
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
}

impl RegionIndex for Bsp {
    const INFO: Info = Info::new(
        "bsp",
        "binary space partition by planes of any orientation; region search by plane descent",
        Kind::Tree,
        Origin::Ours,
    )
    .refits()
    .ranges();
    type Params = BspParams;

    fn build(input: &Input<'_>, params: &BspParams) -> Result<Self, BuildError> {
        let Input {
            items, own_tree, ..
        } = *input;
        check_range(Self::INFO.name, "leaf", params.leaf.into(), 1.0, 4096.0)?;
        check_range(Self::INFO.name, "cut", params.cut.into(), 0.0, 1000.0)?;
        let (builder, imported) = params.chosen(own_tree)?;
        let ids = indexable(items)?;
        let mut splitter = PlaneSplitter {
            builder,
            cut: params.cut,
            imported,
            splits: Vec::new(),
            parts: Vec::new(),
        };
        let root = imported.and_then(|planes| planes.root);
        let tree = build_top_down(items, &ids, params.leaf as usize, root, &mut splitter);
        if builder == BspBuilder::Median {
            let planes = Planes::Axes(Treelets::over(&tree, splitter.parts));
            return Ok(Bsp { tree, planes });
        }
        let mut splits = splitter.splits;
        splits.resize(tree.nodes().len(), Split::NONE);
        splits.shrink_to_fit();
        for node in 0..splits.len() {
            measure_reach(&mut splits, &tree, node);
        }
        let planes = Planes::Any(splits);
        Ok(Bsp { tree, planes })
    }

    fn memory(&self) -> MemoryUsage {
        let mut memory = self.tree.memory();
        memory.node_bytes += match &self.planes {
            Planes::Any(splits) => size_of_val(&splits[..]),
            Planes::Axes(treelets) => treelets.bytes(),
        };
        memory
    }

    /// Region search goes down by planes: one dot product per node.
    #[inline(always)]
    fn query<Q: QueryVolume, C: Context>(&self, volume: &Q, cx: &mut C) -> ControlFlow<()> {
        if Q::IS_POINT {
            let isa = cx.isa();
            let (sink, recorder) = cx.parts();
            return match volume.as_point() {
                Some(p) => self.descend(isa, p, sink, recorder),
                None => ControlFlow::Continue(()),
            };
        }
        self.tree.query(volume, cx)
    }

    #[inline(always)]
    fn query_many<I: Isa, S: ManySink>(
        &self,
        isa: I,
        points: &[Vec3],
        sink: &mut S,
    ) -> ControlFlow<()> {
        match &self.planes {
            Planes::Any(_) => batch::query_many(isa, &self.tree, points, sink),
            Planes::Axes(treelets) => treelets.query_many(&self.tree, points, sink),
        }
    }

    fn refit(&mut self, items: &[Aabb], moved: &[ItemId]) -> bool {
        let planes = &mut self.planes;
        self.tree.refit(items, moved, |tree, node| match planes {
            Planes::Any(splits) => measure_reach(splits, tree, node),
            Planes::Axes(treelets) => treelets.measure(tree, node),
        })
    }

    fn tree_order(&self) -> Option<&[ItemId]> {
        Some(self.tree.ids())
    }
}
