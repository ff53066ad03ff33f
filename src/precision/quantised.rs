//! Items stored in few bits: bounds as whole numbers on a grid, rounded outward,
//! under the tree of [`Bsp`]. Sixteen boxes take 96 bytes (u8) or 192 (u16)
//! instead of 384. An experiment of the diagram, and no structure to choose.

use std::ops::{ControlFlow, Range};

use glam::Vec3;
use serde::{Deserialize, Serialize};

use crate::arithmetic::rounding::round_up;
use crate::geometry::{Aabb, BoxBlock, LANES, LaneMask, PlaneMask, lanes_of};
use crate::index::{
    Bsp, BuildError, Info, Input, Kind, Leaves, MemoryUsage, Origin, PackedTree, RegionIndex,
    scan_blocks,
};
use crate::query::{Context, ItemId, QueryVolume};

/// A whole number that a coordinate is stored as.
pub trait Code: Copy + Default + Into<f32> + TryFrom<u32> + Send + Sync + 'static {
    const MOST: u32;
}

impl Code for u8 {
    const MOST: u32 = u8::MAX as u32;
}

impl Code for u16 {
    const MOST: u32 = u16::MAX as u32;
}

/// What the codes count from.
#[derive(Clone, Copy, Default, PartialEq, Eq, Debug, Serialize, Deserialize)]
pub enum GridScope {
    /// One grid over the scene.
    #[default]
    World,
    /// One grid for every block of sixteen items in tree order (24 bytes).
    Block,
}

/// Where code 0 lies and how far the codes are apart, per axis.
#[derive(Clone, Copy, PartialEq, Debug)]
struct Grid {
    low: Vec3,
    step: Vec3,
}

impl Grid {
    /// The grid of `most + 1` lines an axis over the bounds; `None` if it does
    /// not fit f32.
    fn over(bounds: &Aabb, most: u32) -> Option<Grid> {
        let mut step = Vec3::ZERO;
        for k in 0..3 {
            let (low, high) = (bounds.min[k], bounds.max[k]);
            let mut s = round_up((f64::from(high) - f64::from(low)) / f64::from(most));
            // Rounding may leave the last line short of the bound.
            while low + s * (most as f32) < high {
                s = s.next_up();
            }
            step[k] = s;
        }
        let last = bounds.min + step * most as f32;
        let low = bounds.min;
        (last.is_finite() && step.is_finite()).then_some(Grid { low, step })
    }

    /// The coordinate of a code. Monotone in the code, as rounding is.
    #[inline(always)]
    fn line(&self, axis: usize, code: f32) -> f32 {
        self.low[axis] + self.step[axis] * code
    }

    /// The first line not below `x` for an upper bound, else the last one not
    /// above it.
    fn code<C: Code>(&self, axis: usize, x: f32, upper: bool) -> C {
        let steps = (f64::from(x) - f64::from(self.low[axis])) / f64::from(self.step[axis]);
        // No step at all gives NaN, which becomes 0.
        let mut code = (steps.round() as u32).min(C::MOST);
        while upper && code < C::MOST && self.line(axis, code as f32) < x {
            code += 1;
        }
        while !upper && code > 0 && self.line(axis, code as f32) > x {
            code -= 1;
        }
        C::try_from(code).ok().unwrap_or_default()
    }
}

/// Sixteen boxes as codes: rows min x, y, z, max x, y, z.
type CodeBlock<C> = [[C; LANES]; 6];

/// The boxes, each rounded outward to lines of the grid, which must span them.
/// Lanes beyond the last box hold code 0.
fn encode<C: Code>(boxes: &[Aabb], grid: &Grid) -> CodeBlock<C> {
    let mut rows = [[C::default(); LANES]; 6];
    for (lane, b) in boxes.iter().enumerate() {
        for k in 0..3 {
            rows[k][lane] = grid.code(k, b.min[k], false);
            rows[k + 3][lane] = grid.code(k, b.max[k], true);
        }
    }
    rows
}

