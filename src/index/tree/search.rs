//! Queries of the packed tree, the same for every builder.
//!
//! [`PackedTree::query`] descends level by level through the wide nodes for a volume and
//! calls [`PackedTree::walk`] for a point, one pass along the nodes in memory order.
//! [`PackedTree::query_many`] searches for many points.

use std::cell::Cell;
use std::ops::{ControlFlow, Range};

use glam::Vec3;

use super::node::{Stack, TreeNode};
use super::packed::PackedTree;
use crate::geometry::{LANES, LaneMask, PlaneMask};
use crate::index::frontier::{
    AHEAD, Frontier, Merger, first_ahead, is_far, pass_run, put_back, take,
};
use crate::index::linear::scan_blocks;
use crate::kernel::{Isa, pairs, prefetch};
use crate::query::{
    Containment, Context, ItemId, ManySink, NoRecorder, QueryContext, QueryVolume, Recorder, Sink,
};

/// Memory of a traversal by level, kept between queries.
#[derive(Default)]
struct Scratch {
    /// Wide nodes of the present level.
    here: Frontier,
    /// Wide nodes of the next level.
    below: Frontier,
    /// Tree nodes of the leaves that straddle a plane.
    leaves: Frontier,
}

thread_local! {
    static SCRATCH: Cell<Option<Box<Scratch>>> = const { Cell::new(None) };
}

/// Number of points that descend together.
///
/// Enough to hide the waits for memory, few enough for their data to stay in the
/// nearest caches.
pub const GROUP: usize = 64;

/// A point and the node that its descent has reached.
#[derive(Clone, Copy, Default, Debug)]
pub struct Cursor {
    /// Index of the point in its group.
    pub point: u32,
    /// Index of a node; in treelets, of a treelet or leaf.
    pub at: u32,
}

/// Fewest items of a tree whose points are searched for in turn. Smaller trees fit
/// the caches, where there are no misses to overlap (docs/adr/0009).
const INTERLEAVED_FROM: usize = 1 << 18;

impl PackedTree {
    /// Passes every item that the volume sees to the sink: items that hold a point in
    /// tree order; items of a frustum by level, accepted subtrees first, then the
    /// tested items of leaves.
    #[inline(always)]
    pub fn query<Q: QueryVolume, C: Context>(&self, volume: &Q, cx: &mut C) -> ControlFlow<()> {
        let isa = cx.isa();
        let (sink, recorder) = cx.parts();
        match Q::IS_POINT {
            true => self.walk(isa, volume, sink, recorder),
            false => self.search(isa, volume, sink, recorder),
        }
    }

    /// Searches level by level for the items of a volume.
    ///
    /// Sink and recorder are separate parameters here and in all functions that loop
    /// over nodes or blocks, because the compiler can assume that references passed
    /// as parameters do not alias.
    #[inline(always)]
    fn search<I: Isa, Q: QueryVolume, S: Sink, R: Recorder>(
        &self,
        isa: I,
        volume: &Q,
        sink: &mut S,
        recorder: &mut R,
    ) -> ControlFlow<()> {
        let (nodes, ids) = (self.nodes(), self.ids());
        let Some(root) = nodes.first() else {
            return ControlFlow::Continue(());
        };
        recorder.nodes_tested(1);
        let (containment, mask) = volume.classify(&root.bounds, volume.mask(), recorder);
        match containment {
            Containment::Outside => {
                recorder.subtrees_rejected(1);
                return ControlFlow::Continue(());
            }
            Containment::Inside => {
                recorder.subtree_accepted(ids.len());
                return sink.accept_range(isa, ids, 0..ids.len());
            }
            Containment::Straddles => {}
        }
        let mut scratch = take(&SCRATCH);
        let mut flow = self.search_wide_nodes(isa, (volume, mask), &mut scratch, sink, recorder);
        if flow.is_continue() {
            flow = self.test_leaves(isa, volume, &scratch.leaves, sink, recorder);
        }
        put_back(&SCRATCH, scratch);
        flow
    }

