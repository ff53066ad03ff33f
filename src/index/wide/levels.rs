//! The blocks of the wide tree by level.

use std::ops::Range;

use crate::geometry::{Balls, BoxBlock, LANES, LaneMask};
use crate::query::runs;

/// A level's position among the blocks of the tree.
#[derive(Clone, Copy, Debug)]
pub struct Level {
    /// Index of its first block.
    pub first: usize,
    /// Number of its blocks.
    pub blocks: usize,
    /// Boxes in these blocks; only the last block has lanes without one.
    pub boxes: usize,
}

impl Level {
    /// The levels of a tree over `boxes` boxes, lowest first; none for no boxes.
    pub fn over(mut boxes: usize) -> Vec<Level> {
        let mut levels: Vec<Level> = Vec::new();
        while boxes > 0 {
            let (blocks, first) = (boxes.div_ceil(LANES), levels.last().map_or(0, Level::end));
            levels.push(Level {
                first,
                blocks,
                boxes,
            });
            boxes = if blocks > 1 { blocks } else { 0 };
        }
        levels
    }

    /// Index after its last block.
    pub fn end(&self) -> usize {
        self.first + self.blocks
    }

    /// The lanes of a block above the leaves that hold a box.
    #[inline(always)]
    pub fn lanes(&self, block: usize) -> LaneMask {
        if block + 1 < self.blocks {
            LaneMask::MAX
        } else {
            LaneMask::MAX >> (self.blocks * LANES - self.boxes)
        }
    }
}

/// One level during a traversal.
pub struct Layer<'t> {
    /// Its blocks.
    pub blocks: &'t [BoxBlock],
    /// Its position.
    pub level: Level,
    /// Items below one lane.
    pub span: usize,
    /// True if its memory is prefetched.
    pub far: bool,
    /// Spheres of its items, for a query of spheres.
    pub balls: Option<Balls<'t>>,
}

impl Layer<'_> {
    /// Positions of the items below some lanes of a block, run by run.
    ///
    /// There are `count` items in the tree.
    #[inline(always)]
    pub fn items_of(
        &self,
        block: usize,
        lanes: LaneMask,
        count: usize,
    ) -> impl Iterator<Item = Range<usize>> {
        let (first, span) = (block * LANES, self.span);
        runs(lanes).map(move |run| {
            let end = ((first + run.end) * span).min(count);
            (first + run.start) * span..end
        })
    }

    /// Prefetches the block of an entry of a frontier, if there is such an entry.
    #[inline(always)]
    pub fn prefetch(&self, entries: &[u32], i: usize) {
        if self.far
            && let Some(&block) = entries.get(i)
            && let Some(block) = self.blocks.get(block as usize)
        {
            block.prefetch();
        }
    }
}
