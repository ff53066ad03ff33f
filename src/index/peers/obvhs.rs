//! The crate obvhs with its own tree.
//!
//! Nodes are in the crate's order, ids go through `primitive_indices`. The crate has no frustum
//! traversal, so its public nodes are walked in the manner of its own traversals. The structure
//! `bvh` reorders a tree of the same builder.

use std::ops::ControlFlow;

use obvhs::BvhBuildParams;
use obvhs::bvh2::Bvh2;
use obvhs::bvh2::node::Bvh2Node;
use serde::{Deserialize, Serialize};

use crate::geometry::Aabb;
use crate::index::box_test::{BoxQuery, BoxTest, BoxTested};
use crate::index::items::{ABSENT, Positions, Record};
use crate::index::tree::node::Stack;
use crate::index::{BuildError, Info, Kind, MemoryUsage, Origin, ploc};
use crate::query::{Context, ItemId};

/// Parameters: `peer-obvhs:update=move`.
#[derive(Clone, Copy, Default, Debug, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct ObvhsParams {
    /// The crate's calls of an update.
    pub update: ObvhsUpdate,
}

/// Calls of the crate after items have moved.
#[derive(Clone, Copy, Default, PartialEq, Eq, Debug, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum ObvhsUpdate {
    /// `resize_node` per leaf; `refit_all` once one item in 32 has moved.
    #[default]
    Refit,
    /// `move_primitive`; leaves of several items are refitted.
    Move,
}

/// An update refits all nodes once one item in this number has moved.
const ALL_SHARE: usize = 32;

/// The crate's tree by its medium preset; items in the order of its primitives.
#[derive(Default)]
pub struct PeerObvhs {
    bvh: Bvh2,
    /// Empty if every leaf has one item: the leaf has its bounds.
    boxes: Vec<Aabb>,
    ids: Vec<ItemId>,
    positions: Positions,
    /// Indices of the crate's primitives that were removed.
    free: Vec<u32>,
    update: ObvhsUpdate,
}

#[inline(always)]
fn bounds_of(node: &Bvh2Node) -> Aabb {
    Aabb::new(node.min, node.max)
}

impl PeerObvhs {
    /// Removes an item; the last one of its leaf takes its place, as in the crate.
    fn remove(&mut self, id: ItemId, place: usize) {
        let primitive = self.bvh.primitive_indices[place];
        let leaf = &self.bvh.nodes[self.bvh.primitives_to_nodes[primitive as usize] as usize];
        let last = (leaf.first_index + leaf.prim_count - 1) as usize;
        self.bvh.remove_primitive(primitive);
        self.free.push(primitive);
        self.ids[place] = self.ids[last];
        if !self.boxes.is_empty() {
            self.boxes[place] = self.boxes[last];
        }
        self.positions.set(self.ids[place], place as u32);
        self.positions.set(id, ABSENT);
    }

    /// Inserts an item as a leaf of its own.
    fn insert(&mut self, id: ItemId, bounds: Aabb) {
        let primitive = self.free.pop().unwrap_or(self.ids.len() as u32);
        let own = obvhs::aabb::Aabb::new(bounds.min.into(), bounds.max.into());
        let node = self.bvh.insert_primitive(own, primitive);
        let place = self.bvh.nodes[node].first_index;
        let places = self.bvh.primitive_indices.len();
        self.ids.resize(places, id);
        self.ids[place as usize] = id;
        if !self.boxes.is_empty() {
            self.boxes.resize(places, bounds);
            self.boxes[place as usize] = bounds;
        }
        self.positions.set(id, place);
    }

    /// Tests the items of a leaf that was not rejected.
    #[inline(always)]
    fn leaf<T: BoxTest + ?Sized, C: Context>(
        &self,
        node: &Bvh2Node,
        ask: &mut BoxQuery<T, C>,
    ) -> ControlFlow<()> {
        let first = node.first_index as usize;
        for place in first..first + node.prim_count as usize {
            let id = &self.ids[place];
            match self.boxes.get(place) {
                Some(b) => ask.item(b, id)?,
                None => ask.item(&bounds_of(node), id)?,
            }
        }
        ControlFlow::Continue(())
    }
}

impl BoxTested for PeerObvhs {
    const ABOUT: Info = Info::new(
        "peer-obvhs",
        "crate obvhs, medium build, its own nodes traversed",
        Kind::Tree,
        Origin::Crate("obvhs"),
    )
    .refits();
    type Params = ObvhsParams;

