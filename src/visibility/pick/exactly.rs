//! The exact decision among candidates, and the reference that tests every body.

use std::cmp::Ordering;

use super::{Hit, Pick};
use crate::query::ItemId;
use crate::visibility::Ray;
use crate::visibility::truth::{Along, Bodies, Body, BodyIndex, Visit};

/// An item and where a ray meets it.
type Met<B> = (ItemId, <B as Body>::At);

/// Exact order by depth, then by id.
#[inline]
fn order<B: Body>(probe: &B::Probe, a: &Met<B>, b: &Met<B>) -> Ordering {
    probe.compare(&a.1, &b.1).then(a.0.cmp(&b.0))
}

/// A hit, unless its item is not among the first `items`.
#[inline]
fn hit<B: Body>((item, at): Met<B>, items: usize) -> Option<Hit> {
    let depth = B::Probe::depth(&at);
    ((item as usize) < items).then_some(Hit { item, depth })
}

/// The first of the candidates so far that a ray meets.
pub(super) struct First<B: Body> {
    probe: B::Probe,
    /// Upper bound of the depth of the first one.
    limit: f64,
    best: Option<Met<B>>,
}

impl<B: Body> First<B> {
    /// Starts without candidates; nothing beyond `limit` counts.
    #[inline]
    pub fn new(probe: B::Probe, limit: f64) -> First<B> {
        First {
            probe,
            limit,
            best: None,
        }
    }

    /// Tests a candidate.
    #[inline(always)]
    pub fn offer(&mut self, body: &B) {
        let Some(at) = body.meet(&self.probe, self.limit) else {
            return;
        };
        let met = (body.item(), at);
        let is_first = |best: Met<B>| order::<B>(&self.probe, &met, &best).is_lt();
        if self.best.is_none_or(is_first) {
            self.best = Some(met);
            self.limit = self.limit.min(B::Probe::at_most(&at));
        }
    }

    /// The first hit, if it is one of the first `items`.
    #[inline]
    pub fn hit(&self, items: usize) -> Option<Hit> {
        hit::<B>(self.best?, items)
    }
}

impl<B: Body> Visit<B> for First<B> {
    #[inline(always)]
    fn visit(&mut self, body: &B) -> f64 {
        self.offer(body);
        self.limit
    }
}

/// Replaces `hits` by the first `count` items of the meetings.
///
/// All items as deep as the last of them are included.
pub(super) fn nearest<B: Body>(
    probe: &B::Probe,
    mut met: Vec<Met<B>>,
    count: usize,
    hits: &mut Vec<Hit>,
) {
    if !B::IS_BOX {
        met.sort_unstable_by(|a, b| a.0.cmp(&b.0).then_with(|| probe.compare(&a.1, &b.1)));
        met.dedup_by_key(|(item, _)| *item);
    }
    met.sort_unstable_by(|a, b| order::<B>(probe, a, b));
    match count.checked_sub(1).map(|last| met.get(last)) {
        None => met.clear(),
        Some(None) => {}
        Some(Some(&(_, last))) => {
            met.truncate(met.partition_point(|(_, at)| probe.compare(at, &last).is_le()));
        }
    }
    hits.clear();
    hits.extend(met.into_iter().filter_map(|met| hit::<B>(met, usize::MAX)));
}

/// The truth of picking, by the tree of the truth of samples.
impl<B: Body> Pick for BodyIndex<B> {
    fn first(&self, ray: &Ray) -> Option<Hit> {
        let found = self.front_of(ray);
        hit::<B>((*found.front.first()?, found.meeting?), self.items)
    }

    fn nearest(&self, ray: &Ray, count: usize, hits: &mut Vec<Hit>) {
        let mut met = self.all_along(ray);
        met.retain(|(item, _)| (*item as usize) < self.items);
        nearest::<B>(&self.probe(ray), met, count, hits);
    }
}

/// All bodies, item by item.
#[derive(Clone, Debug)]
pub struct Linear<B>(pub Bodies<B>);

impl<B: Body> Pick for Linear<B> {
    /// O(n).
    fn first(&self, ray: &Ray) -> Option<Hit> {
        let mut first = First::<B>::new(B::probe(ray, self.0.origin), f64::INFINITY);
        self.0.all.iter().for_each(|body| first.offer(body));
        first.hit(self.0.items)
    }

    /// O(n), and sorting what the ray meets.
    fn nearest(&self, ray: &Ray, count: usize, hits: &mut Vec<Hit>) {
        let probe = B::probe(ray, self.0.origin);
        let counted = |body: &&B| (body.item() as usize) < self.0.items;
        let met = self.0.all.iter().filter(counted);
        let met = met.filter_map(|body| Some((body.item(), body.meet(&probe, ray.far)?)));
        nearest::<B>(&probe, met.collect(), count, hits);
    }
}