    /// Passes accepted subtrees to the sink and collects the leaves that straddle
    /// a plane. The root straddles the planes of `mask`.
    #[inline(always)]
    fn search_wide_nodes<I: Isa, Q: QueryVolume, S: Sink, R: Recorder>(
        &self,
        isa: I,
        (volume, mask): (&Q, PlaneMask),
        scratch: &mut Scratch,
        sink: &mut S,
        recorder: &mut R,
    ) -> ControlFlow<()> {
        let (wide, ids) = (&self.wide_nodes, self.ids());
        let far = is_far(ids.len());
        let Scratch {
            here,
            below,
            leaves,
        } = scratch;
        let (mut here, mut below) = (here, below);
        // The root's wide node; or the root itself, if it is a leaf.
        let start = (isa.iota(0), isa.splat_word(mask));
        let is_leaf = wide.blocks.is_empty();
        here.clear(1);
        leaves.clear(1);
        here.push(isa, start.0, start.1, LaneMask::from(!is_leaf));
        leaves.push(isa, start.0, start.1, LaneMask::from(is_leaf));
        while here.len() > 0 {
            let (entries, masks) = here.entries();
            below.clear(entries.len());
            leaves.make_room(entries.len());
            let mut run = Merger::default();
            for i in first_ahead(far) {
                wide.prefetch(entries, i);
            }
            for (i, (&at, &mask)) in pairs(entries, masks).enumerate() {
                if far {
                    wide.prefetch(entries, i + AHEAD);
                }
                let links = &wide.links[at as usize];
                let lanes = links.lanes.count_ones();
                recorder.nodes_tested(lanes);
                recorder.planes_tested(lanes * Q::planes_open(mask));
                let (kept, open) = volume.sorted_lanes(isa, &wide.blocks[at as usize], mask);
                let kept = kept & links.lanes;
                recorder.subtrees_rejected((links.lanes & !kept).count_ones());
                let inside = isa.zeros(open) & kept;
                let undecided = kept & !inside;
                let words = isa.words(&links.below);
                below.push(isa, words, open, undecided & !links.leaves);
                leaves.push(isa, words, open, undecided & links.leaves);
                let mut left = inside;
                while left != 0 {
                    let lane = left.trailing_zeros() as usize % LANES;
                    left &= left - 1;
                    let items = links.first[lane] as usize..links.end[lane] as usize;
                    if let Some(ended) = run.join(items) {
                        pass_run(isa, ended, ids, sink, recorder)?;
                    }
                }
            }
            pass_run(isa, run.take(), ids, sink, recorder)?;
            std::mem::swap(&mut here, &mut below);
        }
        ControlFlow::Continue(())
    }

    /// Tests the items of leaves against the planes that are open for each leaf.
    #[inline(always)]
    fn test_leaves<I: Isa, Q: QueryVolume, S: Sink, R: Recorder>(
        &self,
        isa: I,
        volume: &Q,
        leaves: &Frontier,
        sink: &mut S,
        recorder: &mut R,
    ) -> ControlFlow<()> {
        let nodes = self.nodes();
        let far = is_far(self.ids().len());
        let (entries, masks) = leaves.entries();
        for i in first_ahead(far) {
            prefetch_leaf(nodes, entries, i);
        }
        for i in first_ahead(far).take(AHEAD / 2) {
            self.prefetch_tests(volume, (entries, masks), i);
        }
        for (i, (&leaf, &mask)) in pairs(entries, masks).enumerate() {
            if far {
                self.prefetch_tests(volume, (entries, masks), i + AHEAD / 2);
                prefetch_leaf(nodes, entries, i + AHEAD);
            }
            let items = nodes[leaf as usize].items();
            self.test_items(isa, items, (volume, mask), sink, recorder)?;
        }
        ControlFlow::Continue(())
    }

    /// Prefetches the items of a leaf, whose node is in the cache by now.
    #[inline(always)]
    fn prefetch_tests<Q: QueryVolume>(
        &self,
        volume: &Q,
        (entries, masks): (&[u32], &[PlaneMask]),
        i: usize,
    ) {
        if let (Some(&leaf), Some(&mask)) = (entries.get(i), masks.get(i)) {
            let items = self.nodes()[leaf as usize].items();
            for (start, _, block) in self.boxes().range(items.start, items.end) {
                volume.prefetch(block, mask);
                prefetch(&self.ids()[start]);
            }
        }
    }