    fn of(items: Vec<Record>, params: &ObvhsParams) -> Result<Self, BuildError> {
        if items.is_empty() {
            return Ok(PeerObvhs::default());
        }
        let boxes: Vec<Aabb> = items.iter().map(|item| item.bounds).collect();
        let scale = Aabb::union_of(&boxes).scale_for_areas();
        let small: Vec<Aabb> = boxes.iter().map(|b| b.scaled(scale)).collect();
        let mut bvh = ploc::build(&small, BvhBuildParams::medium_build());
        bvh.reorder_in_stack_traversal_order();
        if scale != 1.0 {
            for node in bvh.nodes.iter_mut().filter(|node| node.is_leaf()) {
                let first = node.first_index as usize;
                let held = &bvh.primitive_indices[first..first + node.prim_count as usize];
                let all = Aabb::union_of(held.iter().map(|&place| &boxes[place as usize]));
                node.set_aabb(obvhs::aabb::Aabb::new(all.min.into(), all.max.into()));
            }
            bvh.refit_all();
        }
        // A walk keeps one entry per level; the crate's default is 96.
        bvh.max_depth = bvh.max_depth.max(bvh.depth(0) + 2);
        let single = bvh.nodes.iter().all(|node| node.prim_count <= 1);
        let of = |&place: &u32| items[place as usize];
        Ok(PeerObvhs {
            boxes: match single {
                true => Vec::new(),
                false => bvh.primitive_indices.iter().map(|p| of(p).bounds).collect(),
            },
            ids: bvh.primitive_indices.iter().map(|p| of(p).id).collect(),
            bvh,
            update: params.update,
            ..PeerObvhs::default()
        })
    }

    fn follow(&mut self, items: &[Aabb], moved: &[ItemId]) -> Option<()> {
        self.positions.prepare(self.ids.iter(), items.len());
        self.bvh.init_primitives_to_nodes_if_uninit();
        let mut stay = Vec::with_capacity(moved.len());
        for &id in moved {
            let b = items[id as usize];
            match self.positions.of(id) {
                Some(_) if !b.is_empty() => stay.push(id),
                Some(place) => self.remove(id, place),
                None if !b.is_empty() => self.insert(id, b),
                None => {}
            }
        }
        let all = stay.len() * ALL_SHARE >= self.ids.len();
        let moves = self.update == ObvhsUpdate::Move && self.boxes.is_empty();
        for id in stay {
            let place = self.positions.of(id)?;
            let b = items[id as usize];
            let mut bounds = obvhs::aabb::Aabb::new(b.min.into(), b.max.into());
            let primitive = self.bvh.primitive_indices[place];
            if moves {
                self.bvh.move_primitive(bounds, primitive);
                continue;
            }
            let node = self.bvh.primitives_to_nodes[primitive as usize] as usize;
            if let Some(old) = self.boxes.get_mut(place) {
                *old = b;
                let first = self.bvh.nodes[node].first_index as usize;
                let count = self.bvh.nodes[node].prim_count as usize;
                let all = Aabb::union_of(&self.boxes[first..first + count]);
                bounds = obvhs::aabb::Aabb::new(all.min.into(), all.max.into());
            }
            match all {
                true => self.bvh.nodes[node].set_aabb(bounds),
                false => self.bvh.resize_node(node, bounds),
            }
        }
        if all && !moves {
            self.bvh.refit_all();
        }
        Some(())
    }

    fn used(&self) -> MemoryUsage {
        let bvh = &self.bvh;
        let places = [
            &bvh.primitive_indices,
            &bvh.primitives_to_nodes,
            &bvh.parents,
        ];
        // A leaf of one item has the item's bounds.
        let items_in_nodes = usize::from(self.boxes.is_empty()) * self.ids.len();
        let leaves = items_in_nodes * size_of::<Bvh2Node>();
        MemoryUsage {
            node_bytes: bvh.nodes.capacity() * size_of::<Bvh2Node>() - leaves
                + places.iter().map(|list| list.capacity() * 4).sum::<usize>(),
            item_bytes: leaves
                + size_of_val(&self.boxes[..])
                + size_of_val(&self.ids[..])
                + self.positions.bytes(),
        }
    }

    /// Pops pairs of children from a stack, as the crate's own `point_traverse` does.
    #[inline(always)]
    fn search<T: BoxTest + ?Sized, C: Context>(&self, ask: &mut BoxQuery<T, C>) -> ControlFlow<()> {
        let nodes = &self.bvh.nodes[..];
        let Some(root) = nodes.first() else {
            return ControlFlow::Continue(());
        };
        if root.is_leaf() {
            return self.leaf(root, ask);
        }
        if ask.rejects(&bounds_of(root)) {
            return ControlFlow::Continue(());
        }
        let mut open = Stack::new(root.first_index);
        while let Some(first) = open.pop() {
            for node in [&nodes[first as usize], &nodes[first as usize + 1]] {
                // A leaf of one item has the item's bounds: no second test.
                if node.prim_count != 1 && ask.rejects(&bounds_of(node)) {
                    continue;
                }
                if node.is_leaf() {
                    self.leaf(node, ask)?;
                } else {
                    open.push(node.first_index);
                }
            }
        }
        ControlFlow::Continue(())
    }
}
