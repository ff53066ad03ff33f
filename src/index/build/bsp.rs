//! The BSP tree: planes divide the items, and points descend by the planes alone.
//!
//! Can import a map's own tree, whose planes have any orientation. `bsp_split_planes` chooses
//! planes.

use glam::Vec3;
use serde::{Deserialize, Serialize};

use super::bsp_split_planes::{ARRANGED, between_layers, by_surface_area, divide};
use crate::geometry::PlaneTree;
use crate::index::items::Record;
use crate::index::tree::{Built, Part, Splitter, Tree, TreeBuilder, build_top_down};
use crate::index::{BuildError, Info, Input, Kind, check_range};

/// A binary space partition with fitted node bounds.
///
/// Fuchs, Kedem and Naylor 1980, "On visible surface generation by a priori tree structures".
///
/// An item cut by a plane is neither split nor stored twice: it goes to the side of its centre, and
/// the node keeps how far each side reaches across the plane (two offsets, as in a bounding
/// interval hierarchy, Waechter and Keller 2006, but for planes of any direction). A point visits
/// both sides where they overlap.
pub type Bsp = Tree<BspBuilder>;

/// Builder of [`Bsp`].
pub struct BspBuilder;

/// Source of the dividing planes.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum PlaneSource {
    /// `import` if the scene has its own tree, else `median`.
    Auto,
    /// Axis-parallel planes by the surface area heuristic, 16 bins.
    ///
    /// Wald 2007, "On fast construction of SAH-based bounding volume hierarchies".
    Sah,
    /// The median of the centres along the widest axis: perfectly balanced.
    Median,
    /// The map's own tree (a Doom WAD has one).
    ///
    /// Groups that its planes do not divide further are divided by `sah`.
    Import,
}

defaults! {
    /// Parameters: `bsp:builder=sah,leaf=16`.
    #[derive(Clone, Copy, Debug, Serialize, Deserialize)]
    #[serde(default, deny_unknown_fields)]
    pub struct BspParams {
        /// Source of the dividing planes.
        pub builder: PlaneSource = PlaneSource::Auto,
        /// Most items of a leaf (1 to 4096).
        pub leaf: u32 = 32,
    }
}

impl BspParams {
    /// The builder in effect, with the scene's own tree if the builder uses it.
    fn chosen<'a>(
        &self,
        own_tree: Option<&'a PlaneTree>,
    ) -> Result<(PlaneSource, Option<&'a PlaneTree>), BuildError> {
        let has_own = own_tree.is_some_and(|own| own.root.is_some());
        Ok(match self.builder {
            PlaneSource::Auto if has_own => (PlaneSource::Import, own_tree),
            PlaneSource::Auto => (PlaneSource::Median, None),
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
    imported: Option<&'a PlaneTree>,
    /// The normal of each inner node's plane.
    normals: Vec<Vec3>,
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
        // Skips imported planes with all items on one side.
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
            };
            let divides = |&(_, back): &(Vec3, usize)| (1..count).contains(&back);
            let chosen = chosen.filter(divides);
            let (normal, back) = chosen.unwrap_or_else(|| between_layers(records));
            (normal, back, [None; 2])
        });
        if self.normals.len() <= node {
            self.normals.resize(node + 1, Vec3::ZERO);
        }
        self.normals[node] = normal;
        let halves = [back, count - back].into_iter().zip(cells.map(Some));
        parts.extend(halves.map(|(items, cell)| Part { items, cell }));
    }

    /// Continues as if the leaf were divided, for callers that draw in tree order.
    fn arrange(&mut self, records: &mut [Record]) {
        if self.source != PlaneSource::Median || records.len() <= ARRANGED {
            return;
        }
        let (_, back) = between_layers(records);
        let (back, front) = records.split_at_mut(back);
        self.arrange(back);
        self.arrange(front);
    }
}

impl TreeBuilder for BspBuilder {
    const INFO: Info = Info::ours(
        "bsp",
        "binary space partition by planes of any orientation; region search by plane descent",
        Kind::Tree,
    );
    type Params = BspParams;
    const BY_PLANES: bool = true;

    fn build(input: &Input<'_>, params: &BspParams) -> Built {
        check_range(Self::INFO.name, "leaf", params.leaf.into(), 1.0, 4096.0)?;
        let (source, imported) = params.chosen(input.own_tree)?;
        let mut splitter = PlaneSplitter {
            source,
            imported,
            normals: Vec::new(),
        };
        let root = imported.and_then(|planes| planes.root);
        let records = Record::all(input.items)?;
        let tree = build_top_down(records, params.leaf as usize, root, &mut splitter);
        let mut normals = splitter.normals;
        normals.resize(tree.nodes().len(), Vec3::ZERO);
        Ok((tree, normals))
    }
}
