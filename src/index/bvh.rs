//! The bounding volume hierarchy of the crate `obvhs`: its builders decide
//! the topology, and the items are then re-laid so that an accepted subtree
//! is one slice. obvhs has no frustum traversal of its own; ours is shared.

use std::borrow::Cow;

use obvhs::BvhBuildParams;
use obvhs::bvh2::Bvh2;
use serde::{Deserialize, Serialize};

use super::by_tree::answered_by_tree;
use super::tree::{PackedTree, TreeWriter};
use super::{BuildError, Info, Input, Kind, Origin, RegionIndex, check_range, indexable, ploc};
use crate::geometry::Aabb;
use crate::query::ItemId;

/// A BVH built bottom-up (PLOC: Meister and Bittner 2018, "Parallel locally
/// ordered clustering for bounding volume hierarchy construction", with
/// reinsertion: Meister and Bittner 2018b), by obvhs.
pub struct Bvh {
    tree: PackedTree,
}

/// Parameters: `bvh:preset=medium,leaf=4`.
#[derive(Clone, Copy, Debug, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct BvhParams {
    /// obvhs's build preset: build time against tree quality.
    pub preset: BvhPreset,
    /// Most items of a leaf (1 to 255).
    pub leaf: u32,
}

impl Default for BvhParams {
    fn default() -> Self {
        BvhParams {
            preset: BvhPreset::VeryFast,
            leaf: 32,
        }
    }
}

/// Cost of a node against that of an item, by which leaves are put together:
/// items are tested sixteen at a time, so it pays to fill leaves more than
/// obvhs's own 3 does.
const COLLAPSE_COST: f32 = 30.0;

/// The presets of obvhs by their own names.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
#[non_exhaustive]
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

/// Items in stacks of the very same bounds. Clustering by nearest neighbour
/// finds no nearest one among equals: obvhs gets one box for a stack, and the
/// stack's items share its leaf.
struct Stacks {
    members: Vec<ItemId>,
    /// Where each stack begins in `members`; empty if every item stands alone.
    starts: Vec<u32>,
}

/// Items that are looked at to see whether there are stacks at all. What slips
/// through is small, and so is its cost.
const STACK_SAMPLE: usize = 4096;

impl Stacks {
    fn of(items: &[Aabb], mut ids: Vec<ItemId>) -> Stacks {
        let key = |&id: &ItemId| items[id as usize].bits();
        let step = ids.len().div_ceil(STACK_SAMPLE).max(1);
        let mut sample: Vec<_> = ids.iter().step_by(step).map(key).collect();
        sample.sort_unstable();
        let mut starts = Vec::new();
        if sample.windows(2).any(|pair| pair[0] == pair[1]) {
            ids.sort_unstable_by_key(|id| (key(id), *id));
            let begins = |i: usize| i == 0 || key(&ids[i]) != key(&ids[i - 1]);
            starts = (0..ids.len())
                .filter(|&i| begins(i))
                .map(|i| i as u32)
                .collect();
        }
        Stacks {
            members: ids,
            starts,
        }
    }

    fn get(&self, stack: u32) -> &[ItemId] {
        let stack = stack as usize;
        if self.starts.is_empty() {
            return &self.members[stack..=stack];
        }
        let end = self
            .starts
            .get(stack + 1)
            .map_or(self.members.len(), |&end| end as usize);
        &self.members[self.starts[stack] as usize..end]
    }

    /// The boxes that obvhs is to build over, one a stack: the items
    /// themselves where they can be used as they are, so that ten million of
    /// them are not copied.
    fn boxes<'a>(&self, items: &'a [Aabb]) -> Cow<'a, [Aabb]> {
        let scale = scale_for(items);
        if scale == 1.0 && self.starts.is_empty() && self.members.len() == items.len() {
            return Cow::Borrowed(items);
        }
        let scaled = |&id: &ItemId| {
            let b = items[id as usize];
            Aabb::new(b.min * scale, b.max * scale)
        };
        match self.starts.is_empty() {
            true => self.members.iter().map(scaled).collect(),
            false => self
                .starts
                .iter()
                .map(|&at| scaled(&self.members[at as usize]))
                .collect(),
        }
    }
}

/// A power of two that brings the scene near unit size, or 1 for coordinates
/// between 2^-40 and 2^40: beyond, the areas that the builder compares would
/// overflow or vanish in f32.
pub(crate) fn scale_for(items: &[Aabb]) -> f32 {
    let largest = Aabb::union_of(items).reach().max_element();
    let exponent = libm::ilogbf(largest);
    if largest == 0.0 || !largest.is_finite() || exponent.abs() <= 40 {
        return 1.0;
    }
    // Clamped to normal numbers; a subnormal scene is brought to 2^-23.
    libm::ldexpf(1.0, (-exponent).clamp(-126, 126))
}

/// Lays the items out in depth-first order. Iterative, so that a degenerate
/// tree cannot overflow the stack. O(n).
fn relaid(items: &[Aabb], stacks: &Stacks, built: &Bvh2) -> PackedTree {
    enum TaskKind {
        Enter(u32),
        Leave(usize),
    }
    let mut writer = TreeWriter::with_capacity(stacks.members.len());
    let mut open = vec![TaskKind::Enter(0)];
    while let Some(task) = open.pop() {
        match task {
            TaskKind::Leave(node) => writer.close(node),
            TaskKind::Enter(node) => {
                open.push(TaskKind::Leave(writer.open()));
                let node = &built.nodes[node as usize];
                let first = node.first_index;
                if node.is_leaf() {
                    let here = first as usize..(first + node.prim_count) as usize;
                    let stacks = built.primitive_indices[here]
                        .iter()
                        .map(|&at| stacks.get(at));
                    for &id in stacks.flatten() {
                        writer.push(id, &items[id as usize]);
                    }
                } else {
                    open.extend([TaskKind::Enter(first + 1), TaskKind::Enter(first)]);
                }
            }
        }
    }
    writer.finish()
}

impl RegionIndex for Bvh {
    const INFO: Info = Info::new(
        "bvh",
        "bounding volume hierarchy (crate obvhs), items re-laid in tree order, plane masks",
        Kind::Tree,
        Origin::Ours,
    )
    .refits()
    .ranges();
    type Params = BvhParams;

    fn build(input: &Input<'_>, params: &BvhParams) -> Result<Self, BuildError> {
        let items = input.items;
        check_range(Self::INFO.name, "leaf", params.leaf.into(), 1.0, 255.0)?;
        let config = BvhBuildParams {
            max_prims_per_leaf: params.leaf,
            collapse_traversal_cost: COLLAPSE_COST,
            ..params.preset.params()
        };
        let stacks = Stacks::of(items, indexable(items)?);
        let boxes = stacks.boxes(items);
        if boxes.is_empty() || stacks.members.is_empty() {
            return Ok(Bvh {
                tree: PackedTree::default(),
            });
        }
        let built = ploc::build(&boxes, config);
        drop(boxes);
        Ok(Bvh {
            tree: relaid(items, &stacks, &built),
        })
    }

    answered_by_tree!();
}
