//! Exact choice among candidates, and the reference that tests every body.

use std::cmp::Ordering;

use super::Pick;
use crate::query::ItemId;
use crate::visibility::Ray;
use crate::visibility::truth::{Bodies, Body, BodyIndex, RayProbe, Visit};

/// An item and the point where a ray meets it.
type ItemHit<B> = (ItemId, <B as Body>::Hit);

/// Exact order by depth, then by id.
#[inline]
fn order<B: Body>(probe: &B::Probe, a: &ItemHit<B>, b: &ItemHit<B>) -> Ordering {
    probe.compare(&a.1, &b.1).then(a.0.cmp(&b.0))
}

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
        self.best
            .map(|hit| hit.0)
            .filter(|&item| (item as usize) < items)
    }
}

impl<B: Body> Visit<B> for NearestHit<B> {
    #[inline(always)]
    fn visit(&mut self, body: &B) -> f64 {
        if let Some(at) = body.hit(&self.probe, self.limit) {
            let hit = (body.item(), at);
            let is_first = |best: ItemHit<B>| order::<B>(&self.probe, &hit, &best).is_lt();
            if self.best.is_none_or(is_first) {
                self.best = Some(hit);
                self.limit = self.limit.min(B::Probe::max_depth(&at));
            }
        }
        self.limit
    }
}

/// Appends the first `count` items of the meetings.
///
/// Includes all items at the depth of the last of them.
pub(super) fn nearest<B: Body>(
    probe: &B::Probe,
    mut hits: Vec<ItemHit<B>>,
    count: usize,
    out: &mut Vec<ItemId>,
) {
    if !B::IS_BOX {
        hits.sort_unstable_by(|a, b| a.0.cmp(&b.0).then_with(|| probe.compare(&a.1, &b.1)));
        hits.dedup_by_key(|(item, _)| *item);
    }
    hits.sort_unstable_by(|a, b| order::<B>(probe, a, b));
    match count.checked_sub(1).map(|last| hits.get(last)) {
        None => hits.clear(),
        Some(None) => {}
        Some(Some(&(_, last))) => {
            hits.truncate(hits.partition_point(|(_, at)| probe.compare(at, &last).is_le()));
        }
    }
    out.extend(hits.into_iter().map(|(item, _)| item));
}

/// Reference of picking, over the same tree as the sample truth.
impl<B: Body> Pick for BodyIndex<B> {
    fn first(&self, ray: &Ray) -> Option<ItemId> {
        let front = self.front_of(ray).front;
        front
            .first()
            .copied()
            .filter(|&item| (item as usize) < self.items)
    }

    fn nearest(&self, ray: &Ray, count: usize, out: &mut Vec<ItemId>) {
        let mut hits = self.all_hits(ray);
        hits.retain(|(item, _)| (*item as usize) < self.items);
        nearest::<B>(&self.probe(ray), hits, count, out);
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

    /// O(n + k log k) for the k bodies that the ray meets.
    fn nearest(&self, ray: &Ray, count: usize, out: &mut Vec<ItemId>) {
        let probe = B::probe(ray, self.0.origin);
        let counted = |body: &&B| (body.item() as usize) < self.0.items;
        let hits = self.0.all.iter().filter(counted);
        let hits = hits.filter_map(|body| Some((body.item(), body.hit(&probe, ray.far)?)));
        nearest::<B>(&probe, hits.collect(), count, out);
    }
}
