//! A structure of your own crate in the benchmark.
//!
//! Tiles of items in slabs along x, and `main_as`, which gives it every command of the program:
//! `cargo run --release --example enter_your_crate -- run --structure linear,bvh,tiles`
//! (or list, verify, query, report, compare). `cargo test --example enter_your_crate`
//! puts it through the conformance suite.

use std::ops::ControlFlow;
use std::process::ExitCode;

use cullbench::geometry::Aabb;
use cullbench::index::{BuildError, Info, Input, Kind, MemoryUsage, Origin, RegionIndex, Registry};
use cullbench::query::{Containment, Context, ItemId, QueryVolume, Recorder};

const TILE: usize = 32;

struct Tiles {
    /// Ids and boxes in the order of the tiles: a tile is one slice of ids.
    ids: Vec<ItemId>,
    boxes: Vec<Aabb>,
    bounds: Vec<Aabb>,
}

impl RegionIndex for Tiles {
    /// Checked by the conformance suite: a structure that can `refit` adds `.refits()`.
    const INFO: Info = Info::new(
        "tiles",
        "tiles of 32 items in slabs along x",
        Kind::Grid,
        Origin::Crate("enter_your_crate"), // yours: env!("CARGO_PKG_NAME")
    );
    type Params = (); // or a serde struct: `tiles:key=value`

    fn build(input: &Input<'_>, _: &()) -> Result<Self, BuildError> {
        let items = input.items;
        // Refuses NaN and infinity, leaves empty boxes out.
        let mut ids = cullbench::index::indexable(items)?;
        let at = |id: &ItemId, axis: usize| items[*id as usize].centre()[axis];
        ids.sort_by(|a, b| at(a, 0).total_cmp(&at(b, 0)));
        let slab = TILE * ids.len().div_ceil(TILE).isqrt().max(1);
        let slabs = ids.chunks_mut(slab);
        slabs.for_each(|slab| slab.sort_by(|a, b| at(a, 1).total_cmp(&at(b, 1))));
        let boxes: Vec<Aabb> = ids.iter().map(|&id| items[id as usize]).collect();
        // Exact unions: a decision about a tile holds for its items.
        let bounds = boxes.chunks(TILE).map(Aabb::union_of).collect();
        Ok(Tiles { ids, boxes, bounds })
    }
    fn memory(&self) -> MemoryUsage {
        MemoryUsage {
            node_bytes: size_of_val(&self.bounds[..]),
            item_bytes: size_of_val(&self.boxes[..]) + size_of_val(&self.ids[..]),
        }
    }
    /// One query for every question: a frustum of any kind, a point, a box.
    /// Inlined, so that each instruction set gets its own.
    #[inline(always)]
    fn query<Q: QueryVolume, C: Context>(&self, q: &Q, cx: &mut C) -> ControlFlow<()> {
        let tiles = self.ids.chunks(TILE).zip(self.boxes.chunks(TILE));
        for ((ids, boxes), bounds) in tiles.zip(&self.bounds) {
            cx.recorder().nodes_tested(1);
            // The mask has the planes that are not decided for all of the tile.
            let (verdict, mask) = q.classify(bounds, q.mask(), cx.recorder());
            if verdict == Containment::Outside {
                cx.recorder().subtrees_rejected(1);
            } else if verdict == Containment::Inside {
                cx.recorder().subtree_accepted(ids.len());
                cx.accept(ids)?; // `?`: a sink may stop the query
            } else {
                cx.recorder().items_tested(ids.len() as u32);
                for (id, item) in ids.iter().zip(boxes) {
                    if q.admits(item, mask, cx.recorder()) {
                        cx.accept(&[*id])?;
                    }
                }
            }
        }
        ControlFlow::Continue(())
    }
}

/// Public for the project's own test; your crate needs no `pub`.
pub fn main() -> ExitCode {
    // yours: (env!("CARGO_PKG_NAME"), env!("CARGO_PKG_VERSION")); or main_with, without them
    let program = ("enter_your_crate", "1.2.0");
    cullbench::cli::main_as(program, Registry::builtin().with::<Tiles>())
}

#[cfg(test)]
cullbench::conformance!(Tiles);
