//! Items stored in few bits: bounds as whole numbers on a grid or as half floats,
//! rounded outward, under the tree of [`Bsp`]. Sixteen boxes take 96 bytes (u8) or
//! 192 (u16, half floats) instead of 384. An experiment of the diagram, and no
//! structure to choose.

use std::ops::{ControlFlow, Range};

use serde::{Deserialize, Serialize};

use crate::arithmetic::rounding::round_up;
use crate::geometry::{Aabb, BoxBlock, LANES, LaneMask, PlaneMask, blocks_of};
use crate::index::{
    Bsp, BuildError, Info, Input, Kind, Leaves, MemoryUsage, Origin, PackedTree, RegionIndex,
    scan_blocks,
};
use crate::kernel::Isa;
use crate::query::{Context, ItemId, QueryVolume, Recorder, Sink};

/// What a coordinate is stored as.
trait Code: Copy + Default + Send + Sync + 'static {
    /// Where code 0 lies on an axis and how far codes are apart, for bounds on it;
    /// `None` if they do not fit.
    fn line_over(low: f32, high: f32) -> Option<[f32; 2]>;

    /// What a code stands for. Monotone in the code, as rounding is.
    fn value(self, line: [f32; 2]) -> f32;

    /// The first code not below `x` for an upper bound, else the last one not
    /// above it.
    fn outward(x: f32, line: [f32; 2], upper: bool) -> Self;
}

/// Whole numbers on a grid.
macro_rules! grid_code {
    ($($code:ty),*) => {$(
        impl Code for $code {
            fn line_over(low: f32, high: f32) -> Option<[f32; 2]> {
                let most = f64::from(<$code>::MAX);
                let mut step = round_up((f64::from(high) - f64::from(low)) / most);
                // Rounding may leave the last line short of the bound.
                while low + step * f32::from(<$code>::MAX) < high {
                    step = step.next_up();
                }
                let last = low + step * f32::from(<$code>::MAX);
                (last.is_finite() && step.is_finite()).then_some([low, step])
            }

            #[inline(always)]
            fn value(self, [low, step]: [f32; 2]) -> f32 {
                low + step * f32::from(self)
            }

            fn outward(x: f32, line: [f32; 2], upper: bool) -> Self {
                let steps = (f64::from(x) - f64::from(line[0])) / f64::from(line[1]);
                // No step at all gives NaN, which becomes 0.
                let mut code = steps.round() as $code;
                while upper && code < <$code>::MAX && code.value(line) < x {
                    code += 1;
                }
                while !upper && code > 0 && code.value(line) > x {
                    code -= 1;
                }
                code
            }
        }
    )*};
}
grid_code!(u8, u16);

/// A half float of IEEE 754 (binary16): 11 bits, up to 65504.
#[derive(Clone, Copy, Default)]
struct F16(u16);

/// The upper half of an f32 (bfloat16): 8 bits, and its range.
#[derive(Clone, Copy, Default)]
struct Bf16(u16);

