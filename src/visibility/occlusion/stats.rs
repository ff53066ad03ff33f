//! What a view took, in numbers of things.

/// Counts of one view.
#[derive(Clone, Copy, PartialEq, Eq, Default, Debug)]
pub struct CullStats {
    /// Boxes of nodes and items that were projected.
    pub boxes: usize,
    /// Occluders drawn.
    pub drawn: usize,
    /// Items that were not removed.
    pub kept: usize,
}
