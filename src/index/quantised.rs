//! An experiment, not a back end: a tree whose leaves keep their boxes as u8 or
//! u16. Boxes grow by the rounding, so its answers are a superset of everyone
//! else's; `precision` shows what that costs and saves. Node bounds stay f32.

use std::ops::{ControlFlow, Range};

use glam::Vec3;
use serde::{Deserialize, Serialize};

use super::bundles::Leaves;
use super::by_tree::visible_on_baseline;
use super::tree::{PackedTree, scan_blocks};
use super::{Bsp, BuildError, FrustumQuery, Info, Kind, MemoryUsage, Origin, RegionIndex};
use crate::geometry::quantised::{Code, CodeBlock, Grid};
use crate::geometry::{Aabb, BoxBlock, LANES, LaneMask, PlaneMask, PlaneTree, lanes_of};
use crate::kernel::{BASELINE, Isa};
use crate::query::{ItemId, Recorder, Sink, View};

/// What the codes count from.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum GridScope {
    /// One grid over the scene.
    World,
    /// One grid for every block of sixteen items in tree order (24 bytes).
    Block,
}

/// `quantised:bits=8,grid=block`.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct QuantisedParams {
    /// 8 or 16.
    pub bits: u32,
    pub grid: GridScope,
}

impl Default for QuantisedParams {
    fn default() -> Self {
        QuantisedParams {
            bits: 16,
            grid: GridScope::World,
        }
    }
}

/// The tree of [`Bsp`] (median) over items in codes.
pub struct Quantised {
    tree: PackedTree,
    codes: Codes,
    /// One for the world, or one for each block.
    grids: Vec<Grid>,
}

enum Codes {
    Bytes(Vec<CodeBlock<u8>>),
    Words(Vec<CodeBlock<u16>>),
}

impl Codes {
    #[inline(always)]
    fn decode(&self, block: usize, grid: &Grid) -> BoxBlock {
        match self {
            Codes::Bytes(blocks) => blocks[block].decode(grid),
            Codes::Words(blocks) => blocks[block].decode(grid),
        }
    }
}

fn encode<C: Code>(boxes: &[Aabb], grids: &[Grid]) -> Vec<CodeBlock<C>> {
    let blocks = boxes.chunks(LANES).enumerate();
    blocks
        .map(|(i, boxes)| CodeBlock::encode(boxes, &grids[i % grids.len()]))
        .collect()
}

impl Quantised {
    /// The boxes as the codes have them, by item; empty for items that are not
    /// indexed.
    pub fn decoded(&self, items: usize) -> Vec<Aabb> {
        let mut decoded = vec![Aabb::EMPTY; items];
        for (place, &id) in self.tree.ids().iter().enumerate() {
            let block = self.codes.decode(place / LANES, self.grid(place / LANES));
            decoded[id as usize] = block.get(place % LANES);
        }
        decoded
    }

    #[inline(always)]
    fn grid(&self, block: usize) -> &Grid {
        // One grid serves all blocks, or each has its own.
        &self.grids[if self.grids.len() == 1 { 0 } else { block }]
    }

    #[inline(always)]
    fn blocks(&self, items: Range<usize>) -> impl Iterator<Item = (usize, LaneMask, BoxBlock)> {
        let blocks = items.start / LANES..items.end.div_ceil(LANES);
        blocks.map(move |at| {
            let lanes = lanes_of(at, items.start, items.end);
            (at * LANES, lanes, self.codes.decode(at, self.grid(at)))
        })
    }
}

/// Leaves whose bounds are decoded block by block.
struct InCodes<'a, V> {
    index: &'a Quantised,
    view: &'a V,
}

impl<V: View> Leaves for InCodes<'_, V> {
    #[inline(always)]
    fn tree(&self) -> &PackedTree {
        &self.index.tree
    }

    /// Codes are few bytes, one after the other.
    #[inline(always)]
    fn fetch(&self, _: Range<usize>, _: PlaneMask) {}

    #[inline(always)]
    fn test<I: Isa, S: Sink, R: Recorder>(
        &self,
        isa: I,
        items: Range<usize>,
        mask: PlaneMask,
        sink: &mut S,
        recorder: &mut R,
    ) -> ControlFlow<()> {
        let (blocks, ids) = (self.index.blocks(items), self.index.tree.ids());
        scan_blocks(isa, blocks, ids, self.view, mask, sink, recorder)
    }
}

impl RegionIndex for Quantised {
    const INFO: Info = Info::new(
        "quantised",
        "experiment: the bsp tree with items stored as u8 or u16",
        Kind::Tree,
        Origin::Ours,
    );
    type Params = QuantisedParams;

