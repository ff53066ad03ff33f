//! The linear scans: every box against every plane, O(n).
//!
//! `linear-scalar` is the textbook loop. `linear` gives the same answer from blocks of sixteen
//! boxes; every speed-up is relative to it.

use std::ops::{ControlFlow, Range};

use serde::{Deserialize, Serialize};

use super::items::{ABSENT, PaddedIds, Positions, indexable};
use super::shared_query::{in_parts, workers};
use super::{BuildError, Info, Input, Kind, MemoryUsage, NoParams, RegionIndex};
use crate::geometry::{Aabb, BallBlocks, Balls, BoxBlock, BoxBlocks, LANES, LaneMask, PlaneMask};
use crate::kernel::{Isa, Piece, first_lanes, pairs};
use crate::query::{
    Context, ItemId, NoRecorder, Planes, QueryContext, QueryVolume, Recorder, Sink, Tests,
};
use crate::threads::Workers;

/// The plain loop over an array of boxes.
///
/// The test of a box ends at the first plane that excludes it. O(n) per query.
pub struct LinearScalar {
    boxes: Vec<Aabb>,
    ids: Vec<ItemId>,
}

impl RegionIndex for LinearScalar {
    const INFO: Info = Info::ours(
        "linear-scalar",
        "the textbook loop over all boxes, O(n)",
        Kind::Scan,
    );
    type Params = NoParams;

    fn build(input: &Input<'_>, _: &NoParams) -> Result<Self, BuildError> {
        let items = input.items;
        let ids = indexable(items)?;
        let boxes = ids.iter().map(|&id| items[id as usize]).collect();
        Ok(LinearScalar { boxes, ids })
    }

    fn memory(&self) -> MemoryUsage {
        MemoryUsage {
            node_bytes: 0,
            item_bytes: size_of_val(&self.boxes[..]) + size_of_val(&self.ids[..]),
        }
    }

    #[inline(always)]
    fn query<Q: QueryVolume, C: Context>(&self, volume: &Q, cx: &mut C) -> ControlFlow<()> {
        let mask = volume.mask();
        for (b, id) in pairs(&self.boxes, &self.ids) {
            cx.recorder().items_tested(1);
            if volume.admits(b, mask, cx.recorder()) {
                cx.accept(std::slice::from_ref(id))?;
            }
        }
        ControlFlow::Continue(())
    }
}

/// Number of blocks that one call of the sink tests: 64 KiB of ids.
const BLOCKS_PER_CALL: usize = 1024;

/// Fewest blocks of a scan that threads share: 131,072 items.
///
/// Waking the threads takes as long as scanning half that number.
const LEAST_SHARED: usize = 8 * BLOCKS_PER_CALL;

/// The scan over blocks: all planes against sixteen boxes at once, no early exit.
///
/// O(n) per query, with a constant several times smaller.
pub struct Linear {
    boxes: BoxBlocks,
    pub(super) ids: PaddedIds,
    positions: Positions,
    /// Spheres of the items, if they are [spheres](Input::spheres).
    balls: Option<BallBlocks>,
    /// True if the farthest item has come nearer.
    is_nearer: bool,
    workers: Option<Workers>,
}

defaults! {
    /// Parameters: `linear:threads=2`.
    #[derive(Clone, Copy, Debug, Serialize, Deserialize)]
    #[serde(default, deny_unknown_fields)]
    pub struct LinearParams {
        /// Threads per frustum query, which share the blocks.
        #[serde(skip_serializing_if = "is_one")]
        pub threads: usize = 1,
    }
}

fn is_one(threads: &usize) -> bool {
    *threads == 1
}

impl Linear {
    /// Sets the bounds of the item at a position.
    #[inline(always)]
    fn set(&mut self, position: usize, bounds: &Aabb) {
        if let Some(balls) = &mut self.balls {
            let [before, now] =
                [self.boxes.get(position), *bounds].map(|b| b.reach().max_element());
            self.is_nearer |= before >= balls.reach && now < before;
            balls.set(position, bounds);
        }
        self.boxes.set(position, bounds);
    }

