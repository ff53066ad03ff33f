//! The bounding volume hierarchy of the crate `obvhs`: its builders decide
//! the topology, and the items are then re-laid so that an accepted subtree
//! is one slice. obvhs has no frustum traversal of its own; ours is shared.

use std::borrow::Cow;
use std::ops::Range;
use std::time::Duration;

use obvhs::bvh2::Bvh2;
use obvhs::bvh2::builder::build_bvh2;
use obvhs::cwbvh::CwBvh;
use obvhs::cwbvh::builder::build_cwbvh;
use obvhs::{Boundable, BvhBuildParams};
use serde::{Deserialize, Serialize};

use super::by_tree::{searched_by_tree, seen_by_tree};
use super::tree::{PackedTree, TreeWriter};
use super::{BuildError, Info, Kind, Origin, RegionIndex, check_range, indexable};
use crate::geometry::{Aabb, PlaneTree};
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
    /// Cost of a node against that of an item, by which leaves are put
    /// together (0 to 1000): items are tested sixteen at a time, so it pays to
    /// fill leaves more than obvhs's own 3 does.
    pub collapse: f32,
    /// Share of the nodes that are considered for reinsertion (0 to 100; more
    /// than 1 goes over them several times); the preset's own if left out.
    pub reinsertion: Option<f32>,
    /// obvhs's binary tree, or its wide one with up to eight children and at
    /// most three items a leaf.
    pub layout: BvhLayout,
    /// Offer boxes much larger than the average to the builder in pieces.
    pub pre_split: bool,
}

/// Which of obvhs's trees the topology comes from.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum BvhLayout {
    Bvh2,
    CwBvh,
}

impl Default for BvhParams {
    fn default() -> Self {
        BvhParams {
            preset: BvhPreset::VeryFast,
            leaf: 32,
            collapse: 30.0,
            reinsertion: None,
            layout: BvhLayout::Bvh2,
            pre_split: false,
        }
    }
}

/// The presets of obvhs by their own names.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum BvhPreset {
    Fastest,
    VeryFast,
    Fast,
    Medium,
    Slow,
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

impl Boundable for Aabb {
    fn aabb(&self) -> obvhs::aabb::Aabb {
        obvhs::aabb::Aabb::new(self.min.into(), self.max.into())
    }
}

/// Items in stacks of the very same bounds. Clustering by nearest neighbour
/// finds no nearest one among equals and needs quadratic time: obvhs gets one
/// box for a stack, and the stack's items share its leaf.
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
        let key = |&id: &ItemId| {
            let b = items[id as usize];
            [b.min, b.max].map(|corner| corner.to_array().map(f32::to_bits))
        };
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
fn scale_for(items: &[Aabb]) -> f32 {
    let largest = Aabb::union_of(items).reach().max_element();
    let exponent = libm::ilogbf(largest);
    if largest == 0.0 || !largest.is_finite() || exponent.abs() <= 40 {
        return 1.0;
    }
    // Clamped to normal numbers; a subnormal scene is brought to 2^-23.
    libm::ldexpf(1.0, (-exponent).clamp(-126, 126))
}

/// Cuts boxes much larger than the average in halves, again and again, so
/// that the builder can part a large item's ends; the owner of each piece. The
/// threshold is that of obvhs's own preset for triangles.
fn pre_split(boxes: &[Aabb]) -> (Vec<Aabb>, Vec<u32>) {
    const MOST_PIECES: usize = 8;
    let half_area = |b: &Aabb| {
        let e = b.extent();
        e.x * e.y + e.y * e.z + e.z * e.x
    };
    let average = boxes.iter().map(|b| f64::from(half_area(b))).sum::<f64>() / boxes.len() as f64;
    let (mut pieces, mut owners) = (
        Vec::with_capacity(boxes.len()),
        Vec::with_capacity(boxes.len()),
    );
    for (b, owner) in boxes.iter().zip(0..) {
        let first = pieces.len();
        pieces.push(*b);
        let mut at = first;
        while at < pieces.len() && pieces.len() - first < MOST_PIECES {
            let piece = pieces[at];
            if f64::from(half_area(&piece)) <= 4.0 * average {
                at += 1;
                continue;
            }
            let extent = piece.extent();
            let axis = (0..3)
                .max_by(|&a, &b| extent[a].total_cmp(&extent[b]))
                .unwrap_or(0);
            let middle = piece.centre()[axis];
            pieces[at].max[axis] = middle;
            let mut rest = piece;
            rest.min[axis] = middle;
            pieces.push(rest);
        }
        owners.resize(pieces.len(), owner);
    }
    (pieces, owners)
}

