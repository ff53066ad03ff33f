//! Marking a stencil: where a portal or a mirror is seen.

use super::canvas::Canvas;
use super::depth::DepthBuffer;
use super::stencil::Stencil;
use crate::scene::WorldBox;

impl Stencil {
    /// The samples that see a flat rectangle (a box with no thickness along one
    /// axis) before what is in the depth buffer already, or as near.
    pub fn of_rectangle(canvas: &Canvas, rectangle: &WorldBox, depth: &DepthBuffer) -> Stencil {
        let mut marked = vec![false; canvas.grid().samples()];
        let asked = canvas.meet(rectangle, None, |sample, at| {
            let before = |(front, _): (_, _)| canvas.probe(sample).compare(&at, &front).is_le();
            marked[sample] = depth.front(sample).is_none_or(before);
        });
        let mut stencil = Stencil::of(marked);
        stencil.asked = asked.samples;
        stencil
    }
}
