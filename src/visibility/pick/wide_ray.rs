//! Picking with the tree of the sample truth, sixteen slab tests at once.
//!
//! A body is tested exactly as soon as its box may be entered before the nearest hit so far.

use super::Pick;
use super::exact::{self, NearestHit};
use crate::kernel::Kernel;
use crate::query::ItemId;
use crate::visibility::Ray;
use crate::visibility::truth::{Bodies, Body, BodyIndex, RayProbe, Visit};

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

    fn nearest(&self, ray: &Ray, count: usize, out: &mut Vec<ItemId>) {
        if count == 0 {
            return;
        }
        let of = &self.0;
        let probe = of.probe(ray);
        let mut found = Several {
            items: of.items,
            probe: &probe,
            count,
            far: ray.far,
            lowest: Vec::new(),
            hits: Vec::new(),
        };
        of.walk(ray, &mut found);
        exact::nearest::<B>(&probe, found.hits, count, out);
    }
}

/// Meetings with the first `count` items so far.
struct Several<'a, B: Body> {
    items: usize,
    probe: &'a B::Probe,
    count: usize,
    far: f64,
    /// Lowest upper bounds of depths, with their items; at most `count`, sorted.
    lowest: Vec<(f64, ItemId)>,
    hits: Vec<(ItemId, B::Hit)>,
}

impl<B: Body> Several<'_, B> {
    /// Upper bound of the depths of the first `count` items.
    #[inline(always)]
    fn limit(&self) -> f64 {
        let last = self.lowest.get(self.count - 1);
        last.map_or(self.far, |last| last.0.min(self.far))
    }
}

impl<B: Body> Visit<B> for Several<'_, B> {
    #[inline(always)]
    fn visit(&mut self, body: &B) -> f64 {
        let (item, limit) = (body.item(), self.limit());
        if item as usize >= self.items {
            return limit;
        }
        let Some(at) = body.hit(self.probe, limit) else {
            return limit;
        };
        self.hits.push((item, at));
        let latest = B::Probe::max_depth(&at);
        if latest < limit {
            let lowest = &mut self.lowest;
            match lowest.iter().position(|of| of.1 == item) {
                Some(same) if lowest[same].0 <= latest => return limit,
                Some(same) => drop(lowest.remove(same)),
                None => lowest.truncate(self.count - 1),
            }
            let at = lowest.partition_point(|other| other.0 <= latest);
            lowest.insert(at, (latest, item));
        }
        self.limit()
    }
}
