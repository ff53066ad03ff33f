//! Many region searches at once: points go down a tree in groups, a step of
//! all before the next step of any, so that the waits for memory overlap. It
//! owns the groups and their answers; the steps are those of each kind of tree.

use std::ops::{ControlFlow, Range};

use glam::Vec3;

use super::tree::PackedTree;
use crate::kernel::prefetch;
use crate::query::{ItemId, ManySink};

/// Points that go down together: enough to hide the waits, few enough for what
/// they ask for to stay in the nearest caches.
pub const GROUP: usize = 64;

/// A point on its way down, or the leaf that it has come to.
#[derive(Clone, Copy, Default, Debug)]
pub struct Descent {
    /// Its place in the group.
    pub point: u32,
    /// A node or leaf, numbered as its tree does.
    pub at: u32,
}

/// Tests the items of the leaves that a group has come to and hands the
/// answers over, point by point. `leaves` are in the order of the points,
/// `first` is the number of the group's first point, `ids` is room for answers.
#[inline(always)]
pub fn answer<S: ManySink>(
    tree: &PackedTree,
    group: &[Vec3],
    first: u32,
    leaves: &[Descent],
    items_of: impl Fn(u32) -> Range<usize>,
    ids: &mut Vec<ItemId>,
    sink: &mut S,
) -> ControlFlow<()> {
    for leaf in leaves {
        tree.prefetch_items(items_of(leaf.at));
    }
    ids.clear();
    let mut ends = [0; GROUP];
    for leaf in leaves {
        let p = group[leaf.point as usize];
        tree.collect_holding(items_of(leaf.at), p, ids);
        ends[leaf.point as usize] = ids.len();
    }
    let mut from = 0;
    for (end, point) in ends[..group.len()].iter().zip(first..) {
        // A point without a leaf has no end of its own.
        let end = from.max(*end);
        sink.accept(point, &ids[from..end])?;
        from = end;
    }
    ControlFlow::Continue(())
}

/// [`super::RegionIndex::locate_many`] by the nodes' bounds, for every tree:
/// each point of a group takes a step along the nodes in turn.
#[inline(always)]
pub fn locate_many<S: ManySink>(
    tree: &PackedTree,
    points: &[Vec3],
    sink: &mut S,
) -> ControlFlow<()> {
    let nodes = tree.nodes();
    let (mut leaves, mut ids) = (Vec::new(), Vec::new());
    let mut open: Vec<Descent> = Vec::with_capacity(GROUP);
    for (group, first) in points.chunks(GROUP).zip((0..).step_by(GROUP)) {
        open.extend((0..group.len() as u32).map(|point| Descent { point, at: 0 }));
        while !open.is_empty() {
            let mut kept = 0;
            for i in 0..open.len() {
                let Descent { point, at } = open[i];
                // An empty tree has no node 0.
                let Some(node) = nodes.get(at as usize) else {
                    continue;
                };
                let next = if node.bounds.contains_point(group[point as usize]) {
                    if tree.is_leaf(at as usize) {
                        leaves.push(open[i]);
                    }
                    at as usize + 1
                } else {
                    node.after()
                };
                if let Some(next) = nodes.get(next) {
                    prefetch(next);
                }
                open[kept] = Descent {
                    point,
                    at: next as u32,
                };
                kept += 1;
            }
            open.truncate(kept);
        }
        // Stable: within a point the leaves are in tree order.
        leaves.sort_by_key(|leaf: &Descent| leaf.point);
        let items_of = |leaf: u32| nodes[leaf as usize].items();
        answer(tree, group, first, &leaves, items_of, &mut ids, sink)?;
        leaves.clear();
    }
    ControlFlow::Continue(())
}