/// Half floats about the scene's origin, with no grid; the largest finite one is
/// `$largest`.
macro_rules! float_code {
    ($($code:ident, $largest:literal, $decode:expr;)*) => {$(
        impl Code for $code {
            fn line_over(low: f32, high: f32) -> Option<[f32; 2]> {
                let largest = $code($largest).value([0.0; 2]);
                (-largest <= low && high <= largest).then_some([0.0; 2])
            }

            #[inline(always)]
            fn value(self, _: [f32; 2]) -> f32 {
                let decode: fn(u32) -> f32 = $decode;
                f32::from_bits(decode(u32::from(self.0 & 0x7FFF)).to_bits() | u32::from(self.0 >> 15) << 31)
            }

            fn outward(x: f32, line: [f32; 2], upper: bool) -> Self {
                // Codes of one sign are in the order of what they stand for: the
                // last one not beyond the size of x, and one more away from zero.
                let sign = u16::from(x.is_sign_negative()) << 15;
                let (mut within, mut beyond) = (0, $largest + 1);
                while beyond - within > 1 {
                    let middle = within + (beyond - within) / 2;
                    match $code(middle).value(line) <= x.abs() {
                        true => within = middle,
                        false => beyond = middle,
                    }
                }
                let is_short = $code(within).value(line) < x.abs();
                let grows = is_short && upper != x.is_sign_negative();
                $code(within + u16::from(grows) | sign)
            }
        }
    )*};
}
float_code! {
    // The exponent is 112 too small; a subnormal one is scaled all the same.
    F16, 0x7BFF, |bits| f32::from_bits(bits << 13) * f32::from_bits((127 + 112) << 23);
    Bf16, 0x7F7F, |bits| f32::from_bits(bits << 16);
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

/// The numbers that bounds are stored as.
#[derive(Clone, Copy, Default, PartialEq, Eq, Debug, Serialize, Deserialize)]
pub enum CodeKind {
    /// Whole numbers of 8 bits on a grid.
    #[default]
    U8,
    /// Whole numbers of 16 bits on a grid.
    U16,
    /// Half floats (binary16).
    F16,
    /// The upper halves of f32 (bfloat16).
    Bf16,
}

/// How items are stored: which numbers, and what they count from.
#[derive(Clone, Copy, Default, PartialEq, Eq, Debug, Serialize, Deserialize)]
pub struct Storage {
    /// The numbers.
    pub kind: CodeKind,
    /// What they count from; half floats have no grid.
    pub scope: GridScope,
}

/// What codes count from, per axis: [`Code::line_over`].
type Grid = [[f32; 2]; 3];

fn grid_over<C: Code>(bounds: &Aabb) -> Option<Grid> {
    let line = |k: usize| C::line_over(bounds.min[k], bounds.max[k]);
    Some([line(0)?, line(1)?, line(2)?])
}

/// Sixteen boxes as codes: rows min x, y, z, max x, y, z.
type CodeBlock<C> = [[C; LANES]; 6];

/// The boxes, each rounded outward to lines of the grid, which must span them.
/// Lanes beyond the last box hold code 0.
fn encode<C: Code>(boxes: &[Aabb], grid: &Grid) -> CodeBlock<C> {
    let mut rows = [[C::default(); LANES]; 6];
    for (lane, b) in boxes.iter().enumerate() {
        for k in 0..3 {
            rows[k][lane] = C::outward(b.min[k], grid[k], false);
            rows[k + 3][lane] = C::outward(b.max[k], grid[k], true);
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
            *x = code.value(grid[k % 3]);
        }
    }
    BoxBlock::from_rows(rows)
}

/// All blocks of a scene, in codes of one kind.
enum CodeBlocks {
    U8(Vec<CodeBlock<u8>>),
    U16(Vec<CodeBlock<u16>>),
    F16(Vec<CodeBlock<F16>>),
    Bf16(Vec<CodeBlock<Bf16>>),
}

/// Does the same with the blocks of any kind.
macro_rules! each_kind {
    ($codes:expr, $blocks:ident => $work:expr) => {
        match $codes {
            CodeBlocks::U8($blocks) => $work,
            CodeBlocks::U16($blocks) => $work,
            CodeBlocks::F16($blocks) => $work,
            CodeBlocks::Bf16($blocks) => $work,
        }
    };
}

impl CodeBlocks {
    /// The boxes, sixteen a block, and the grids; `None` if the scene's extent does
    /// not fit.
    fn over(boxes: &[Aabb], storage: Storage) -> Option<(CodeBlocks, Vec<Grid>)> {
        fn coded<C: Code>(
            boxes: &[Aabb],
            scope: GridScope,
            of: fn(Vec<CodeBlock<C>>) -> CodeBlocks,
        ) -> Option<(CodeBlocks, Vec<Grid>)> {
            let groups = boxes.chunks(match scope {
                GridScope::World => boxes.len().max(1),
                GridScope::Block => LANES,
            });
            let grids = groups.map(|group| grid_over::<C>(&Aabb::union_of(group)));
            let grids: Vec<Grid> = grids.collect::<Option<_>>()?;
            let blocks = boxes.chunks(LANES).enumerate();
            let blocks = blocks.map(|(i, boxes)| encode(boxes, &grids[i % grids.len()]));
            Some((of(blocks.collect()), grids))
        }
        let scope = storage.scope;
        match storage.kind {
            CodeKind::U8 => coded(boxes, scope, CodeBlocks::U8),
            CodeKind::U16 => coded(boxes, scope, CodeBlocks::U16),
            CodeKind::F16 => coded(boxes, scope, CodeBlocks::F16),
            CodeKind::Bf16 => coded(boxes, scope, CodeBlocks::Bf16),
        }
    }
}

/// The tree of [`Bsp`] (median) over items in codes. One type for all kinds, looked
/// up once per block of sixteen, so that the traversal is compiled once.
pub struct Quantised {
    tree: PackedTree,
    codes: CodeBlocks,
    /// One for the world, or one for each block.
    grids: Vec<Grid>,
}

impl Quantised {
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
        each_kind!(&self.codes, blocks => decode(&blocks[at], grid))
    }

    #[inline(always)]
    fn blocks(&self, items: Range<usize>) -> impl Iterator<Item = (usize, LaneMask, BoxBlock)> {
        blocks_of(items.start, items.end)
            .map(|(start, lanes)| (start, lanes, self.block(start / LANES)))
    }
}

