//! The nearest of some candidates, decided exactly: what the exact back ends end
//! with.

use std::cmp::Ordering;

use super::contract::Hit;
use super::facets::Facet;
use crate::query::ItemId;
use crate::scene::WorldBox;
use crate::visibility::Ray;
use crate::visibility::truth::{Crossing, Meeting, Probe, TriangleProbe};

/// An item that the ray meets, with its exact depth.
#[derive(Clone, Copy, Debug)]
pub(super) struct Met {
    pub item: ItemId,
    pub at: Crossing,
}

impl Met {
    #[inline]
    pub fn hit(&self) -> Hit {
        Hit {
            item: self.item,
            depth: self.at.depth,
        }
    }

    #[inline]
    fn order(&self, other: &Met, probe: &Probe) -> Ordering {
        let by_depth = probe.compare(&self.at, &other.at);
        by_depth.then(self.item.cmp(&other.item))
    }
}

/// The first of the candidates so far that the ray meets.
pub(super) struct First {
    probe: Probe,
    best: Option<Met>,
}

impl First {
    /// Of none yet.
    #[inline]
    pub fn new(ray: &Ray) -> First {
        First {
            probe: Probe::new(*ray),
            best: None,
        }
    }

    /// One candidate more.
    #[inline]
    pub fn offer(&mut self, (item, b): (ItemId, &WorldBox)) {
        let far = self.probe.ray().far;
        let limit = self.best.map_or(far, |best| best.at.at_most());
        if let Some(at) = self.probe.enter(b, limit) {
            let met = Met { item, at };
            if self
                .best
                .is_none_or(|best| met.order(&best, &self.probe).is_lt())
            {
                self.best = Some(met);
            }
        }
    }

    /// What was met first.
    #[inline]
    pub fn hit(&self) -> Option<Hit> {
        self.best.map(|met| met.hit())
    }
}

/// The first of the candidates that the ray meets.
pub(super) fn first<'a>(
    ray: &Ray,
    candidates: impl IntoIterator<Item = (ItemId, &'a WorldBox)>,
) -> Option<Hit> {
    let mut first = First::new(ray);
    for candidate in candidates {
        first.offer(candidate);
    }
    first.hit()
}

/// The first `count` of the candidates that the ray meets, and all that are as
/// deep as the last of them.
pub(super) fn nearest<'a>(
    ray: &Ray,
    count: usize,
    candidates: impl IntoIterator<Item = (ItemId, &'a WorldBox)>,
    hits: &mut Vec<Hit>,
) {
    let probe = Probe::new(*ray);
    let met = |(item, b)| probe.enter(b, ray.far).map(|at| Met { item, at });
    nearest_met(
        &probe,
        candidates.into_iter().filter_map(met).collect(),
        count,
        hits,
    );
}

/// The first `count` of what was met, and all that are as deep as the last of them.
fn nearest_met(probe: &Probe, mut all: Vec<Met>, count: usize, hits: &mut Vec<Hit>) {
    hits.clear();
    let Some(last) = count.checked_sub(1) else {
        return;
    };
    all.sort_unstable_by(|a, b| a.order(b, probe));
    if let Some(last) = all.get(last).copied() {
        let kept = all.partition_point(|met| probe.compare(&met.at, &last.at).is_le());
        all.truncate(kept);
    }
    hits.extend(all.iter().map(Met::hit));
}

/// By depth, then by id.
#[inline]
pub(super) fn order_of_meetings(
    probe: &TriangleProbe,
    a: &(ItemId, Meeting),
    b: &(ItemId, Meeting),
) -> Ordering {
    probe.compare(&a.1, &b.1).then(a.0.cmp(&b.0))
}

fn meeting(probe: &TriangleProbe, facet: &Facet, limit: f64) -> Option<(ItemId, Meeting)> {
    let at = probe.meet(facet.corners, facet.two_sided, limit)?;
    Some((facet.item, at))
}

/// The first of the triangles, if it is of one of the items that count.
pub(super) fn first_facet<'a>(
    probe: &TriangleProbe,
    facets: impl Iterator<Item = &'a Facet>,
    items: usize,
) -> Option<Hit> {
    let mut best: Option<(ItemId, Meeting)> = None;
    for facet in facets {
        let limit = best.map_or(f64::INFINITY, |best| best.1.at_most());
        if let Some(met) = meeting(probe, facet, limit)
            && best.is_none_or(|best| order_of_meetings(probe, &met, &best).is_lt())
        {
            best = Some(met);
        }
    }
    let (item, at) = best?;
    let depth = at.depth;
    Hit { item, depth }.counted(items)
}

/// As [`nearest`], of the triangles of the items that count.
pub(super) fn nearest_facets<'a>(
    probe: &TriangleProbe,
    facets: impl Iterator<Item = &'a Facet>,
    items: usize,
    count: usize,
    hits: &mut Vec<Hit>,
) {
    let that_count = facets.filter(|facet| (facet.item as usize) < items);
    let met = that_count.filter_map(|facet| meeting(probe, facet, f64::INFINITY));
    nearest_meetings(probe, met.collect(), count, hits);
}

/// The first meeting of each item, the first `count` of these and all that are as deep as
/// the last of them.
pub(super) fn nearest_meetings(
    probe: &TriangleProbe,
    mut met: Vec<(ItemId, Meeting)>,
    count: usize,
    hits: &mut Vec<Hit>,
) {
    hits.clear();
    met.sort_unstable_by(|(a, at_a), (b, at_b)| a.cmp(b).then(probe.compare(at_a, at_b)));
    met.dedup_by_key(|(item, _)| *item);
    met.sort_by(|(_, a), (_, b)| probe.compare(a, b));
    if let Some((_, last)) = count.checked_sub(1).and_then(|last| met.get(last)).copied() {
        let kept = met.partition_point(|(_, at)| probe.compare(at, &last).is_le());
        met.truncate(kept);
    } else if count == 0 {
        met.clear();
    }
    let hit = |&(item, at): &(ItemId, Meeting)| Hit {
        item,
        depth: at.depth,
    };
    hits.extend(met.iter().map(hit));
}