/// The boxes that the codes stand for.
#[inline(always)]
fn decode<C: Code>(codes: &CodeBlock<C>, grid: &Grid) -> BoxBlock {
    let mut rows = [[0.0; LANES]; 6];
    for (k, (row, codes)) in rows.iter_mut().zip(codes).enumerate() {
        for (x, &code) in row.iter_mut().zip(codes) {
            *x = grid.line(k % 3, code.into());
        }
    }
    BoxBlock::from_rows(rows)
}

/// The tree of [`Bsp`] (median) over items in codes.
pub struct Quantised<C> {
    tree: PackedTree,
    codes: Vec<CodeBlock<C>>,
    /// One for the world, or one for each block.
    grids: Vec<Grid>,
}

impl<C: Code> Quantised<C> {
    /// The boxes as the codes have them, by item; empty for items that are not
    /// indexed.
    pub fn decoded(&self, items: usize) -> Vec<Aabb> {
        let mut decoded = vec![Aabb::EMPTY; items];
        for (place, &id) in self.tree.ids().iter().enumerate() {
            decoded[id as usize] = self.block(place / LANES).get(place % LANES);
        }
        decoded
    }

    #[inline(always)]
    fn block(&self, at: usize) -> BoxBlock {
        // One grid serves all blocks, or each has its own.
        let grid = &self.grids[if self.grids.len() == 1 { 0 } else { at }];
        decode(&self.codes[at], grid)
    }

    #[inline(always)]
    fn blocks(&self, items: Range<usize>) -> impl Iterator<Item = (usize, LaneMask, BoxBlock)> {
        let blocks = items.start / LANES..items.end.div_ceil(LANES);
        blocks.map(move |at| {
            let lanes = lanes_of(at, items.start, items.end);
            (at * LANES, lanes, self.block(at))
        })
    }
}

/// Leaves whose bounds are decoded block by block.
struct InCodes<'a, C, V> {
    index: &'a Quantised<C>,
    volume: &'a V,
}

impl<C: Code, V: QueryVolume> Leaves for InCodes<'_, C, V> {
    /// Codes are few bytes, one after the other.
    #[inline(always)]
    fn fetch(&self, _: Range<usize>, _: PlaneMask) {}

    #[inline(always)]
    fn test<X: Context>(
        &self,
        items: Range<usize>,
        mask: PlaneMask,
        cx: &mut X,
    ) -> ControlFlow<()> {
        let (blocks, ids) = (self.index.blocks(items), self.index.tree.ids());
        scan_blocks(blocks, ids, self.volume, mask, cx)
    }
}

impl<C: Code> RegionIndex for Quantised<C> {
    const INFO: Info = Info::new(
        "quantised",
        "experiment: the bsp tree with items stored as u8 or u16",
        Kind::Tree,
        Origin::Ours,
    );
    type Params = GridScope;

    fn build(input: &Input<'_>, scope: &GridScope) -> Result<Self, BuildError> {
        let items = input.items;
        let tree = Bsp::build(input, &Default::default())?.into_tree();
        let boxes: Vec<Aabb> = (0..tree.ids().len()).map(|i| tree.boxes().get(i)).collect();
        let groups = boxes.chunks(match scope {
            GridScope::World => boxes.len().max(1),
            GridScope::Block => LANES,
        });
        let grids = groups.map(|group| Grid::over(&Aabb::union_of(group), C::MOST));
        let grids: Option<Vec<Grid>> = grids.collect();
        let grids = grids.ok_or_else(|| BuildError::Params {
            structure: Self::INFO.name,
            reason: "the scene's extent does not fit f32".to_owned(),
        })?;
        let blocks = boxes.chunks(LANES).enumerate();
        let codes = blocks.map(|(i, boxes)| encode(boxes, &grids[i % grids.len()]));
        let mut quantised = Quantised {
            codes: codes.collect(),
            tree,
            grids,
        };
        // Nodes must hold what the codes stand for.
        let decoded = quantised.decoded(items.len());
        let moved: Vec<ItemId> = quantised.tree.ids().to_vec();
        quantised.tree.refit(&decoded, &moved, |_, _| ());
        quantised.tree.forget_boxes();
        Ok(quantised)
    }

    fn memory(&self) -> MemoryUsage {
        let mut memory = self.tree.memory();
        memory.item_bytes += size_of_val(&self.grids[..]) + size_of_val(&self.codes[..]);
        memory
    }

