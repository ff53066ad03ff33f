//! Rows of a block that hold the corners of its boxes a plane test reads.

/// BoxCorner of a box: on each axis the upper bound, or else the lower one.
///
/// The p-vertex of a plane (the corner farthest along its normal) is the same corner of
/// every box, and so three fixed rows of a block.
// Booleans and no numbers: a row of theirs needs no check.
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct BoxCorner(pub [bool; 3]);

impl BoxCorner {
    /// The corner across the box; of a p-vertex the n-vertex.
    #[inline(always)]
    pub(super) fn opposite(self) -> BoxCorner {
        let BoxCorner([x, y, z]) = self;
        BoxCorner([!x, !y, !z])
    }

    /// Rows of a block that hold its coordinates.
    #[inline(always)]
    pub(super) fn rows(self) -> [usize; 3] {
        let BoxCorner([x, y, z]) = self;
        [
            3 * usize::from(x),
            1 + 3 * usize::from(y),
            2 + 3 * usize::from(z),
        ]
    }
}