    /// Passes every item that the volume sees to the sink, in tree order.
    ///
    /// One pass over the nodes in memory order: it jumps over a rejected subtree,
    /// passes an accepted one as a single slice, and keeps the open planes of a
    /// straddling one for all nodes up to its end.
    #[inline(always)]
    pub fn walk<I: Isa, Q: QueryVolume, S: Sink, R: Recorder>(
        &self,
        isa: I,
        volume: &Q,
        sink: &mut S,
        recorder: &mut R,
    ) -> ControlFlow<()> {
        let (nodes, ids) = (self.nodes(), self.ids());
        let mut top = (nodes.len() as u32, volume.mask());
        // End and open planes of the straddling nodes around the present one; the
        // first entry is never popped.
        let mut below = Stack::new(top);
        let mut at = 0;
        while let Some(node) = nodes.get(at as usize) {
            while at >= top.0 {
                top = below.pop().unwrap_or(top);
            }
            recorder.nodes_tested(1);
            let (containment, mask) = volume.classify(&node.bounds, top.1, recorder);
            match containment {
                Containment::Outside => {
                    recorder.subtrees_rejected(1);
                    at = node.after;
                }
                Containment::Inside => {
                    recorder.subtree_accepted(node.count as usize);
                    sink.accept_range(isa, ids, node.items())?;
                    at = node.after;
                }
                Containment::Straddles => {
                    at += 1;
                    if node.after == at {
                        self.test_items(isa, node.items(), (volume, mask), sink, recorder)?;
                    } else {
                        below.push(top);
                        top = (node.after, mask);
                    }
                }
            }
        }
        ControlFlow::Continue(())
    }

    /// Tests items block by block and passes those that are kept to the sink.
    #[inline(always)]
    pub fn test_items<I: Isa, Q: QueryVolume, S: Sink, R: Recorder>(
        &self,
        isa: I,
        items: Range<usize>,
        (volume, mask): (&Q, PlaneMask),
        sink: &mut S,
        recorder: &mut R,
    ) -> ControlFlow<()> {
        let blocks = self.boxes().range(items.start, items.end);
        scan_blocks(isa, blocks, self.ids(), (volume, mask), sink, recorder)
    }

    /// Prefetches the bounds and ids of some items.
    #[inline(always)]
    pub fn prefetch_items(&self, items: Range<usize>) {
        for (start, _, block) in self.boxes().range(items.start, items.end) {
            block.prefetch();
            prefetch(&self.ids()[start]);
        }
    }

    /// Region search for many points by the nodes' bounds.
    ///
    /// See [`RegionIndex::query_many`](crate::index::RegionIndex::query_many).
    #[inline(always)]
    pub fn query_many<I: Isa, S: ManySink>(
        &self,
        isa: I,
        points: &[Vec3],
        sink: &mut S,
    ) -> ControlFlow<()> {
        if self.ids().len() >= INTERLEAVED_FROM {
            return self.query_interleaved(points, sink);
        }
        let mut ids = Vec::new();
        for (p, point) in points.iter().zip(0..) {
            ids.clear();
            // A Vec never breaks off.
            let _ = self.query(p, &mut QueryContext::new(isa, &mut ids, &mut NoRecorder));
            sink.accept(point, &ids)?;
        }
        ControlFlow::Continue(())
    }

