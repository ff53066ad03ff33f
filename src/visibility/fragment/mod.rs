//! Fragment stage: the fragments that survive at each sample.
//!
//! Draws solids sample by sample with the rays of a camera, in list order. The z-test keeps the
//! nearest fragment, the alpha test drops the clear parts of a mask, the stencil test restricts the
//! samples. The cost of a draw order (overdraw) is counted.
//!
//! A fragment is an item at a sample whose ray meets the item, at the point of entry (front faces
//! only), as defined for [`Solids`](super::Solids).

mod canvas;
mod cut_outs;
mod draw;

pub use canvas::{Canvas, Rectangle, Screen, Stencil};
pub use cut_outs::{AlphaMasks, CutOuts, MASKS, Mask, TiledMask};
pub use draw::{Drawable, Drawn, FragmentCounts, Tests};

#[cfg(test)]
mod tests;
