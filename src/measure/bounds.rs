//! Lower bounds, timed beside the structures: the cost of memory accesses alone.
//!
//! A bound answers nothing and is never ranked. It takes part in the same rounds as the structures,
//! so that a ratio to it is paired like any other.

use super::{TimedTask, Workload};
use crate::geometry::{Aabb, BoxBlocks};
use crate::kernel::{Isa, Kernel, Work};
use crate::query::ItemId;

/// A row of the table of bounds.
pub struct Bound {
    /// Name in `list metrics` and in reports: `bound-read`.
    pub name: &'static str,
    /// Its work, in one line.
    pub summary: &'static str,
    /// Makes the task of the bound, with its own copy of the data.
    ///
    /// From the queries to bound, the kernel of the structures' queries, and the number of items
    /// that each camera sees. `None` if there is nothing to read or copy.
    pub make: fn(&Workload, Kernel, &[u64]) -> Option<TimedTask<'static>>,
}

/// All bounds, in the order in which they are shown.
pub static BOUNDS: &[Bound] = rows! { Bound { name, summary, make }
    "bound-read", "reads the bounds of all items once, 24 bytes each, and tests nothing; what a scan must read, so a tree that skips most items can be faster", read;
    "bound-memcpy", "copies as many ids as are visible, 4 bytes each, in one piece", memcpy;
};

/// One pass over all blocks, as work for a kernel.
struct Read<'a>(&'a BoxBlocks);

impl Work for Read<'_> {
    type Output = u32;

    #[inline(always)]
    fn run<I: Isa>(self, _: I) -> u32 {
        self.0.xor_of_bits()
    }
}

fn read(workload: &Workload, kernel: Kernel, visible: &[u64]) -> Option<TimedTask<'static>> {
    let blocks = blocks_of(&workload.items);
    let expected = vec![0; visible.len()];
    (!blocks.is_empty()).then(|| {
        TimedTask::new(expected, move |_, _| {
            std::hint::black_box(kernel.run(Read(&blocks)));
        })
    })
}

/// All non-empty boxes in blocks, as the structures store them.
fn blocks_of(items: &[Aabb]) -> BoxBlocks {
    items.iter().filter(|b| !b.is_empty()).collect()
}

fn memcpy(workload: &Workload, _: Kernel, visible: &[u64]) -> Option<TimedTask<'static>> {
    let count = workload.items.len();
    let ids: Vec<ItemId> = (0..count as ItemId).collect();
    let lengths: Vec<usize> = visible.iter().map(|&v| v as usize).collect();
    // Each query copies from a different position, as answers do: the first ids alone would be
    // always the same few cache lines. Multiples of 2^32 / golden ratio spread them (Knuth, TAOCP
    // vol. 3, sec. 6.4).
    let scattered = |place: usize| (place as u32).wrapping_mul(0x9E37_79B9) as usize;
    let start = |(place, &length)| scattered(place) % (count + 1).saturating_sub(length).max(1);
    let starts: Vec<usize> = lengths.iter().enumerate().map(start).collect();
    lengths.iter().any(|&length| length > 0).then(|| {
        TimedTask::new(visible.to_vec(), move |place, out| {
            let start = starts[place];
            out.extend_from_slice(&ids[start..start + lengths[place]]);
        })
    })
}

#[cfg(test)]
mod tests {
    use super::super::metrics::{METRICS, Of};
    use super::*;
    use crate::culling::Culling;
    use crate::path::{self, LensDefaults};
    use crate::scene;

    #[test]
    fn each_bound_does_its_work_on_every_query_and_has_a_metric() {
        let scene = scene::load("uniform:n=300", &Default::default()).unwrap();
        let path = path::load("orbit:frames=6", &scene, &LensDefaults::default()).unwrap();
        let workload = Workload::new(&scene, &path, &Culling::default()).unwrap();
        let visible: Vec<u64> = (0..6).map(|camera| 40 * camera).collect();
        for bound in BOUNDS {
            let is_ratio = |of: &Of| matches!(of, Of::Over(name) if *name == bound.name);
            assert!(METRICS.iter().any(|m| is_ratio(&m.of)), "{}", bound.name);
            let task = (bound.make)(&workload, Kernel::best(), &visible).unwrap();
            assert_eq!(task.expected.len(), visible.len());
            for (place, &expected) in task.expected.iter().enumerate() {
                let mut out = Vec::new();
                (task.ask)(place, &mut out);
                assert_eq!(out.len() as u64, expected, "{}", bound.name);
            }
        }
        let copied = memcpy(&workload, Kernel::best(), &visible).unwrap();
        assert_eq!(copied.expected, visible);
        // Queries at two positions do not copy the same ids.
        let ids = |place| {
            let mut out = Vec::new();
            (copied.ask)(place, &mut out);
            out
        };
        assert_ne!(ids(1).first(), ids(5).first());
    }

    /// Checks the result of the bound, which a measurement discards.
    #[test]
    fn the_read_bound_reads_the_bounds_of_every_item() {
        // Whole blocks only: lanes after the last item hold no item.
        let scene = scene::load("uniform:n=320", &Default::default()).unwrap();
        let bits = |b: &Aabb| [b.min, b.max].map(|corner| corner.to_array().map(f32::to_bits));
        let all = scene.items.iter().flat_map(bits).flatten();
        let wanted = all.fold(0, |all, bits| all ^ bits);
        assert_ne!(wanted, 0);
        let blocks = blocks_of(&scene.items);
        for kernel in Kernel::available() {
            assert_eq!(kernel.run(Read(&blocks)), wanted, "{}", kernel.name());
        }
        let inverted = [Aabb::EMPTY, scene.items[0]];
        assert_eq!(blocks_of(&inverted).len(), 1);
    }

    #[test]
    fn what_has_nothing_to_do_is_left_out() {
        let scene = scene::load("uniform:n=0", &Default::default()).unwrap();
        let path = path::load("orbit:frames=2", &scene, &LensDefaults::default()).unwrap();
        let workload = Workload::new(&scene, &path, &Culling::default()).unwrap();
        let is_left_out = |b: &Bound| (b.make)(&workload, Kernel::best(), &[0, 0]).is_none();
        assert!(BOUNDS.iter().all(is_left_out));
    }
}