    #[inline(always)]
    fn query<Q: QueryVolume, X: Context>(&self, volume: &Q, cx: &mut X) -> ControlFlow<()> {
        let leaves = InCodes {
            index: self,
            volume,
        };
        self.tree.query_leaves(volume, &leaves, cx)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::{ConvexVolume, Plane};
    use crate::index::FrustumQuery;
    use proptest::prelude::*;

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

    fn those(boxes: &[Aabb], slab: &ConvexVolume) -> Vec<ItemId> {
        let seen = boxes.iter().zip(0..).filter(|(b, _)| slab.sees(b));
        seen.map(|(_, id)| id).collect()
    }

    /// How many more it returns than is there.
    fn excess<C: Code>(scope: GridScope) -> usize {
        let items = items();
        let normal = Vec3::new(0.6, -0.5, 0.3);
        let planes = [Plane::new(normal, -9.0), Plane::new(-normal, 14.0)];
        let slab = ConvexVolume::from_planes(&planes).unwrap();
        let index = Quantised::<C>::build(&Input::new(&items), &scope).unwrap();
        let decoded = index.decoded(items.len());
        let holds = |(d, b): (&Aabb, &Aabb)| b.is_empty() || d.contains(b);
        assert!(decoded.iter().zip(&items).all(holds));
        let mut found = Vec::new();
        let _ = index.visible(&slab, &mut found);
        found.sort_unstable();
        assert_eq!(found, those(&decoded, &slab), "{} {scope:?}", C::MOST);
        let truly = those(&items, &slab);
        assert!(truly.iter().all(|id| found.binary_search(id).is_ok()));
        let mut here = Vec::new();
        let _ = index.locate(items[77].centre(), &mut here);
        assert!(here.contains(&77));
        found.len() - truly.len()
    }

    #[test]
    fn it_sees_exactly_its_decoded_boxes_and_all_of_the_true_ones() {
        let (bytes, words) = (excess::<u8>, excess::<u16>);
        assert!(bytes(GridScope::World) > words(GridScope::World));
        assert!(bytes(GridScope::Block) >= words(GridScope::Block));
    }

    #[test]
    fn what_cannot_be_stored_is_refused_and_a_point_has_a_grid() {
        let huge = [Aabb::new(Vec3::splat(-3e38), Vec3::splat(3e38))];
        let world = GridScope::World;
        assert!(Quantised::<u16>::build(&Input::new(&huge), &world).is_err());
        let none = Quantised::<u16>::build(&Input::new(&[]), &world);
        assert_eq!(none.map(|q| q.memory().total()).ok(), Some(0));
        let point = Aabb::new(Vec3::ONE, Vec3::ONE);
        let one = Quantised::<u8>::build(&Input::new(&[point]), &world).unwrap();
        assert_eq!(one.decoded(1), [point]);
    }

    fn check<C: Code>(boxes: &[Aabb]) {
        let bounds = Aabb::union_of(boxes);
        let grid = Grid::over(&bounds, C::MOST).unwrap();
        let block = decode(&encode::<C>(boxes, &grid), &grid);
        for (lane, b) in boxes.iter().enumerate() {
            let decoded = block.get(lane);
            assert!(decoded.contains(b), "{b:?} became {decoded:?}");
            for k in 0..3 {
                // Not a line too far, but for the rounding of the lines.
                let slack = grid.step[k] * 1.01 + bounds.reach()[k] * 1e-6;
                assert!(b.min[k] - decoded.min[k] <= slack, "{b:?} {decoded:?}");
                assert!(decoded.max[k] - b.max[k] <= slack, "{b:?} {decoded:?}");
            }
        }
    }

    proptest! {
        #[test]
        fn codes_hold_their_boxes_and_hardly_more(
            centres in prop::collection::vec([-1e6f32..1e6, -1.0..1.0f32, 1e5..1.001e5f32], 1..16),
            half in prop_oneof![Just(0.0f32), 0.0..100.0f32],
        ) {
            let boxes: Vec<Aabb> = centres
                .iter()
                .map(|&c| Aabb::around(Vec3::from(c), Vec3::splat(half)))
                .collect();
            check::<u8>(&boxes);
            check::<u16>(&boxes);
        }
    }
}