    fn build(
        items: &[Aabb],
        own_tree: Option<&PlaneTree>,
        params: &QuantisedParams,
    ) -> Result<Self, BuildError> {
        let refused = |reason: &str| BuildError::Params {
            structure: Self::INFO.name,
            reason: reason.to_owned(),
        };
        let most = match params.bits {
            8 => u8::MOST,
            16 => u16::MOST,
            _ => return Err(refused("bits must be 8 or 16")),
        };
        let mut tree = Bsp::build(items, own_tree, &Default::default())?.into_tree();
        let boxes: Vec<Aabb> = (0..tree.ids().len()).map(|i| tree.boxes().get(i)).collect();
        let groups = match params.grid {
            GridScope::World => boxes.chunks(boxes.len().max(1)),
            GridScope::Block => boxes.chunks(LANES),
        };
        let grids = groups.map(|group| Grid::over(&Aabb::union_of(group), most));
        let grids: Option<Vec<Grid>> = grids.collect();
        let grids = grids.ok_or_else(|| refused("the scene's extent does not fit f32"))?;
        let codes = match params.bits {
            8 => Codes::Bytes(encode(&boxes, &grids)),
            _ => Codes::Words(encode(&boxes, &grids)),
        };
        let mut quantised = Quantised {
            tree: PackedTree::default(),
            codes,
            grids,
        };
        // Nodes must hold what the codes stand for.
        std::mem::swap(&mut quantised.tree, &mut tree);
        let decoded = quantised.decoded(items.len());
        let moved: Vec<ItemId> = quantised.tree.ids().to_vec();
        quantised.tree.refit(&decoded, &moved, |_, _| ());
        quantised.tree.forget_boxes();
        Ok(quantised)
    }

    fn memory(&self) -> MemoryUsage {
        let mut memory = self.tree.memory();
        memory.item_bytes += size_of_val(&self.grids[..])
            + match &self.codes {
                Codes::Bytes(blocks) => size_of_val(&blocks[..]),
                Codes::Words(blocks) => size_of_val(&blocks[..]),
            };
        memory
    }

    #[inline(always)]
    fn locate<S: Sink, R: Recorder>(
        &self,
        p: Vec3,
        sink: &mut S,
        recorder: &mut R,
    ) -> ControlFlow<()> {
        let test = |items: Range<usize>, memo, sink: &mut S, recorder: &mut R| {
            let blocks = self.blocks(items);
            scan_blocks(BASELINE, blocks, self.tree.ids(), &p, memo, sink, recorder)
        };
        self.tree.query_leaves(BASELINE, &p, sink, recorder, test)
    }
}

impl FrustumQuery for Quantised {
    visible_on_baseline!();

    #[inline(always)]
    fn visible_by<I: Isa, V: View, S: Sink, R: Recorder>(
        &self,
        isa: I,
        view: &V,
        sink: &mut S,
        recorder: &mut R,
    ) -> ControlFlow<()> {
        let leaves = InCodes { index: self, view };
        self.tree.see_leaves(isa, view, &leaves, sink, recorder)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::{ConvexVolume, Plane};
    use crate::query::NoRecorder;

    fn items() -> Vec<Aabb> {
        let place = |i: u16| Vec3::new(f32::from(i % 40), f32::from(i / 40), f32::from(i % 7));
        let mut items: Vec<Aabb> = (0..900)
            .map(|i| Aabb::around(place(i) * 1.7, Vec3::splat(0.3)))
            .collect();
        items[5] = Aabb::EMPTY;
        items[5].min = Vec3::ONE;
        items[5].max = Vec3::ZERO;
        items
    }

    #[test]
    fn it_sees_exactly_its_decoded_boxes_and_all_of_the_true_ones() {
        let items = items();
        let normal = Vec3::new(0.6, -0.5, 0.3);
        let planes = [Plane::new(normal, -9.0), Plane::new(-normal, 14.0)];
        let slab = ConvexVolume::from_planes(&planes).unwrap();
        let mut extra = Vec::new();
        for (bits, grid) in [
            (8, GridScope::World),
            (8, GridScope::Block),
            (16, GridScope::World),
            (16, GridScope::Block),
        ] {
            let index = Quantised::build(&items, None, &QuantisedParams { bits, grid }).unwrap();
            let decoded = index.decoded(items.len());
            assert!(
                decoded
                    .iter()
                    .zip(&items)
                    .all(|(d, b)| b.is_empty() || d.contains(b))
            );
            let mut found = Vec::new();
            let _ = index.visible(&slab, &mut found, &mut NoRecorder);
            found.sort_unstable();
            let of = |boxes: &[Aabb]| -> Vec<ItemId> {
                let seen = boxes.iter().zip(0..).filter(|(b, _)| slab.sees(b));
                seen.map(|(_, id)| id).collect()
            };
            assert_eq!(found, of(&decoded), "{bits} {grid:?}");
            let truly = of(&items);
            assert!(truly.iter().all(|id| found.binary_search(id).is_ok()));
            extra.push(found.len() - truly.len());
            let mut here = Vec::new();
            let _ = index.locate(items[77].centre(), &mut here, &mut NoRecorder);
            assert!(here.contains(&77));
        }
        assert!(extra[0] > extra[2], "eight bits cost more: {extra:?}");
    }

    #[test]
    fn what_cannot_be_stored_is_refused() {
        let odd = QuantisedParams {
            bits: 12,
            ..QuantisedParams::default()
        };
        assert!(Quantised::build(&items(), None, &odd).is_err());
        let huge = [Aabb::new(Vec3::splat(-3e38), Vec3::splat(3e38))];
        assert!(Quantised::build(&huge, None, &QuantisedParams::default()).is_err());
        let none = Quantised::build(&[], None, &QuantisedParams::default());
        assert_eq!(none.map(|q| q.memory().total()).ok(), Some(0));
    }
}
