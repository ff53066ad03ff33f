//! The nodes of a tree once more, sixteen a bundle: what views traverse, level
//! by level, with one block test for sixteen nodes. It owns how nodes are
//! bundled and that traversal; the nodes themselves are the tree's.

use std::cell::Cell;
use std::ops::{ControlFlow, Range};

use super::frontier::{AHEAD, Frontier, Merger, first_ahead, hand_over, is_far, put_back, take};
use super::node::TreeNode;
use crate::geometry::{Aabb, BoxBlock, BoxBlocks, LANES, LaneMask, PlaneMask};
use crate::kernel::{Isa, pairs, prefetch};
use crate::query::{ItemId, QueryVolume, Recorder, Sink};

/// Where the lanes of a bundle lead.
#[derive(Clone, Copy)]
#[repr(C, align(64))]
struct Links {
    /// The bundle of a lane's children; for a leaf, its node.
    below: [u32; LANES],
    first: [u32; LANES],
    end: [u32; LANES],
    /// Lanes that hold a node.
    lanes: LaneMask,
    /// Those of them that are leaves.
    leaves: LaneMask,
}

/// A tree of bundles: the descendants of one node that are tested together, in
/// tree order. 40 bytes a lane.
#[derive(Default)]
pub struct Bundles {
    blocks: Vec<BoxBlock>,
    links: Vec<Links>,
    /// The lane of each node, counted over all bundles; or [`NOWHERE`].
    lane_of: Vec<u32>,
    /// Whether some lane stands for several siblings.
    groups: bool,
}

/// Mark of a node whose children were bundled in its place.
const NOWHERE: u32 = u32::MAX;

/// The items of leaves that are not decided, in blocks of sixteen.
pub struct Leaves<'a, Q> {
    pub boxes: &'a BoxBlocks,
    pub ids: &'a [ItemId],
    pub volume: &'a Q,
}

impl<Q: QueryVolume> Leaves<'_, Q> {
    /// Asks for the memory of some items ahead of their test.
    #[inline(always)]
    fn fetch(&self, items: Range<usize>, mask: PlaneMask) {
        for (start, _, block) in self.boxes.range(items.start, items.end) {
            self.volume.prefetch(block, mask);
            prefetch(&self.ids[start]);
        }
    }

    /// Tests some items against the planes of the mask and hands over those that
    /// are kept.
    #[inline(always)]
    pub fn test<I: Isa, S: Sink, R: Recorder>(
        &self,
        isa: I,
        items: Range<usize>,
        mask: PlaneMask,
        sink: &mut S,
        recorder: &mut R,
    ) -> ControlFlow<()> {
        let blocks = self.boxes.range(items.start, items.end);
        scan_blocks(isa, blocks, self.ids, (self.volume, mask), sink, recorder)
    }
}

/// Tests items in blocks (each with the place of its lane 0 and the lanes that
/// count) and hands over runs of admitted ones: the leaf test of every tree and
/// region search in the linear scan.
#[inline(always)]
pub fn scan_blocks<'b, I: Isa, Q: QueryVolume, S: Sink, R: Recorder>(
    isa: I,
    blocks: impl Iterator<Item = (usize, LaneMask, &'b BoxBlock)>,
    ids: &[ItemId],
    (volume, mask): (&Q, PlaneMask),
    sink: &mut S,
    recorder: &mut R,
) -> ControlFlow<()> {
    for (start, lanes, block) in blocks {
        let tested = lanes.count_ones();
        recorder.items_tested(tested);
        recorder.planes_tested(tested * Q::planes_open(mask));
        let admitted = volume.kept_lanes(isa, block, mask) & lanes;
        if admitted != 0 {
            sink.accept_lanes(isa, ids, start, admitted)?;
        }
    }
    ControlFlow::Continue(())
}

/// The memory of a traversal, kept between queries.
#[derive(Default)]
struct Scratch {
    here: Frontier,
    below: Frontier,
    leaves: Frontier,
}

thread_local! {
    static SCRATCH: Cell<Option<Box<Scratch>>> = const { Cell::new(None) };
}

/// Siblings that become the lanes of one bundle, or several lanes' worth of
/// them: a range of depth-first order with none of their ancestors.
type Siblings = Vec<u32>;

