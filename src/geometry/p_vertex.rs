//! Which rows of a block are a plane's corners.

use super::PVertexSigns;

/// Some of the six rows of a [`BoxBlock`](super::BoxBlock), one bit each.
pub type RowMask = u8;

/// All of them.
pub const ALL_ROWS: RowMask = 0b11_1111;

/// The rows of a block that hold the p-vertices of a plane, and those of the
/// opposite corners, its n-vertices: the same ones for every box.
#[derive(Clone, Copy, Debug)]
pub struct PVertexRows {
    /// Whether the p-vertex is at the upper bound, axis by axis. Booleans and no
    /// numbers: a row of theirs needs no check.
    upper: PVertexSigns,
}

impl PVertexRows {
    /// Of the upper bounds where `upper` says so.
    pub const fn of(upper: PVertexSigns) -> PVertexRows {
        PVertexRows { upper }
    }

    #[inline(always)]
    pub(super) fn far(self) -> [usize; 3] {
        let [x, y, z] = self.upper;
        [
            3 * usize::from(x),
            1 + 3 * usize::from(y),
            2 + 3 * usize::from(z),
        ]
    }

    #[inline(always)]
    pub(super) fn near(self) -> [usize; 3] {
        let [x, y, z] = self.upper;
        [
            3 * usize::from(!x),
            1 + 3 * usize::from(!y),
            2 + 3 * usize::from(!z),
        ]
    }

    /// The rows of the p-vertices as a set.
    #[inline(always)]
    pub fn rows(self) -> RowMask {
        self.far().iter().fold(0, |rows, &row| rows | 1 << row)
    }
}
