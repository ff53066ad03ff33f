//! Cold queries: a sweep over the caches, and outputs that do not grow while
//! they are timed. The timed pass decides when to sweep.

use super::schedule::Protocol;
use super::task::TimedTask;
use crate::query::ItemId;

/// Room behind the answer that a structure may ask for while it writes it.
const SLACK: usize = 64;

/// Sweep and outputs of cold queries. One sweep serves one query of every task:
/// each has data of its own, which no other query brings back, and its own
/// output.
pub(super) struct Cold {
    pub(super) sweep: Sweep,
    pub(super) outs: Vec<Vec<ItemId>>,
}

impl Cold {
    /// The outputs have their final size: a query that runs once per sweep
    /// must not pay for their growth.
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

/// Something larger than the last cache, to be read between cold queries.
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