/// Leaves whose bounds are decoded block by block.
struct InCodes<'a, V> {
    index: &'a Quantised,
    volume: &'a V,
}

impl<V: QueryVolume> Leaves for InCodes<'_, V> {
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
        scan_blocks(isa, blocks, ids, (self.volume, mask), sink, recorder)
    }
}

impl RegionIndex for Quantised {
    const INFO: Info = Info::new(
        "quantised",
        "experiment: the bsp tree with items stored in 8 or 16 bits",
        Kind::Tree,
        Origin::Ours,
    );
    type Params = Storage;

    fn build(input: &Input<'_>, storage: &Storage) -> Result<Self, BuildError> {
        let items = input.items;
        let tree = Bsp::build(input, &Default::default())?.into_tree();
        let boxes: Vec<Aabb> = (0..tree.ids().len()).map(|i| tree.boxes().get(i)).collect();
        let coded = CodeBlocks::over(&boxes, *storage);
        let (codes, grids) = coded.ok_or_else(|| BuildError::Params {
            structure: Self::INFO.name,
            reason: "the scene's extent does not fit these numbers".to_owned(),
        })?;
        let mut quantised = Quantised { tree, codes, grids };
        // Nodes must hold what the codes stand for.
        let decoded = quantised.decoded(items.len());
        let moved: Vec<ItemId> = quantised.tree.ids().to_vec();
        quantised.tree.refit(&decoded, &moved, |_, _| ());
        quantised.tree.forget_boxes();
        Ok(quantised)
    }

