//! Cost of updating an index after items have moved.

use super::clock::Stopwatch;
use super::{Verdict, compare_with_scan, input_of};
use crate::geometry::Aabb;
use crate::index::{DynIndex, StructureSpec};
use crate::query::{AnyVolume, ItemId};
use crate::scene::Scene;

/// Shares of the items that move in the updates that are measured.
pub const UPDATE_SHARES: [f64; 4] = [0.001, 0.01, 0.1, 1.0];
/// Share of the items that move in an untimed update.
pub(super) const USUAL_SHARE: f64 = 0.01;
/// Largest scene whose updates are measured: they need a second copy of it.
pub(super) const MOST_UPDATED: usize = 2_000_000;

/// Times an update for each of [`UPDATE_SHARES`], CPU ms; consumes the index.
///
/// Each update moves a share of the items by their own size. The first one, which touches
/// memory for the first time, is not timed. A search after the last one is checked.
pub(super) fn measure_updates(
    spec: &StructureSpec,
    scene: &Scene,
    items: &[Aabb],
    mut index: Box<dyn DynIndex>,
) -> Result<Vec<f64>, Verdict> {
    if items.is_empty() || items.len() > MOST_UPDATED {
        return Ok(Vec::new());
    }
    let mut items = items.to_vec();
    let mut times = Vec::with_capacity(UPDATE_SHARES.len());
    let first = move_share(&mut items, USUAL_SHARE);
    spec.update(&mut index, input_of(scene, &items), &first)?;
    for share in UPDATE_SHARES {
        let moved = move_share(&mut items, share);
        let watch = Stopwatch::start_for(spec.is_threaded());
        spec.update(&mut index, input_of(scene, &items), &moved)?;
        times.push(watch.lap().cpu_ns / 1e6);
    }
    if let Some(moved) = items.iter().find(|b| !b.is_empty()) {
        let point = AnyVolume::Point(moved.min);
        let answer = |out: &mut Vec<ItemId>| index.query(point, out);
        compare_with_scan(&items, point, "a search after updates", answer)?;
    }
    Ok(times)
}

/// Moves evenly spread items by their own extent, within f32; returns their ids.
pub fn move_share(items: &mut [Aabb], share: f64) -> Vec<ItemId> {
    let count = ((items.len() as f64 * share).round() as usize).clamp(1, items.len());
    let spread = (0..count).map(|i| (i * items.len() / count) as ItemId);
    let moved: Vec<ItemId> = spread.collect();
    for &id in &moved {
        let b = &mut items[id as usize];
        let step = b.extent();
        let moved = Aabb::new(b.min + step, b.max + step);
        *b = if moved.is_finite() { moved } else { *b };
    }
    moved
}
