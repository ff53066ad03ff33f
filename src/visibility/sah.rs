//! Splits of boxes by the surface area heuristic, for trees that rays traverse.
//!
//! 16 bins per axis (Wald 2007, "On fast construction of SAH-based bounding volume
//! hierarchies"). Each tree builds its nodes from the halves.

use std::ops::Range;

use glam::Vec3;

use crate::geometry::Aabb;
use crate::index::Record;

const BINS: usize = 16;

/// A part of the items and its bounds.
#[derive(Clone)]
pub struct Part {
    pub range: Range<usize>,
    pub bounds: Aabb,
}

impl Part {
    pub fn of(items: &[Record], range: Range<usize>) -> Part {
        Part {
            bounds: Aabb::union_of(items[range.clone()].iter().map(|item| &item.bounds)),
            range,
        }
    }

    pub fn len(&self) -> usize {
        self.range.len()
    }
}

/// Orders a set so that its first part, whose length is returned, is one side of
/// the cheapest cut between bins; by halves where no cut parts the centres.
pub fn halve(items: &mut [Record]) -> usize {
    let centres = items.iter().map(|item| item.bounds.centre());
    let (low, high) = centres.fold((Vec3::INFINITY, Vec3::NEG_INFINITY), |(low, high), c| {
        (low.min(c), high.max(c))
    });
    let scale = BINS as f32 / (high - low);
    let bin = |item: &Record, axis: usize| {
        let along = (item.bounds.centre()[axis] - low[axis]) * scale[axis];
        (along as usize).min(BINS - 1)
    };
    let mut best: Option<(f32, usize, usize)> = None;
    for axis in (0..3).filter(|&axis| scale[axis].is_finite()) {
        let mut bins = [(Aabb::EMPTY, 0usize); BINS];
        for item in items.iter() {
            let bin = &mut bins[bin(item, axis)];
            *bin = (bin.0.union(&item.bounds), bin.1 + 1);
        }
        // What lies above each cut.
        let mut above = [(Aabb::EMPTY, 0); BINS];
        for i in (1..BINS).rev() {
            let rest = above.get(i).copied().unwrap_or((Aabb::EMPTY, 0));
            above[i - 1] = (rest.0.union(&bins[i].0), rest.1 + bins[i].1);
        }
        let mut below = (Aabb::EMPTY, 0);
        for i in 0..BINS - 1 {
            below = (below.0.union(&bins[i].0), below.1 + bins[i].1);
            let cost =
                below.0.half_area() * below.1 as f32 + above[i].0.half_area() * above[i].1 as f32;
            let parts = below.1 > 0 && above[i].1 > 0;
            if parts && cost.is_finite() && best.is_none_or(|best| cost < best.0) {
                best = Some((cost, axis, i));
            }
        }
    }
    let Some((_, axis, last)) = best else {
        return items.len() / 2;
    };
    let mut first = 0;
    for i in 0..items.len() {
        if bin(&items[i], axis) <= last {
            items.swap(first, i);
            first += 1;
        }
    }
    first
}
