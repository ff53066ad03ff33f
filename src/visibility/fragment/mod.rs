//! The fragment stage: the fragments that survive at each sample.
//!
//! Solids are drawn sample by sample with the rays of a camera, in the order of a list; the
//! z-test keeps the nearest, the alpha-test drops the clear parts of a mask, the
//! stencil-test restricts the samples. The cost of an order (overdraw) is counted.
//!
//! A fragment is an item at a sample whose ray meets the item: where it enters it,
//! so front faces only, as it is said where [`Solids`](super::Solids) are.

mod canvas;
mod cut_outs;
mod draw;

pub use canvas::{Canvas, Rectangle, Screen, Stencil};
pub use cut_outs::{CutOuts, Holes, MASKS, Mask, Surface};
pub use draw::{Drawable, Drawn, Tally, Tests};

#[cfg(test)]
mod tests;
