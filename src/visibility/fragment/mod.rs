//! The fragment stage: the fragments that survive at each sample.
//!
//! Solids are drawn sample by sample with the rays of a camera, in the order of a list; the
//! z-test keeps the nearest, the alpha-test drops the clear parts of a mask, the
//! stencil-test restricts the samples. The cost of an order (overdraw) and its errors are
//! counted.
//!
//! A fragment is an item at a sample whose ray meets the item: where it enters it,
//! so front faces only, as it is said where [`Solids`](super::Solids) are.

mod canvas;
mod cut_outs;
mod cycles;
mod depth;
mod draw;
mod errors;
mod layers;
mod mask;
pub mod order;
mod screen;
mod stencil;

#[cfg(test)]
mod tests;

pub use canvas::{Canvas, Fragment};
pub use cut_outs::CutOuts;
pub use depth::DepthBuffer;
pub use draw::{Drawn, Tally, Tests, draw};
pub use errors::{OrderErrors, TooManyPairs, order_errors};
pub use layers::draw_surfaces;
pub use mask::{Holes, MASKS, Mask, Surface};
pub use order::{DepthOrder, Part, Piece, ToOrder};
pub use screen::{Rectangle, Screen};
pub use stencil::Stencil;
