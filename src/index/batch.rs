//! Many region searches at once: points go down a tree in groups, a step of
//! all before the next step of any, so that the waits for memory overlap. It
//! owns the groups and their answers; the steps are those of each kind of tree.

use std::ops::{ControlFlow, Range};

use glam::Vec3;

use super::tree::PackedTree;
use crate::kernel::{Isa, prefetch};
use crate::query::{ItemId, ManySink, NoRecorder, QueryContext};

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

/// Items from which on a tree's nodes and blocks are waited for: smaller ones
/// stay in the caches, and steps in turn only cost (docs/adr/0009).
const WAITS_FROM: usize = 1 << 18;

/// [`super::RegionIndex::query_many`] by the nodes' bounds, for every tree.
#[inline(always)]
pub fn query_many<I: Isa, S: ManySink>(
    isa: I,
    tree: &PackedTree,
    points: &[Vec3],
    sink: &mut S,
) -> ControlFlow<()> {
    if tree.ids().len() >= WAITS_FROM {
        return in_turn(tree, points, sink);
    }
    let mut ids = Vec::new();
    for (p, point) in points.iter().zip(0..) {
        ids.clear();
        // A Vec never breaks off.
        let _ = tree.query(p, &mut QueryContext::new(isa, &mut ids, &mut NoRecorder));
        sink.accept(point, &ids)?;
    }
    ControlFlow::Continue(())
}

/// Each point of a group takes a step along the nodes in turn.
#[inline(always)]
fn in_turn<S: ManySink>(tree: &PackedTree, points: &[Vec3], sink: &mut S) -> ControlFlow<()> {
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::Aabb;
    use crate::index::tree::TreeWriter;
    use crate::kernel::BASELINE;
    use crate::query::Located;

    /// Overlapping boxes in three levels.
    fn tree() -> PackedTree {
        let mut writer = TreeWriter::with_capacity(300);
        let root = writer.open();
        for branch in 0..10 {
            let inner = writer.open();
            for leaf in 0..3 {
                let node = writer.open();
                for item in 0..10 {
                    let id = (branch * 3 + leaf) * 10 + item;
                    let place = Vec3::new(branch as f32, leaf as f32, item as f32 * 0.3);
                    writer.push(id, &Aabb::around(place, Vec3::splat(0.75)));
                }
                writer.close(node);
            }
            writer.close(inner);
        }
        writer.close(root);
        writer.finish()
    }

    #[test]
    fn points_that_take_turns_get_what_each_gets_alone() {
        for tree in [tree(), PackedTree::default()] {
            let mut points: Vec<Vec3> = (0..150u8)
                .map(|i| {
                    Vec3::new(
                        f32::from(i % 25) * 0.5,
                        f32::from(i % 7) * 0.5,
                        f32::from(i % 11) * 0.4,
                    )
                })
                .collect();
            points[70].y = f32::NAN;
            let (mut turns, mut alone) = (Located::default(), Located::default());
            assert!(in_turn(&tree, &points, &mut turns).is_continue());
            assert!(query_many(BASELINE, &tree, &points, &mut alone).is_continue());
            assert_eq!(turns, alone);
            assert_eq!(turns.len(), points.len());
            assert_eq!(turns.ids().is_empty(), tree.ids().is_empty());
        }
    }
}