impl Bundles {
    /// Bundles the nodes of a tree in depth-first order. Nodes are opened, the
    /// one with the largest surface first, as long as their children fit: it
    /// is the likeliest to straddle (Wald, Benthin and Boulos 2008, "Getting
    /// rid of packets", p. 52). O(nodes).
    pub fn of(nodes: &[TreeNode]) -> Bundles {
        let mut bundles = Bundles {
            lane_of: vec![NOWHERE; nodes.len()],
            ..Bundles::default()
        };
        let is_leaf = |node: u32| nodes[node as usize].after() == node as usize + 1;
        let children = |node: u32| {
            let end = nodes[node as usize].after();
            let mut child = node as usize + 1;
            std::iter::from_fn(move || {
                (child < end).then(|| {
                    let this = child as u32;
                    child = nodes[child].after();
                    this
                })
            })
        };
        if nodes.is_empty() || is_leaf(0) {
            return bundles;
        }
        // Breadth first, so that bundles of one level lie together.
        let mut waiting = std::collections::VecDeque::from([children(0).collect::<Siblings>()]);
        let mut promised = 1;
        while let Some(siblings) = waiting.pop_front() {
            let mut lanes: Vec<Siblings> = if siblings.len() > LANES {
                let share = siblings.len().div_ceil(LANES);
                siblings.chunks(share).map(<[u32]>::to_vec).collect()
            } else {
                siblings.into_iter().map(|node| vec![node]).collect()
            };
            let mut costs: Vec<f32> = lanes.iter().map(|lane| area(nodes, lane)).collect();
            loop {
                let fits = |lane: &Siblings| match lane[..] {
                    [node] if !is_leaf(node) => lanes.len() + children(node).count() <= LANES + 1,
                    _ => false,
                };
                let largest = (0..lanes.len())
                    .filter(|&i| fits(&lanes[i]))
                    .max_by(|&a, &b| costs[a].total_cmp(&costs[b]));
                let Some(lane) = largest else { break };
                let opened: Vec<Siblings> =
                    children(lanes[lane][0]).map(|node| vec![node]).collect();
                costs.splice(lane..=lane, opened.iter().map(|lane| area(nodes, lane)));
                lanes.splice(lane..=lane, opened);
            }
            bundles.add(nodes, &lanes, &mut promised, |lane| match lane[..] {
                [node] if is_leaf(node) => None,
                [node] => {
                    waiting.push_back(children(node).collect());
                    Some(())
                }
                _ => {
                    waiting.push_back(lane.clone());
                    Some(())
                }
            });
        }
        bundles.blocks.shrink_to_fit();
        bundles.links.shrink_to_fit();
        bundles
    }

    /// Writes one bundle. `descend` queues the children of a lane, unless it is
    /// a leaf; their bundle is the next one promised.
    fn add(
        &mut self,
        nodes: &[TreeNode],
        lanes: &[Siblings],
        promised: &mut u32,
        mut descend: impl FnMut(&Siblings) -> Option<()>,
    ) {
        let mut block = BoxBlock::EMPTY;
        let mut links = Links {
            below: [0; LANES],
            first: [0; LANES],
            end: [0; LANES],
            lanes: 0,
            leaves: 0,
        };
        for (lane, siblings) in lanes.iter().enumerate() {
            block.set(lane, &bounds_of(nodes, siblings));
            match siblings[..] {
                [node] => {
                    self.lane_of[node as usize] = (self.blocks.len() * LANES + lane) as u32;
                }
                _ => self.groups = true,
            }
            let (first, last) = (siblings[0] as usize, siblings[siblings.len() - 1] as usize);
            links.first[lane] = nodes[first].items().start as u32;
            links.end[lane] = nodes[last].items().end as u32;
            links.lanes |= 1 << lane;
            if descend(siblings).is_some() {
                links.below[lane] = *promised;
                *promised += 1;
            } else {
                links.below[lane] = siblings[0];
                links.leaves |= 1 << lane;
            }
        }
        self.blocks.push(block);
        self.links.push(links);
    }

    /// Takes over a node's new bounds. False if the bundles must be made anew:
    /// some lane stands for several siblings, whose union is nobody's bounds.
    #[must_use]
    pub fn fit(&mut self, node: usize, bounds: &Aabb) -> bool {
        let lane = self.lane_of[node];
        if lane != NOWHERE {
            let lane = lane as usize;
            self.blocks[lane / LANES].set(lane % LANES, bounds);
        }
        !self.groups
    }

    /// Asks for the memory of an entry of the frontier ahead of its turn, if
    /// there is such an entry.
    #[inline(always)]
    fn fetch(&self, places: &[u32], i: usize) {
        if let Some(&next) = places.get(i)
            && let Some(block) = self.blocks.get(next as usize)
        {
            block.prefetch();
            let links = &self.links[next as usize];
            prefetch(&links.below);
            prefetch(&links.lanes);
        }
    }