    /// Removes the item at a position; the last item takes its place.
    fn remove(&mut self, position: usize, id: ItemId) {
        if let Some(last) = self.ids.pop() {
            let bounds = self.boxes.get(self.ids.len());
            self.set(position, if last == id { &Aabb::EMPTY } else { &bounds });
            self.boxes.pop();
            if last != id {
                self.ids.set(position, last);
                self.positions.set(last, position as u32);
            }
            self.positions.set(id, ABSENT);
        }
    }

    /// Tests a range of blocks against all planes; `open` is their number.
    #[inline(always)]
    fn scan_all<P: Planes<C::Isa>, C: Context>(
        &self,
        range: Range<usize>,
        open: u32,
        planes: P,
        balls: Option<Balls<'_>>,
        cx: &mut C,
    ) -> ControlFlow<()> {
        let isa = cx.isa();
        let (sink, recorder) = cx.parts();
        for first in range.clone().step_by(BLOCKS_PER_CALL) {
            let here = first..range.end.min(first + BLOCKS_PER_CALL);
            let balls = balls.map(|Balls { blocks, doubt }| Balls {
                blocks: &blocks[here.clone()],
                doubt,
            });
            let tests = BlockTests {
                blocks: &self.boxes.blocks()[here.clone()],
                planes,
                balls,
                items: self.ids.len() - first * LANES,
                open,
                recorder: &mut *recorder,
                four: [0; 4],
            };
            sink.accept_tested(isa, &self.ids.rows()[here], tests)?;
        }
        ControlFlow::Continue(())
    }

    /// Tests a range of blocks, on this thread.
    #[inline(always)]
    fn scan<Q: QueryVolume, C: Context>(
        &self,
        range: Range<usize>,
        volume: &Q,
        cx: &mut C,
    ) -> ControlFlow<()> {
        let mask = volume.mask();
        let open = Q::planes_open(mask);
        let balls = seen_by(self.balls.as_ref(), volume);
        if C::Isa::MANY_REGISTERS
            && let Some(planes) = volume.all_planes(cx.isa())
        {
            return self.scan_all(range, open, planes, balls, cx);
        }
        self.scan_all(range, open, (volume, mask), balls, cx)
    }
}

/// [`BLOCKS_PER_CALL`] blocks of a scan, compiled for the query's instruction set.
struct PartOfScan<'a, Q>(&'a Linear, &'a Q, usize, &'a mut Vec<ItemId>);

impl<I: Isa, Q: QueryVolume> Piece<I> for PartOfScan<'_, Q> {
    type Output = ();

    #[inline(always)]
    fn run(self, isa: I) {
        let PartOfScan(scan, volume, index, ids) = self;
        let first = index * BLOCKS_PER_CALL;
        let end = (first + BLOCKS_PER_CALL).min(scan.boxes.blocks().len());
        let recorder = &mut NoRecorder;
        let mut cx = QueryContext::new(isa, ids, recorder);
        // A Vec never ends the query.
        let _ = scan.scan(first..end, volume, &mut cx);
    }
}

impl RegionIndex for Linear {
    const INFO: Info = Info::ours(
        "linear",
        "scan over blocks of sixteen boxes, O(n)",
        Kind::Scan,
    )
    .refits();
    type Params = LinearParams;

    fn build(input: &Input<'_>, params: &LinearParams) -> Result<Self, BuildError> {
        let items = input.items;
        let ids = indexable(items)?;
        let cubes = || BallBlocks::of(ids.iter().map(|&id| items[id as usize]));
        Ok(Linear {
            balls: input.spheres.then(cubes),
            is_nearer: false,
            boxes: ids.iter().map(|&id| &items[id as usize]).collect(),
            ids: ids[..].into(),
            positions: Positions::default(),
            workers: workers(params.threads, Self::INFO.name)?,
        })
    }

