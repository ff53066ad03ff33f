//! Picking with the tree of the sample truth, sixteen slab tests at once.
//!
//! A body is tested exactly as soon as its box may be entered before the nearest hit so far.

use super::Pick;
use super::exact::NearestHit;
use crate::kernel::Kernel;
use crate::query::ItemId;
use crate::visibility::Ray;
use crate::visibility::truth::{Bodies, Body, BodyIndex};

/// Bodies of a scene, to be picked with an instruction set.
#[derive(Clone, Debug)]
pub struct WideRay<B>(BodyIndex<B>);

impl<B: Body> WideRay<B> {
    /// Builds the tree. O(n log n). Its answers do not depend on the `kernel`.
    pub fn of(bodies: &Bodies<B>, kernel: Kernel) -> WideRay<B> {
        WideRay(BodyIndex::of(bodies, kernel))
    }
}

impl<B: Body> Pick for WideRay<B> {
    #[inline]
    fn first(&self, ray: &Ray) -> Option<ItemId> {
        let of = &self.0;
        let mut first = NearestHit::<B>::new(of.probe(ray), ray.far);
        of.walk(ray, &mut first);
        first.item(of.items)
    }
}
