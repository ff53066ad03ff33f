//! Cold queries: a sweep over the caches, and outputs that do not grow while timed.

use super::schedule::Protocol;
use super::task::TimedTask;
use crate::query::ItemId;

/// Number of ids of spare room in an output: structures write whole rows.
const SLACK: usize = 64;

/// Sweep and outputs of cold queries.
///
/// One sweep serves one query of every task: each task has its own data, which no other
/// query loads into the caches, and its own output.
pub(super) struct Cold {
    pub(super) sweep: Sweep,
    /// An output per task.
    pub(super) outs: Vec<Vec<ItemId>>,
}

impl Cold {
    /// Allocates the sweep, and outputs of their final size.
    ///
    /// A query that runs once per sweep must not pay for the growth of its output.
    pub(super) fn new(protocol: &Protocol, tasks: &[TimedTask]) -> Cold {
        let most = |c: &TimedTask| c.expected.iter().copied().max().unwrap_or(0) as usize;
        Cold {
            sweep: Sweep::new(protocol.cache_bytes),
            outs: tasks
                .iter()
                .map(|c| {
                    let mut out = vec![0; most(c) + SLACK];
                    out.clear();
                    out
                })
                .collect(),
        }
    }
}

/// Memory larger than the last cache, overwritten between cold queries.
pub(super) struct Sweep(Vec<u64>);

impl Sweep {
    fn new(bytes: usize) -> Self {
        Sweep(vec![1; bytes / size_of::<u64>()])
    }

    pub(super) fn over_caches(&mut self) {
        // Written, not only read: shared zero pages would stay in one line.
        for line in self.0.chunks_mut(8) {
            line[0] = line[0].wrapping_add(1);
        }
        std::hint::black_box(&self.0);
    }
}