    fn memory(&self) -> MemoryUsage {
        MemoryUsage {
            node_bytes: 0,
            item_bytes: self.boxes.bytes()
                + self.ids.bytes()
                + self.positions.bytes()
                + self.balls.as_ref().map_or(0, BallBlocks::bytes),
        }
    }

    #[inline(always)]
    fn query<Q: QueryVolume, C: Context>(&self, volume: &Q, cx: &mut C) -> ControlFlow<()> {
        if Q::IS_POINT {
            let blocks = self.boxes.range(0, self.ids.len());
            return scan_blocks(blocks, &self.ids, (volume, volume.mask()), cx);
        }
        let blocks = self.boxes.blocks().len();
        // Counted queries are not shared: one recorder, one thread.
        if size_of::<C::Recorder>() == 0
            && blocks >= LEAST_SHARED
            && let Some(workers) = &self.workers
        {
            let (isa, parts) = (cx.isa(), blocks.div_ceil(BLOCKS_PER_CALL));
            let part = |index: usize, ids: &mut Vec<ItemId>| {
                isa.run_outlined(PartOfScan(self, volume, index, ids));
            };
            return in_parts(workers, parts, part, cx);
        }
        self.scan(0..blocks, volume, cx)
    }

    /// O(moved): overwrites lanes. Items may become or cease to be empty.
    ///
    /// One more pass over all blocks if the farthest sphere has come nearer.
    fn refit(&mut self, items: &[Aabb], moved: &[ItemId]) -> bool {
        self.positions.prepare(self.ids.iter(), items.len());
        for (i, &id) in moved.iter().enumerate() {
            if let Some(position) = self.positions.ahead(items, moved, i) {
                self.boxes.prefetch(position);
            }
            let bounds = &items[id as usize];
            match (self.positions.of(id), bounds.is_empty()) {
                (Some(position), false) => self.set(position, bounds),
                (Some(position), true) => self.remove(position, id),
                (None, false) => {
                    let position = self.ids.len();
                    self.positions.set(id, position as u32);
                    self.ids.push(id);
                    self.boxes.push(bounds);
                    self.set(position, bounds);
                }
                (None, true) => {}
            }
        }
        if std::mem::take(&mut self.is_nearer)
            && let Some(balls) = &mut self.balls
        {
            let blocks = self.boxes.blocks().iter().map(BoxBlock::union);
            balls.reach = blocks.fold(0.0, |reach, b| b.reach().max_element().max(reach));
        }
        true
    }
}

/// The spheres of a structure for a query, if both have spheres.
#[inline(always)]
pub fn seen_by<'t, Q: QueryVolume>(balls: Option<&'t BallBlocks>, volume: &Q) -> Option<Balls<'t>> {
    balls?.seen_by(volume.as_spheres()?)
}

/// The tests of consecutive blocks against all planes, run by the sink.
struct BlockTests<'a, P, R> {
    blocks: &'a [BoxBlock],
    planes: P,
    balls: Option<Balls<'a>>,
    /// Number of items in these blocks and the following ones.
    items: usize,
    /// Number of open planes.
    open: u32,
    recorder: &'a mut R,
    /// Results of the four blocks that were tested together last.
    four: [LaneMask; 4],
}

impl<I: Isa, P: Planes<I>, R: Recorder> Tests<I> for BlockTests<'_, P, R> {
    const SPARSE: bool = true;

    #[inline(always)]
    fn count(&self) -> usize {
        self.blocks.len()
    }

    #[inline(always)]
    fn test(&mut self, isa: I, i: usize) -> (usize, LaneMask) {
        let lanes = first_lanes(self.items - i * LANES);
        self.recorder.items_tested(lanes.count_ones());
        let tests = lanes.count_ones() * self.open;
        self.recorder.planes_tested(tests);
        if P::SPHERES
            && let Some(balls) = &self.balls
        {
            let block = (i, &self.blocks[i]);
            return (i, self.planes.kept_balls(isa, balls, block) & lanes);
        }
        if !P::IN_FOURS {
            return (i, self.planes.kept(isa, &self.blocks[i]) & lanes);
        }
        if i.is_multiple_of(4) {
            self.four = match self.blocks[i..].first_chunk() {
                Some(blocks) => self.planes.kept_of_four(isa, blocks),
                None => {
                    let mut four = [0; 4];
                    for (k, block) in self.blocks[i..].iter().enumerate() {
                        four[k] = self.planes.kept(isa, block);
                    }
                    four
                }
            };
        }
        (i, self.four[i % 4] & lanes)
    }
}

