//! The nearest of some candidates, decided exactly: what the exact back ends end
//! with.

use std::cmp::Ordering;

use super::contract::Hit;
use crate::query::ItemId;
use crate::scene::WorldBox;
use crate::visibility::Ray;
use crate::visibility::truth::{Crossing, Probe};

/// An item that the ray meets, with its exact depth.
#[derive(Clone, Copy, Debug)]
pub(super) struct Met {
    pub item: ItemId,
    pub at: Crossing,
}

impl Met {
    pub fn hit(&self) -> Hit {
        Hit {
            item: self.item,
            depth: self.at.depth,
        }
    }

    fn order(&self, other: &Met, probe: &Probe) -> Ordering {
        let by_depth = probe.compare(&self.at, &other.at);
        by_depth.then(self.item.cmp(&other.item))
    }
}

/// The first of the candidates that the ray meets.
#[inline]
pub(super) fn first<'a>(
    ray: &Ray,
    candidates: impl IntoIterator<Item = (ItemId, &'a WorldBox)>,
) -> Option<Hit> {
    let probe = Probe::new(*ray);
    let mut best: Option<Met> = None;
    for (item, b) in candidates {
        let limit = best.map_or(ray.far, |best| best.at.at_most());
        if let Some(at) = probe.enter(b, limit) {
            let met = Met { item, at };
            if best.is_none_or(|best| met.order(&best, &probe).is_lt()) {
                best = Some(met);
            }
        }
    }
    best.map(|met| met.hit())
}

/// The first `count` of the candidates that the ray meets, and all that are as
/// deep as the last of them.
pub(super) fn nearest<'a>(
    ray: &Ray,
    count: usize,
    candidates: impl IntoIterator<Item = (ItemId, &'a WorldBox)>,
    hits: &mut Vec<Hit>,
) {
    hits.clear();
    let Some(last) = count.checked_sub(1) else {
        return;
    };
    let probe = Probe::new(*ray);
    let met = |(item, b)| probe.enter(b, ray.far).map(|at| Met { item, at });
    let mut all: Vec<Met> = candidates.into_iter().filter_map(met).collect();
    all.sort_unstable_by(|a, b| a.order(b, &probe));
    if let Some(last) = all.get(last).copied() {
        let kept = all.partition_point(|met| probe.compare(&met.at, &last.at).is_le());
        all.truncate(kept);
    }
    hits.extend(all.iter().map(Met::hit));
}
