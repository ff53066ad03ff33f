//! Every body tested, exactly: the reference for the other back ends.

use super::contract::{BackEnd, Hit, Pick};
use super::exactly::{self, First};
use crate::visibility::truth::{Bodies, Body};
use crate::visibility::{Guarantee, Ray};

/// The row of this file.
pub const ROW: BackEnd = BackEnd {
    name: "linear",
    summary: "every box or triangle, in exact arithmetic: the reference",
    guarantee: Guarantee::Exact,
    boxes: |boxes, _| Ok(Box::new(Linear(boxes.clone()))),
    facets: |facets, _| Ok(Box::new(Linear(facets.clone()))),
};

/// All bodies, item by item.
#[derive(Clone, Debug)]
pub struct Linear<B>(pub Bodies<B>);

impl<B: Body> Pick for Linear<B> {
    /// O(n).
    fn first(&self, ray: &Ray) -> Option<Hit> {
        let mut first = First::<B>::new(B::probe(ray, self.0.origin), f64::INFINITY);
        self.0.all.iter().for_each(|body| {
            first.offer(body);
        });
        first.hit(self.0.items)
    }

    /// O(n), and sorting what the ray meets.
    fn nearest(&self, ray: &Ray, count: usize, hits: &mut Vec<Hit>) {
        let probe = B::probe(ray, self.0.origin);
        let counted = self
            .0
            .all
            .iter()
            .filter(|body| (body.item() as usize) < self.0.items);
        let met = counted.filter_map(|body| Some((body.item(), body.meet(&probe, ray.far)?)));
        exactly::nearest::<B>(&probe, met.collect(), count, hits);
    }
}
