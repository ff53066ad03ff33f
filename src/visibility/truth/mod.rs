//! The visible items, exact along the rays of a sample grid.
//!
//! Tests compare it with arithmetic on whole numbers of any length.

mod body;
mod ray_box;
mod ray_index;
mod ray_tree;
mod ray_triangle;
mod slabs;
#[cfg(test)]
pub(super) mod tests;

use std::sync::atomic::{AtomicU64, Ordering};

use crate::query::ItemId;
use crate::threads;
use crate::visibility::{Rays, SampleGrid};

pub use super::rays::Along;
pub use body::{Bodies, Body, Boxes, Facet, Facets, SolidBox};
pub use ray_box::{Crossing, Probe};
pub use ray_index::{BodyIndex, Front, RayIndex, SurfaceIndex, Visit};
pub use ray_triangle::{Meeting, TriangleProbe};

#[cfg(test)]
pub(super) use tests::{judge, visible_by_random_rays};

/// In place of an item where a ray meets nothing.
pub const NO_ITEM: ItemId = ItemId::MAX;

/// Rows of samples that a thread takes at a time.
const BAND: usize = 4;

/// Items that the rays of a sample grid see: exact for these rays.
///
/// The same on any number of threads.
#[derive(Clone, PartialEq, Eq, Debug)]
pub struct SampleTruth {
    /// The front item of each sample, row by row from the top left; the lowest of a
    /// tie, [`NO_ITEM`] where there is none.
    pub front: Vec<ItemId>,
    /// The items that are in front along any ray, ascending; all of a tie are.
    pub visible: Vec<ItemId>,
    /// Along how many rays, for each of `visible`: a tie counts for each.
    pub samples_of: Vec<u32>,
}

impl SampleTruth {
    /// Follows every ray through a scene of bodies with holes.
    ///
    /// O(samples * log n) in common scenes.
    /// `front` holds items that hide; `visible` has these and what is met before them.
    /// A ray ends at the first body that is opaque where the ray meets it. `None`, early, if
    /// `samples_of` would add up to more than `most`.
    pub fn of_opaque<B: Body>(
        index: &BodyIndex<B>,
        is_opaque: &(impl Fn(&B, &B::Probe, &B::At) -> bool + Sync),
        rays: &Rays,
        grid: SampleGrid,
        threads: usize,
        most: u64,
    ) -> Option<SampleTruth> {
        let width = grid.width as usize;
        let mut front = vec![NO_ITEM; grid.samples()];
        // Every visible item of a band but those in `front`.
        let mut others = vec![Vec::new(); (grid.height as usize).div_ceil(BAND)];
        let seen_count = AtomicU64::new(0);
        let rows = front.chunks_mut((width * BAND).max(1)).zip(&mut others);
        threads::share(threads, rows.enumerate(), |(band, (front, others))| {
            let mut seen = Front::new();
            for (place, sample) in front.iter_mut().enumerate() {
                if seen_count.load(Ordering::Relaxed) > most {
                    return;
                }
                let (column, row) = (place % width, band * BAND + place / width);
                let ray = rays.sample(grid, column as u32, row as u32);
                seen.search(index, &ray, is_opaque);
                let count = (seen.before.len() + seen.front.len()) as u64;
                seen_count.fetch_add(count, Ordering::Relaxed);
                others.extend_from_slice(&seen.before);
                if let Some((first, ties)) = seen.front.split_first() {
                    others.extend_from_slice(ties);
                    *sample = *first;
                }
            }
        });
        if seen_count.into_inner() > most {
            return None;
        }
        let mut samples = vec![0u32; index.items];
        let seen = front.iter().copied().filter(|&item| item != NO_ITEM);
        seen.chain(others.into_iter().flatten())
            .for_each(|item| samples[item as usize] += 1);
        let counts = (0..).zip(samples);
        let (visible, samples_of) = counts.filter(|(_, count)| *count > 0).unzip();
        Some(SampleTruth {
            front,
            visible,
            samples_of,
        })
    }
}
