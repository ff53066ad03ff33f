//! Samples of boxes and of triangles compared with an independent reference.

mod boxes;
pub mod judge;
mod triangles;

use super::{Body, BodyIndex, Front, SampleTruth};
use crate::query::{ItemId, distinct};
use crate::scene::SeededRng;
use crate::threads;
use crate::visibility::{Ray, Rays, SampleGrid};

impl SampleTruth {
    /// Traces every ray of the grid through bodies without holes.
    pub fn of<B: Body>(
        index: &BodyIndex<B>,
        rays: &Rays,
        grid: SampleGrid,
        threads: usize,
    ) -> SampleTruth {
        let all = SampleTruth::of_opaque(index, &|_, _, _| true, rays, grid, threads, u64::MAX);
        all.expect("no limit")
    }
}

/// Id used where a ray meets nothing.
pub const NO_ITEM: ItemId = ItemId::MAX;

/// Front item of each sample, row by row from the top left.
///
/// The lowest id of a tie, [`NO_ITEM`] if there is none.
pub fn fronts<B: Body>(
    index: &BodyIndex<B>,
    is_opaque: &impl Fn(&B, &B::Probe, &B::Hit) -> bool,
    rays: &Rays,
    grid: SampleGrid,
) -> Vec<ItemId> {
    let mut seen = Front::new();
    let front = |ray: Ray| {
        seen.search(index, &ray, is_opaque);
        seen.front.first().copied().unwrap_or(NO_ITEM)
    };
    rays.of_grid(grid).map(front).collect()
}

/// Items visible along any of `count` seeded random rays through the window.
///
/// Ascending. A conservative back end returns all of them. Independent of the number of threads.
pub fn visible_by_random_rays<B: Body>(
    index: &BodyIndex<B>,
    rays: &Rays,
    count: usize,
    seed: u64,
    threads: usize,
) -> Vec<ItemId> {
    const CHUNK: usize = 4096;
    let mut found = vec![Vec::new(); count.div_ceil(CHUNK)];
    threads::share(threads, found.iter_mut().enumerate(), |(chunk, found)| {
        // A random stream per chunk, whichever thread runs it.
        let mut rng = SeededRng::new(seed.wrapping_add((chunk as u64) << 32));
        let mut seen = Front::new();
        for _ in 0..CHUNK.min(count - chunk * CHUNK) {
            let (x, y) = (rng.unit(), rng.unit());
            seen.search(index, &rays.through(x, y), &|_, _, _| true);
            found.extend_from_slice(&seen.front);
            found.extend_from_slice(&seen.before);
        }
        found.sort_unstable();
        found.dedup();
    });
    distinct(found.concat())
}