    pub fn bytes(&self) -> usize {
        size_of_val(&self.blocks[..])
            + size_of_val(&self.links[..])
            + size_of_val(&self.lane_of[..])
    }

    /// Hands over the items of accepted subtrees, and leaves the items of
    /// undecided leaves to `test`, with the planes that are open there.
    ///
    /// The tree's root straddles the planes of `mask`.
    #[inline(always)]
    pub fn search<I: Isa, Q: QueryVolume, S: Sink, R: Recorder>(
        &self,
        isa: I,
        (nodes, ids): (&[TreeNode], &[ItemId]),
        (volume, mask): (&Q, PlaneMask),
        items: &Leaves<Q>,
        sink: &mut S,
        recorder: &mut R,
    ) -> ControlFlow<()> {
        let far = is_far(ids.len());
        let mut scratch = take(&SCRATCH);
        let Scratch {
            here,
            below,
            leaves,
        } = &mut *scratch;
        let (mut here, mut below) = (here, below);
        // The root's bundle; or the root itself, if it is a leaf.
        let start = (isa.iota(0), isa.splat_word(mask));
        here.clear(1);
        leaves.clear(1);
        here.push(
            isa,
            start.0,
            start.1,
            LaneMask::from(!self.blocks.is_empty()),
        );
        leaves.push(
            isa,
            start.0,
            start.1,
            LaneMask::from(self.blocks.is_empty()),
        );
        let mut flow = ControlFlow::Continue(());
        'walk: while !here.entries().0.is_empty() {
            let (places, masks) = here.entries();
            below.clear(places.len());
            leaves.make_room(places.len());
            let mut run = Merger::default();
            for i in first_ahead(far) {
                self.fetch(places, i);
            }
            for (i, (&at, &mask)) in pairs(places, masks).enumerate() {
                if far {
                    self.fetch(places, i + AHEAD);
                }
                let links = &self.links[at as usize];
                let lanes = links.lanes.count_ones();
                recorder.nodes_tested(lanes);
                recorder.planes_tested(lanes * Q::planes_open(mask));
                let (kept, open) = volume.sorted_lanes(isa, &self.blocks[at as usize], mask);
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
                    let places = links.first[lane] as usize..links.end[lane] as usize;
                    if let Some(ended) = run.join(places) {
                        flow = hand_over(isa, ended, ids, sink, recorder);
                        if flow.is_break() {
                            break 'walk;
                        }
                    }
                }
            }
            flow = hand_over(isa, run.take(), ids, sink, recorder);
            if flow.is_break() {
                break;
            }
            std::mem::swap(&mut here, &mut below);
        }
        if flow.is_continue() {
            let (places, masks) = leaves.entries();
            for i in first_ahead(far) {
                fetch_leaf(nodes, places, i);
            }
            for i in first_ahead(far).take(AHEAD / 2) {
                fetch_items(nodes, items, places, masks, i);
            }
            for (i, (&leaf, &mask)) in pairs(places, masks).enumerate() {
                if far {
                    fetch_items(nodes, items, places, masks, i + AHEAD / 2);
                    fetch_leaf(nodes, places, i + AHEAD);
                }
                let own = nodes[leaf as usize].items();
                flow = items.test(isa, own, mask, sink, recorder);
                if flow.is_break() {
                    break;
                }
            }
        }
        put_back(&SCRATCH, scratch);
        flow
    }
}

/// Asks for the node of a leaf, if there is such an entry.
#[inline(always)]
fn fetch_leaf(nodes: &[TreeNode], places: &[u32], i: usize) {
    if let Some(&leaf) = places.get(i) {
        prefetch(&nodes[leaf as usize]);
    }
}

/// Asks for the items of a leaf, whose node has arrived by now.
#[inline(always)]
fn fetch_items<Q: QueryVolume>(
    nodes: &[TreeNode],
    items: &Leaves<Q>,
    places: &[u32],
    masks: &[PlaneMask],
    i: usize,
) {
    if let (Some(&leaf), Some(&mask)) = (places.get(i), masks.get(i)) {
        items.fetch(nodes[leaf as usize].items(), mask);
    }
}

fn bounds_of(nodes: &[TreeNode], siblings: &[u32]) -> Aabb {
    let bounds = siblings.iter().map(|&node| nodes[node as usize].bounds);
    bounds.fold(Aabb::EMPTY, |all, b| all.union(&b))
}

/// Half the surface of what a lane bounds.
fn area(nodes: &[TreeNode], siblings: &[u32]) -> f32 {
    bounds_of(nodes, siblings).half_area()
}
