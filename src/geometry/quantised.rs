//! Boxes as small whole numbers on a grid, rounded outward: a block of sixteen
//! in 96 bytes (u8) or 192 (u16) instead of 384. What that costs in error is
//! measured elsewhere.

use glam::Vec3;

use super::Aabb;
use super::box_block::{BoxBlock, LANES};
use crate::arithmetic::rounding::round_up;

/// A whole number that a coordinate is stored as.
pub trait Code: Copy + Default + Send + Sync {
    const MOST: u32;
    fn of(value: u32) -> Self;
    fn get(self) -> f32;
}

impl Code for u8 {
    const MOST: u32 = u8::MAX as u32;
    fn of(value: u32) -> Self {
        value.min(Self::MOST) as u8
    }
    #[inline(always)]
    fn get(self) -> f32 {
        f32::from(self)
    }
}

impl Code for u16 {
    const MOST: u32 = u16::MAX as u32;
    fn of(value: u32) -> Self {
        value.min(Self::MOST) as u16
    }
    #[inline(always)]
    fn get(self) -> f32 {
        f32::from(self)
    }
}

/// Where code 0 lies and how far the codes are apart, per axis.
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct Grid {
    low: Vec3,
    step: Vec3,
}

impl Grid {
    /// The grid of `most + 1` lines an axis over the bounds; `None` if it does
    /// not fit f32.
    pub fn over(bounds: &Aabb, most: u32) -> Option<Grid> {
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

    /// The last line not above `x`.
    fn below<C: Code>(&self, axis: usize, x: f32) -> C {
        let mut code = self.nearest::<C>(axis, x);
        while code > 0 && self.line(axis, code as f32) > x {
            code -= 1;
        }
        C::of(code)
    }

    /// The first line not below `x`.
    fn above<C: Code>(&self, axis: usize, x: f32) -> C {
        let mut code = self.nearest::<C>(axis, x);
        while code < C::MOST && self.line(axis, code as f32) < x {
            code += 1;
        }
        C::of(code)
    }

    fn nearest<C: Code>(&self, axis: usize, x: f32) -> u32 {
        let steps = (f64::from(x) - f64::from(self.low[axis])) / f64::from(self.step[axis]);
        // No step at all gives NaN, which becomes 0.
        (steps.round() as u32).min(C::MOST)
    }
}

/// Sixteen boxes as codes: rows min x, y, z, max x, y, z.
#[derive(Clone, Copy, Debug)]
pub struct CodeBlock<C> {
    rows: [[C; LANES]; 6],
}

impl<C: Code> CodeBlock<C> {
    /// The boxes, each rounded outward to lines of the grid, which must span
    /// them. Lanes beyond the last box hold code 0.
    pub fn encode(boxes: &[Aabb], grid: &Grid) -> Self {
        let mut rows = [[C::default(); LANES]; 6];
        for (lane, b) in boxes.iter().enumerate() {
            for k in 0..3 {
                rows[k][lane] = grid.below(k, b.min[k]);
                rows[k + 3][lane] = grid.above(k, b.max[k]);
            }
        }
        CodeBlock { rows }
    }

    /// The boxes that the codes stand for.
    #[inline(always)]
    pub fn decode(&self, grid: &Grid) -> BoxBlock {
        let mut rows = [[0.0; LANES]; 6];
        for (k, (row, codes)) in rows.iter_mut().zip(&self.rows).enumerate() {
            for (x, code) in row.iter_mut().zip(codes) {
                *x = grid.line(k % 3, code.get());
            }
        }
        BoxBlock::from_rows(rows)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn check<C: Code>(boxes: &[Aabb]) {
        let bounds = Aabb::union_of(boxes);
        let grid = Grid::over(&bounds, C::MOST).unwrap();
        let block = CodeBlock::<C>::encode(boxes, &grid).decode(&grid);
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

    #[test]
    fn bounds_beyond_f32_have_no_grid_and_a_point_has_one() {
        let huge = Aabb::new(Vec3::splat(-3e38), Vec3::splat(3e38));
        assert_eq!(Grid::over(&huge, 255), None);
        let point = Aabb::new(Vec3::ONE, Vec3::ONE);
        let grid = Grid::over(&point, 255).unwrap();
        let block = CodeBlock::<u8>::encode(&[point], &grid);
        assert_eq!(block.decode(&grid).get(0), point);
    }
}
