//! A structure of your own crate that tests sixteen boxes at once.
//!
//! `enter_your_crate` tests one box after the other. Here the boxes lie in blocks: the six rows of
//! a `BoxBlock` are the bounds of sixteen boxes, which one instruction compares with a plane. Tiles
//! of 256 items come from a sort along x; their bounds lie in blocks, too.
//! `cargo run --release --example sixteen_at_once -- run --structure linear,tiles-16,wide`

use std::ops::ControlFlow;
use std::process::ExitCode;

use cullbench::geometry::{Aabb, BoxBlocks};
use cullbench::index::{BuildError, Info, Input, Kind, MemoryUsage, Origin, RegionIndex, Registry};
use cullbench::kernel::{Isa, LANES, LaneMask};
use cullbench::query::{Context, ItemId, QueryVolume, Recorder, Sink};

/// Items of a tile, a multiple of the sixteen lanes of a block.
const TILE: usize = 16 * LANES;

struct Tiles16 {
    /// Ids and boxes in the order of the tiles.
    ids: Vec<ItemId>,
    boxes: BoxBlocks,
    bounds: BoxBlocks,
}

impl RegionIndex for Tiles16 {
    const INFO: Info = Info::new(
        "tiles-16",
        "tiles of 256 items in slabs along x, sixteen boxes per test",
        Kind::Grid,
        Origin::Crate("sixteen_at_once"),
    );
    type Params = ();

    fn build(input: &Input<'_>, _: &()) -> Result<Self, BuildError> {
        let items = input.items;
        let mut ids = cullbench::index::indexable(items)?;
        let at = |id: &ItemId, axis: usize| items[*id as usize].centre()[axis];
        ids.sort_by(|a, b| at(a, 0).total_cmp(&at(b, 0)));
        let slab = TILE * ids.len().div_ceil(TILE).isqrt().max(1);
        let slabs = ids.chunks_mut(slab);
        slabs.for_each(|slab| slab.sort_by(|a, b| at(a, 1).total_cmp(&at(b, 1))));
        let sorted: Vec<Aabb> = ids.iter().map(|&id| items[id as usize]).collect();
        // The last block of each has lanes that hold no box.
        let mut boxes = BoxBlocks::with_capacity(sorted.len());
        sorted.iter().for_each(|b| boxes.push(b));
        let mut bounds = BoxBlocks::with_capacity(sorted.len().div_ceil(TILE));
        let tiles = sorted.chunks(TILE).map(Aabb::union_of);
        tiles.for_each(|b| bounds.push(&b));
        Ok(Tiles16 { ids, boxes, bounds })
    }

    fn memory(&self) -> MemoryUsage {
        MemoryUsage {
            node_bytes: self.bounds.bytes(),
            item_bytes: self.boxes.bytes() + size_of_val(&self.ids[..]),
        }
    }

    // Inlined into a copy per instruction set: AVX-512, AVX2 or plain arrays.
    #[inline(always)]
    fn query<Q: QueryVolume, C: Context>(&self, q: &Q, cx: &mut C) -> ControlFlow<()> {
        let isa = cx.isa();
        let mask = q.mask();
        let (sink, recorder) = cx.parts();
        for (first, lanes, block) in self.bounds.range(0, self.bounds.len()) {
            recorder.nodes_tested(lanes.count_ones());
            recorder.planes_tested(lanes.count_ones() * Q::planes_open(mask));
            // A bit per tile that is met, and a word per tile: the planes that cut it.
            let (met, cut_by) = q.sorted_lanes(isa, block, mask);
            let met = met & lanes;
            recorder.subtrees_rejected((lanes & !met).count_ones());
            let inside = isa.equal(cut_by, 0);
            for lane in lanes_of(met) {
                let from = (first + lane) * TILE;
                let to = self.ids.len().min(from + TILE);
                if inside >> lane & 1 == 1 {
                    recorder.subtree_accepted(to - from);
                    sink.accept_range(isa, &self.ids, from..to)?;
                    continue;
                }
                for (start, lanes, block) in self.boxes.range(from, to) {
                    recorder.items_tested(lanes.count_ones());
                    recorder.planes_tested(lanes.count_ones() * Q::planes_open(mask));
                    // Lanes without a box may come out either way.
                    let kept = q.kept_lanes(isa, block, mask) & lanes;
                    sink.accept_lanes(isa, &self.ids, start, kept)?;
                }
            }
        }
        ControlFlow::Continue(())
    }
}

/// The lanes whose bit is set.
#[inline(always)]
fn lanes_of(mut lanes: LaneMask) -> impl Iterator<Item = usize> {
    std::iter::from_fn(move || {
        let lane = lanes.trailing_zeros() as usize;
        lanes &= lanes.wrapping_sub(1);
        (lane < LANES).then_some(lane)
    })
}

fn main() -> ExitCode {
    let program = ("sixteen_at_once", "0.1.0");
    cullbench::cli::main_as(program, Registry::builtin().with::<Tiles16>())
}

#[cfg(test)]
cullbench::conformance!(Tiles16);
