//! Exact choice among candidates, and the reference that tests every body.

use super::{Pick, PickTruth};
use crate::query::ItemId;
use crate::visibility::truth::{Bodies, Body, BodyIndex, Visit};
use crate::visibility::{Ray, RayProbe};

/// An item and the point where a ray meets it.
type ItemHit<B> = (ItemId, <B as Body>::Hit);

/// Nearest candidate so far that a ray meets.
pub(super) struct NearestHit<B: Body> {
    probe: B::Probe,
    /// Upper bound of the depth of the nearest candidate.
    limit: f64,
    best: Option<ItemHit<B>>,
}

impl<B: Body> NearestHit<B> {
    /// Starts without candidates; ignores everything beyond `limit`.
    #[inline]
    pub fn new(probe: B::Probe, limit: f64) -> NearestHit<B> {
        NearestHit {
            probe,
            limit,
            best: None,
        }
    }

    /// Nearest item, if its id is below `items`.
    #[inline]
    pub fn item(&self, items: usize) -> Option<ItemId> {
        let item = self.best.map(|hit| hit.0);
        item.filter(|&item| (item as usize) < items)
    }
}

impl<B: Body> Visit<B> for NearestHit<B> {
    #[inline(always)]
    fn visit(&mut self, body: &B) -> f64 {
        if let Some(at) = body.hit(&self.probe, self.limit) {
            let item = body.item();
            let order = |best: ItemHit<B>| self.probe.compare(&at, &best.1).then(item.cmp(&best.0));
            if self.best.is_none_or(|best| order(best).is_lt()) {
                self.best = Some((item, at));
                self.limit = self.limit.min(B::Probe::max_depth(&at));
            }
        }
        self.limit
    }
}

/// Reference of picking, over the same tree as the sample truth.
impl<B: Body> Pick for BodyIndex<B> {
    fn first(&self, ray: &Ray) -> Option<ItemId> {
        let front = self.front_of(ray).front;
        let item = front.first().copied();
        item.filter(|&item| (item as usize) < self.items)
    }
}

impl<B: Body> PickTruth for BodyIndex<B> {
    fn met(&self, ray: &Ray) -> Vec<ItemId> {
        let items = self.all_hits(ray).into_iter().map(|(item, _)| item);
        items.filter(|&item| (item as usize) < self.items).collect()
    }
}

/// Linear search over all bodies, item by item.
#[derive(Clone, Debug)]
pub struct LinearScan<B>(pub Bodies<B>);

impl<B: Body> Pick for LinearScan<B> {
    /// O(n).
    fn first(&self, ray: &Ray) -> Option<ItemId> {
        let mut first = NearestHit::<B>::new(B::probe(ray, self.0.origin), f64::INFINITY);
        for body in &self.0.all {
            first.visit(body);
        }
        first.item(self.0.items)
    }
}