/// A tree of obvhs, whichever of its two kinds.
enum Topology {
    Binary(Bvh2),
    Wide(CwBvh),
}

/// A part of it: a node, or the primitives of a leaf.
enum Branch {
    Node(u32),
    Leaf(Range<usize>),
}

impl Topology {
    fn primitives(&self) -> &[u32] {
        match self {
            Topology::Binary(tree) => &tree.primitive_indices,
            Topology::Wide(tree) => &tree.primitive_indices,
        }
    }

    /// The branches of a node, last one first.
    fn branches(&self, node: u32) -> Vec<Branch> {
        match self {
            Topology::Binary(tree) => {
                let node = &tree.nodes[node as usize];
                let first = node.first_index;
                if node.is_leaf() {
                    vec![Branch::Leaf(
                        first as usize..(first + node.prim_count) as usize,
                    )]
                } else {
                    vec![Branch::Node(first + 1), Branch::Node(first)]
                }
            }
            Topology::Wide(tree) => {
                let node = &tree.nodes[node as usize];
                let children = (0..8).rev().filter(|&child| !node.is_child_empty(child));
                let branch = |child| {
                    if !node.is_leaf(child) {
                        return Branch::Node(node.child_node_index(child));
                    }
                    let (first, count) = node.child_primitives(child);
                    Branch::Leaf(first as usize..(first + count) as usize)
                };
                children.map(branch).collect()
            }
        }
    }
}

/// Lays the items out in depth-first order. An item that comes again (its box
/// was split) is kept once. Iterative, so that a degenerate tree cannot
/// overflow the stack. O(n).
fn relaid(items: &[Aabb], stacks: &Stacks, owners: Option<&[u32]>, built: &Topology) -> PackedTree {
    enum Task {
        Enter(Branch),
        Leave(usize),
    }
    let primitives = built.primitives();
    let owner = |place: u32| owners.map_or(place, |owners| owners[place as usize]);
    let mut writer = TreeWriter::with_capacity(stacks.members.len());
    let mut placed = vec![false; items.len()];
    let mut open = vec![Task::Enter(Branch::Node(0))];
    while let Some(task) = open.pop() {
        match task {
            Task::Leave(node) => writer.close(node),
            Task::Enter(branch) => {
                open.push(Task::Leave(writer.open()));
                let mut branches = match branch {
                    Branch::Node(node) => built.branches(node),
                    leaf => vec![leaf],
                };
                if let [Branch::Leaf(range)] = &branches[..] {
                    let here = primitives[range.clone()].iter();
                    for &id in here.flat_map(|&place| stacks.get(owner(place))) {
                        if !std::mem::replace(&mut placed[id as usize], true) {
                            writer.push(id, &items[id as usize]);
                        }
                    }
                    branches.clear();
                }
                open.extend(branches.into_iter().map(Task::Enter));
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

    fn build(
        items: &[Aabb],
        _: Option<&PlaneTree>,
        params: &BvhParams,
    ) -> Result<Self, BuildError> {
        check_range(Self::INFO.name, "leaf", params.leaf.into(), 1.0, 255.0)?;
        check_range(
            Self::INFO.name,
            "collapse",
            params.collapse.into(),
            0.0,
            1000.0,
        )?;
        let mut config = BvhBuildParams {
            max_prims_per_leaf: params.leaf,
            collapse_traversal_cost: params.collapse,
            ..params.preset.params()
        };
        if let Some(share) = params.reinsertion {
            check_range(Self::INFO.name, "reinsertion", share.into(), 0.0, 100.0)?;
            config.reinsertion_batch_ratio = share;
        }
        let stacks = Stacks::of(items, indexable(items)?);
        let boxes = stacks.boxes(items);
        if boxes.is_empty() || stacks.members.is_empty() {
            return Ok(Bvh {
                tree: PackedTree::default(),
            });
        }
        let (pieces, owners) = match params.pre_split {
            true => {
                let (pieces, owners) = pre_split(&boxes);
                (Cow::Owned(pieces), Some(owners))
            }
            false => (boxes, None),
        };
        let mut time = Duration::default();
        let built = match params.layout {
            BvhLayout::Bvh2 => Topology::Binary(build_bvh2(&pieces, config, &mut time)),
            BvhLayout::CwBvh => Topology::Wide(build_cwbvh(&pieces, config, &mut time)),
        };
        drop(pieces);
        Ok(Bvh {
            tree: relaid(items, &stacks, owners.as_deref(), &built),
        })
    }

    searched_by_tree!();
}

seen_by_tree!(Bvh);
