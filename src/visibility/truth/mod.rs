//! Visible items, exact along the rays of a sample grid.
//!
//! Tests compare them with arithmetic on integers of any length.

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

pub use body::{Bodies, Body, Boxes, Facet, Facets, SolidBox};
pub use ray_box::{BoxHit, Probe};
pub use ray_index::{BodyIndex, Front, RayIndex, SurfaceIndex, Visit};
pub use ray_triangle::{TriangleHit, TriangleProbe};

#[cfg(test)]
pub(super) use tests::{NO_ITEM, fronts, judge, visible_by_random_rays};

/// Items visible along the rays of a sample grid, exact for these rays.
///
/// Independent of the number of threads.
#[derive(Clone, PartialEq, Eq, Debug)]
pub struct SampleTruth {
    /// Items in front along any ray, ascending, with every item of a tie.
    pub visible: Vec<ItemId>,
    /// Number of rays that see each of `visible`; a tie counts for each of its items.
    pub samples_of: Vec<u32>,
}

impl SampleTruth {
    /// Traces every ray of a grid through bodies with holes.
    ///
    /// O(samples * log n) in common scenes. A ray ends at the first hiding body that is opaque
    /// where the ray meets it; bodies that hide nothing and are met before count as visible too.
    /// `None`, early, if the sum of `samples_of` would exceed `most`.
    pub fn of_opaque<B: Body>(
        index: &BodyIndex<B>,
        is_opaque: &(impl Fn(&B, &B::Probe, &B::Hit) -> bool + Sync),
        rays: &Rays,
        grid: SampleGrid,
        threads: usize,
        most: u64,
    ) -> Option<SampleTruth> {
        let seen_count = AtomicU64::new(0);
        let seen = threads::map(threads, 0..grid.height, |row| {
            let (mut front, mut seen) = (Front::new(), Vec::new());
            for column in 0..grid.width {
                if seen_count.load(Ordering::Relaxed) > most {
                    break;
                }
                front.search(index, &rays.sample(grid, column, row), is_opaque);
                let count = (front.before.len() + front.front.len()) as u64;
                seen_count.fetch_add(count, Ordering::Relaxed);
                seen.extend(front.before.iter().chain(&front.front));
            }
            seen
        });
        if seen_count.into_inner() > most {
            return None;
        }
        let mut samples = vec![0u32; index.items];
        let seen = seen.into_iter().flatten();
        seen.for_each(|item: ItemId| samples[item as usize] += 1);
        let counts = (0..).zip(samples);
        let (visible, samples_of) = counts.filter(|(_, count)| *count > 0).unzip();
        Some(SampleTruth {
            visible,
            samples_of,
        })
    }
}