    /// Region search for groups of points whose steps alternate.
    ///
    /// Each point of a group advances by one node in turn, so that their cache misses
    /// overlap.
    #[inline(always)]
    fn query_interleaved<S: ManySink>(&self, points: &[Vec3], sink: &mut S) -> ControlFlow<()> {
        let nodes = self.nodes();
        let (mut leaves, mut ids) = (Vec::new(), Vec::new());
        let mut open: Vec<Cursor> = Vec::with_capacity(GROUP);
        for (group, first) in points.chunks(GROUP).zip((0..).step_by(GROUP)) {
            open.extend((0..group.len() as u32).map(|point| Cursor { point, at: 0 }));
            while !open.is_empty() {
                let mut kept = 0;
                for i in 0..open.len() {
                    let Cursor { point, at } = open[i];
                    // An empty tree has no node 0.
                    let Some(node) = nodes.get(at as usize) else {
                        continue;
                    };
                    let next = if node.bounds.contains_point(group[point as usize]) {
                        if self.is_leaf(at as usize) {
                            leaves.push(open[i]);
                        }
                        at as usize + 1
                    } else {
                        node.after()
                    };
                    if let Some(next) = nodes.get(next) {
                        prefetch(next);
                    }
                    open[kept] = Cursor {
                        point,
                        at: next as u32,
                    };
                    kept += 1;
                }
                open.truncate(kept);
            }
            // Stable: within a point the leaves are in tree order.
            leaves.sort_by_key(|leaf: &Cursor| leaf.point);
            let items_of = |leaf: u32| nodes[leaf as usize].items();
            self.answer_group(group, first, &leaves, items_of, &mut ids, sink)?;
            leaves.clear();
        }
        ControlFlow::Continue(())
    }

    /// Tests the items of the leaves that a group of points has reached.
    ///
    /// Passes the answers to the sink, point by point. `leaves` are in the order of
    /// the points, `first` is the index of the group's first point, `ids` is scratch.
    #[inline(always)]
    pub fn answer_group<S: ManySink>(
        &self,
        group: &[Vec3],
        first: u32,
        leaves: &[Cursor],
        items_of: impl Fn(u32) -> Range<usize>,
        ids: &mut Vec<ItemId>,
        sink: &mut S,
    ) -> ControlFlow<()> {
        for leaf in leaves {
            self.prefetch_items(items_of(leaf.at));
        }
        ids.clear();
        let mut ends = [0; GROUP];
        for leaf in leaves {
            let (items, p) = (items_of(leaf.at), group[leaf.point as usize]);
            for (start, lanes, block) in self.boxes().range(items.start, items.end) {
                let mut holding = block.holding(p) & lanes;
                while holding != 0 {
                    ids.push(self.ids()[start + holding.trailing_zeros() as usize]);
                    holding &= holding - 1;
                }
            }
            ends[leaf.point as usize] = ids.len();
        }
        let mut from = 0;
        for (end, point) in ends[..group.len()].iter().zip(first..) {
            // A point without a leaf has no end; its list is empty.
            let end = from.max(*end);
            sink.accept(point, &ids[from..end])?;
            from = end;
        }
        ControlFlow::Continue(())
    }
}

#[inline(always)]
fn prefetch_leaf(nodes: &[TreeNode], entries: &[u32], i: usize) {
    if let Some(&leaf) = entries.get(i) {
        prefetch(&nodes[leaf as usize]);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::Aabb;
    use crate::kernel::BASELINE;
    use crate::query::Located;

    /// Overlapping boxes in three levels: ten branches of three leaves of ten items.
    fn tree() -> PackedTree {
        PackedTree::grow(
            300,
            (0, 0..30),
            |tree, _, (level, leaves), groups| match level {
                0 => groups.extend((0..10).map(|branch| (1, 3 * branch..3 * branch + 3))),
                1 => groups.extend(leaves.map(|leaf| (2, leaf..leaf + 1))),
                _ => {
                    for item in 0..10 {
                        let (leaf, id) = (leaves.start, leaves.start * 10 + item);
                        let centre = [leaf / 3, leaf % 3, item].map(|x| x as f32);
                        let centre = Vec3::from_array(centre) * Vec3::new(1.0, 1.0, 0.3);
                        tree.push(id, &Aabb::around(centre, Vec3::splat(0.75)));
                    }
                }
            },
        )
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
            assert!(tree.query_interleaved(&points, &mut turns).is_continue());
            assert!(tree.query_many(BASELINE, &points, &mut alone).is_continue());
            assert_eq!(turns, alone);
            assert_eq!(turns.len(), points.len());
            assert_eq!(turns.ids().is_empty(), tree.ids().is_empty());
        }
    }
}
