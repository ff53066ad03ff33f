//! The bounding volume hierarchy `bvh`: a tree of the crate `obvhs`, packed.
//!
//! `ploc` runs the steps of obvhs's builder. Its leaves are then copied into a packed tree
//! in depth-first order, so that an accepted subtree is one slice of ids.

use std::borrow::Cow;

use obvhs::BvhBuildParams;
use obvhs::bvh2::Bvh2;
use serde::{Deserialize, Serialize};

use super::ploc;
use crate::geometry::Aabb;
use crate::index::items::indexable;
use crate::index::tree::{Built, PackedTree, Tree, TreeBuilder};
use crate::index::{Info, Input, Kind, check_range};
use crate::query::ItemId;

/// A bounding volume hierarchy built bottom-up, by obvhs.
///
/// PLOC (Meister and Bittner 2018, "Parallel locally ordered clustering for bounding volume
/// hierarchy construction") with reinsertion (Meister and Bittner 2018b).
pub type Bvh = Tree<BvhBuilder>;

/// Builder of [`Bvh`].
pub struct BvhBuilder;

defaults! {
    /// Parameters: `bvh:preset=medium,leaf=4`.
    #[derive(Clone, Copy, Debug, Serialize, Deserialize)]
    #[serde(default, deny_unknown_fields)]
    pub struct BvhParams {
        /// obvhs's build preset: build time against tree quality.
        pub preset: BvhPreset = BvhPreset::VeryFast,
        /// Most items of a leaf (1 to 255).
        pub leaf: u32 = 32,
    }
}

/// Cost of a node / cost of an item, by which obvhs merges leaves.
///
/// Items are tested sixteen at a time, so fuller leaves pay than with obvhs's default, 3.
const COLLAPSE_COST: f32 = 30.0;

/// The presets of obvhs by their own names.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum BvhPreset {
    /// `BvhBuildParams::fastest_build`: the quickest build, the worst tree.
    Fastest,
    /// `BvhBuildParams::very_fast_build`.
    VeryFast,
    /// `BvhBuildParams::fast_build`.
    Fast,
    /// `BvhBuildParams::medium_build`.
    Medium,
    /// `BvhBuildParams::slow_build`.
    Slow,
    /// `BvhBuildParams::very_slow_build`: the slowest build, the best tree.
    VerySlow,
}

impl BvhPreset {
    fn params(self) -> BvhBuildParams {
        match self {
            BvhPreset::Fastest => BvhBuildParams::fastest_build(),
            BvhPreset::VeryFast => BvhBuildParams::very_fast_build(),
            BvhPreset::Fast => BvhBuildParams::fast_build(),
            BvhPreset::Medium => BvhBuildParams::medium_build(),
            BvhPreset::Slow => BvhBuildParams::slow_build(),
            BvhPreset::VerySlow => BvhBuildParams::very_slow_build(),
        }
    }
}

/// Items grouped by equal bounds: a stack holds all items of one box.
///
/// Clustering finds no nearest neighbour among equal boxes, so obvhs gets one box per stack, and
/// the items of the stack share its leaf.
struct Stacks {
    /// Item ids, stack by stack.
    members: Vec<ItemId>,
    /// First member of each stack, and the end of the last one.
    ///
    /// Empty if each item has a stack to itself.
    starts: Vec<u32>,
}

/// Size of the sample that decides whether items are grouped into stacks.
///
/// Stacks that the sample misses are small, and so is their cost.
const STACK_SAMPLE: usize = 4096;

impl Stacks {
    fn of(items: &[Aabb], mut members: Vec<ItemId>) -> Stacks {
        let key = |&id: &ItemId| items[id as usize].bits();
        let step = members.len().div_ceil(STACK_SAMPLE).max(1);
        let mut sample: Vec<_> = members.iter().step_by(step).map(key).collect();
        sample.sort_unstable();
        let mut starts = Vec::new();
        if sample.windows(2).any(|pair| pair[0] == pair[1]) {
            members.sort_unstable_by_key(|id| (key(id), *id));
            starts.push(0);
            for stack in members.chunk_by(|a, b| key(a) == key(b)) {
                starts.push(starts[starts.len() - 1] + stack.len() as u32);
            }
        }
        Stacks { members, starts }
    }

    /// Item ids of a stack.
    fn get(&self, stack: u32) -> &[ItemId] {
        let stack = stack as usize;
        match self.starts.get(stack..stack + 2) {
            Some(&[start, end]) => &self.members[start as usize..end as usize],
            _ => &self.members[stack..=stack],
        }
    }

    /// The boxes that obvhs builds over, one per stack.
    ///
    /// The items themselves if they can be used unchanged, so that ten million of them are not
    /// copied.
    fn boxes<'a>(&self, items: &'a [Aabb]) -> Cow<'a, [Aabb]> {
        let scale = Aabb::union_of(items).scale_for_areas();
        if scale == 1.0 && self.starts.is_empty() && self.members.len() == items.len() {
            return Cow::Borrowed(items);
        }
        let stacks = match self.starts.len() {
            0 => self.members.len(),
            ends => ends - 1,
        };
        let scaled = |stack| items[self.get(stack)[0] as usize].scaled(scale);
        (0..stacks as u32).map(scaled).collect()
    }
}

/// Copies the topology of obvhs's tree into a packed tree. O(n).
fn packed(items: &[Aabb], stacks: &Stacks, built: &Bvh2) -> PackedTree {
    PackedTree::grow(stacks.members.len(), 0, |tree, _, node: u32, children| {
        let node = &built.nodes[node as usize];
        let first = node.first_index;
        if !node.is_leaf() {
            return children.extend([first, first + 1]);
        }
        let here = first as usize..(first + node.prim_count) as usize;
        for &stack in &built.primitive_indices[here] {
            for &id in stacks.get(stack) {
                tree.push(id, &items[id as usize]);
            }
        }
    })
}

impl TreeBuilder for BvhBuilder {
    const INFO: Info = Info::ours(
        "bvh",
        "bounding volume hierarchy (crate obvhs), items re-laid in tree order, plane masks",
        Kind::Tree,
    );
    type Params = BvhParams;

    fn build(input: &Input<'_>, params: &BvhParams) -> Built {
        let items = input.items;
        check_range(Self::INFO.name, "leaf", params.leaf.into(), 1.0, 255.0)?;
        let config = BvhBuildParams {
            max_prims_per_leaf: params.leaf,
            collapse_traversal_cost: COLLAPSE_COST,
            ..params.preset.params()
        };
        let stacks = Stacks::of(items, indexable(items)?);
        if stacks.members.is_empty() {
            return Ok((PackedTree::default(), Vec::new()));
        }
        let built = ploc::build(&stacks.boxes(items), config);
        Ok((packed(items, &stacks, &built), Vec::new()))
    }
}