    fn memory(&self) -> MemoryUsage {
        let mut memory = self.tree.memory();
        let codes = each_kind!(&self.codes, blocks => size_of_val(&blocks[..]));
        memory.item_bytes += size_of_val(&self.grids[..]) + codes;
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
    use glam::Vec3;
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
    fn excess(kind: CodeKind, scope: GridScope) -> usize {
        let items = items();
        let normal = Vec3::new(0.6, -0.5, 0.3);
        let planes = [Plane::new(normal, -9.0), Plane::new(-normal, 14.0)];
        let slab = ConvexVolume::from_planes(&planes).unwrap();
        let index = Quantised::build(&Input::new(&items), &Storage { kind, scope }).unwrap();
        let decoded = index.decoded(items.len());
        let holds = |(d, b): (&Aabb, &Aabb)| b.is_empty() || d.contains(b);
        assert!(decoded.iter().zip(&items).all(holds));
        let mut found = Vec::new();
        let _ = index.visible(&slab, &mut found);
        found.sort_unstable();
        assert_eq!(found, those(&decoded, &slab), "{kind:?}, {scope:?}");
        let truly = those(&items, &slab);
        assert!(truly.iter().all(|id| found.binary_search(id).is_ok()));
        let mut here = Vec::new();
        let _ = index.locate(items[77].centre(), &mut here);
        assert!(here.contains(&77));
        found.len() - truly.len()
    }

    #[test]
    fn it_sees_exactly_its_decoded_boxes_and_all_of_the_true_ones() {
        let world = |kind| excess(kind, GridScope::World);
        let block = |kind| excess(kind, GridScope::Block);
        assert!(world(CodeKind::U8) > world(CodeKind::U16));
        assert!(block(CodeKind::U8) >= block(CodeKind::U16));
        assert!(world(CodeKind::Bf16) > world(CodeKind::F16));
    }

    #[test]
    fn what_cannot_be_stored_is_refused_and_a_point_has_a_grid() {
        let built = |items: &[Aabb], kind| {
            let scope = GridScope::World;
            Quantised::build(&Input::new(items), &Storage { kind, scope })
        };
        let huge = [Aabb::new(Vec3::splat(-3e38), Vec3::splat(3e38))];
        assert!(built(&huge, CodeKind::U16).is_err());
        assert!(built(&huge, CodeKind::F16).is_err());
        let none = built(&[], CodeKind::U16);
        assert_eq!(none.map(|q| q.memory().total()).ok(), Some(0));
        let point = Aabb::new(Vec3::ONE, Vec3::ONE);
        let one = built(&[point], CodeKind::U8).unwrap();
        assert_eq!(one.decoded(1), [point]);
    }

    /// `share` of a coordinate's size, beside the steps of a grid, is what a code may
    /// be off by.
    fn check<C: Code>(boxes: &[Aabb], share: f32) {
        let bounds = Aabb::union_of(boxes);
        let grid = grid_over::<C>(&bounds).unwrap();
        let block = decode(&encode::<C>(boxes, &grid), &grid);
        for (lane, b) in boxes.iter().enumerate() {
            let decoded = block.get(lane);
            assert!(decoded.contains(b), "{b:?} became {decoded:?}");
            for (k, [_, step]) in grid.iter().enumerate() {
                // Not a line too far, but for the rounding of the lines.
                let slack = step * 1.01 + bounds.reach()[k] * 1e-6;
                // The step of subnormal half floats.
                let least = 2f32.powi(-24);
                let slack = |x: f32| slack + (share * x.abs()).max(least);
                assert!(
                    b.min[k] - decoded.min[k] <= slack(b.min[k]),
                    "{b:?} {decoded:?}"
                );
                assert!(
                    decoded.max[k] - b.max[k] <= slack(b.max[k]),
                    "{b:?} {decoded:?}"
                );
            }
        }
    }

    /// Every half float is its own outward neighbour, and what lies between two is
    /// rounded to the outer one.
    #[test]
    fn half_floats_are_rounded_outward_to_the_nearest() {
        fn check<C: Code>(code: impl Fn(u16) -> C, largest: u16) {
            let of = |x: f32, upper: bool| C::outward(x, [0.0; 2], upper).value([0.0; 2]);
            for bits in 0..largest {
                let (x, next) = (code(bits).value([0.0; 2]), code(bits + 1).value([0.0; 2]));
                assert!(x < next, "{bits:#x}");
                for x in [x, -x] {
                    assert_eq!([of(x, true), of(x, false)], [x; 2], "{bits:#x}");
                }
                let between = x.next_up();
                if between < next {
                    assert_eq!([of(between, true), of(between, false)], [next, x]);
                    assert_eq!([of(-between, true), of(-between, false)], [-x, -next]);
                }
            }
        }
        check(F16, 0x7BFF);
        check(Bf16, 0x7F7F);
        let known = [(0x3C00, 1.0), (0x7BFF, 65504.0), (0x0001, 5.960_464_5e-8)];
        for (bits, value) in known {
            assert_eq!(F16(bits).value([0.0; 2]), value);
        }
        assert_eq!(Bf16(0x4049).value([0.0; 2]), 3.140_625);
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
            check::<u8>(&boxes, 0.0);
            check::<u16>(&boxes, 0.0);
            check::<Bf16>(&boxes, 2f32.powi(-7));
            let small: Vec<Aabb> = boxes
                .iter()
                .map(|b| Aabb::new(b.min * 0.03, b.max * 0.03))
                .collect();
            check::<F16>(&small, 2f32.powi(-10));
        }
    }
}
