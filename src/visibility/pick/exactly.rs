//! The nearest of some candidates, decided exactly: what the exact back ends end
//! with.

use std::cmp::Ordering;

use super::contract::Hit;
use super::entry::{Crossing, entry};
use crate::query::ItemId;
use crate::scene::WorldBox;
use crate::visibility::Ray;

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
            depth: self.at.depth(),
        }
    }

    fn order(&self, other: &Met, ray: &Ray) -> Ordering {
        self.at
            .order(&other.at, ray)
            .then(self.item.cmp(&other.item))
    }
}

/// The first of the candidates that the ray meets.
#[inline]
pub(super) fn first<'a>(
    ray: &Ray,
    candidates: impl IntoIterator<Item = (ItemId, &'a WorldBox)>,
) -> Option<Hit> {
    let mut best: Option<Met> = None;
    for (item, b) in candidates {
        if let Some(at) = entry(ray, b) {
            let met = Met { item, at };
            if best.is_none_or(|best| met.order(&best, ray).is_lt()) {
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
    let met = |(item, b)| entry(ray, b).map(|at| Met { item, at });
    let mut all: Vec<Met> = candidates.into_iter().filter_map(met).collect();
    all.sort_unstable_by(|a, b| a.order(b, ray));
    if let Some(last) = all.get(last).copied() {
        let kept = all.partition_point(|met| met.at.order(&last.at, ray).is_le());
        all.truncate(kept);
    }
    hits.extend(all.iter().map(Met::hit));
}
