//! Queries of the packed tree, the same for every builder.
//!
//! [`PackedTree::query`] descends level by level through the wide nodes for a volume; for a point
//! it calls [`PackedTree::locate`], one pass along the nodes in memory order.

use std::cell::Cell;
use std::ops::{ControlFlow, Range};

use glam::Vec3;

use super::node::TreeNode;
use super::packed::PackedTree;
use crate::geometry::{LANES, LaneMask, PlaneMask};
use crate::index::frontier::{
    AHEAD, Frontier, Merger, first_ahead, is_far, pass_run, put_back, take,
};
use crate::index::linear::scan_blocks;
use crate::kernel::{Isa, pairs, prefetch};
use crate::query::{Containment, Context, Predicate, QueryVolume, Recorder};

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

impl PackedTree {
    /// Passes every item that the volume sees to the sink.
    ///
    /// Items that hold a point come in tree order; items of a frustum by level, accepted subtrees
    /// first, then the tested items of leaves.
    #[inline(always)]
    pub fn query<Q: QueryVolume, C: Context>(&self, volume: &Q, cx: &mut C) -> ControlFlow<()> {
        if !Q::IS_POINT {
            return self.search(volume, cx);
        }
        match volume.as_point() {
            Some(p) => self.locate(p, cx),
            None => ControlFlow::Continue(()),
        }
    }

    /// Searches level by level for the items of a volume.
    #[inline(always)]
    fn search<Q: QueryVolume, C: Context>(&self, volume: &Q, cx: &mut C) -> ControlFlow<()> {
        let (nodes, ids) = (self.nodes(), self.ids());
        let Some(root) = nodes.first() else {
            return ControlFlow::Continue(());
        };
        cx.recorder().nodes_tested(1);
        let (containment, mask) = volume.classify(&root.bounds, volume.mask(), cx.recorder());
        match containment {
            Containment::Outside => {
                cx.recorder().subtrees_rejected(1);
                return ControlFlow::Continue(());
            }
            Containment::Inside => return pass_run(0..ids.len(), ids, cx),
            Containment::Straddles => {}
        }
        let mut scratch = take(&SCRATCH);
        let mut flow = self.search_wide_nodes((volume, mask), &mut scratch, cx);
        if flow.is_continue() {
            flow = self.test_leaves(volume, &scratch.leaves, cx);
        }
        put_back(&SCRATCH, scratch);
        flow
    }

    /// Passes accepted subtrees to the sink and collects the straddling leaves.
    ///
    /// The root straddles the planes of `mask`.
    #[inline(always)]
    fn search_wide_nodes<Q: QueryVolume, C: Context>(
        &self,
        (volume, mask): (&Q, PlaneMask),
        scratch: &mut Scratch,
        cx: &mut C,
    ) -> ControlFlow<()> {
        let isa = cx.isa();
        let (wide, ids) = (&self.wide_nodes, self.ids());
        let far = is_far(ids.len());
        let (mut here, mut below) = (&mut scratch.here, &mut scratch.below);
        let leaves = &mut scratch.leaves;
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
                cx.recorder().nodes_tested(lanes);
                cx.recorder().planes_tested(lanes * Q::planes_open(mask));
                let (kept, open) = volume.sorted_lanes(isa, &wide.blocks[at as usize], mask);
                let kept = kept & links.lanes;
                cx.recorder()
                    .subtrees_rejected((links.lanes & !kept).count_ones());
                let inside = isa.equal(open, 0) & kept;
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
                        pass_run(ended, ids, cx)?;
                    }
                }
            }
            pass_run(run.take(), ids, cx)?;
            std::mem::swap(&mut here, &mut below);
        }
        ControlFlow::Continue(())
    }

    /// Tests the items of leaves against the planes that are open for each leaf.
    #[inline(always)]
    fn test_leaves<Q: QueryVolume, C: Context>(
        &self,
        volume: &Q,
        leaves: &Frontier,
        cx: &mut C,
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
            self.test_items(items, (volume, mask), cx)?;
        }
        ControlFlow::Continue(())
    }

    /// Prefetches the items of a leaf, whose node has arrived in the cache.
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

    /// Passes every item whose closed box holds `p` to the sink, in tree order.
    ///
    /// One pass over the nodes in memory order, which skips rejected subtrees.
    #[inline(always)]
    fn locate<C: Context>(&self, p: Vec3, cx: &mut C) -> ControlFlow<()> {
        let nodes = self.nodes();
        let mut at = 0;
        while let Some(node) = nodes.get(at) {
            cx.recorder().nodes_tested(1);
            if !node.bounds.contains_point(p) {
                cx.recorder().subtrees_rejected(1);
                at = node.after();
                continue;
            }
            at += 1;
            if node.after() == at {
                self.test_items(node.items(), (&p, p.mask()), cx)?;
            }
        }
        ControlFlow::Continue(())
    }

    /// Tests items block by block and passes those that are kept to the sink.
    #[inline(always)]
    pub fn test_items<Q: QueryVolume, C: Context>(
        &self,
        items: Range<usize>,
        asked: (&Q, PlaneMask),
        cx: &mut C,
    ) -> ControlFlow<()> {
        let blocks = self.boxes().range(items.start, items.end);
        scan_blocks(blocks, self.ids(), asked, cx)
    }
}

#[inline(always)]
fn prefetch_leaf(nodes: &[TreeNode], entries: &[u32], i: usize) {
    if let Some(&leaf) = entries.get(i) {
        prefetch(&nodes[leaf as usize]);
    }
}