/// Tests blocks of items and passes runs of visible items to the sink.
///
/// Each block comes with the position of its lane 0 and a mask of the lanes in use. This is the
/// leaf test of the packed trees and the region search of `linear`.
#[inline(always)]
pub fn scan_blocks<'b, Q: QueryVolume, C: Context>(
    blocks: impl Iterator<Item = (usize, LaneMask, &'b BoxBlock)>,
    ids: &[ItemId],
    (volume, mask): (&Q, PlaneMask),
    cx: &mut C,
) -> ControlFlow<()> {
    let isa = cx.isa();
    let (sink, recorder) = cx.parts();
    for (start, lanes, block) in blocks {
        let tested = lanes.count_ones();
        recorder.items_tested(tested);
        recorder.planes_tested(tested * Q::planes_open(mask));
        let kept = volume.kept_lanes(isa, block, mask) & lanes;
        if kept != 0 {
            sink.accept_lanes(isa, ids, start, kept)?;
        }
    }
    ControlFlow::Continue(())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::{ConvexVolume, Plane};
    use crate::index::FrustumQuery;
    use glam::Vec3;

    /// Otherwise the sphere test would run the exact test for every item from then on.
    #[test]
    fn an_item_that_was_far_once_is_forgotten() {
        let cube = |at: usize| Aabb::new(Vec3::splat(at as f32), Vec3::splat(at as f32 + 1.0));
        for count in [1, 40] {
            let mut items: Vec<Aabb> = (0..count).map(cube).collect();
            let input = Input::new(&items).spheres(true);
            let mut scan = Linear::build(&input, &LinearParams::default()).unwrap();
            let last = count - 1;
            // There and back; there and removed.
            for bounds in [cube(1 << 23), items[last], cube(1 << 22), Aabb::EMPTY] {
                items[last] = bounds;
                assert!(scan.refit(&items, &[last as ItemId]));
                let reach = items.iter().map(|b| b.reach().max_element());
                let reach = reach.fold(0.0, f32::max);
                assert_eq!(scan.balls.as_ref().unwrap().reach, reach, "{bounds:?}");
            }
        }
    }

    #[test]
    fn lanes_behind_the_last_item_are_dropped_however_many_blocks_there_are() {
        // A plane perpendicular to an axis keeps the empty box, whose sum is a NaN.
        let slab = [Plane::new(Vec3::X, -2.0), Plane::new(-Vec3::X, 40.0)];
        let volumes = [&slab[..], &[]].map(|planes| ConvexVolume::from_planes(planes).unwrap());
        let together = BLOCKS_PER_CALL * LANES;
        for count in [
            0,
            17,
            together - 1,
            together,
            together + 5,
            2 * together + 21,
        ] {
            let low = (0..count).map(|i| Vec3::X * (i % 100) as f32);
            let items: Vec<Aabb> = low.map(|low| Aabb::new(low, low + Vec3::ONE)).collect();
            let scan = Linear::build(&Input::new(&items), &LinearParams::default()).unwrap();
            for volume in &volumes {
                let (found, cost) = scan.counted(volume);
                let seen = items.iter().zip(0..).filter(|(b, _)| volume.sees(b));
                let seen: Vec<ItemId> = seen.map(|(_, id)| id).collect();
                assert!(found == seen, "{count}: {} of {}", found.len(), seen.len());
                assert_eq!(cost.items_tested, count as u64);
            }
        }
    }
}
