//! Structures of other crates, one file per crate, checked like our own.
//!
//! Each gets its test one box at a time (`box_test`). docs/PEERS.md has the calls.
//!
//! A peer's own code was compiled for the portable instruction set, unless the
//! compiler inlines it into the kernel that calls it.

mod bevy_style;
mod bvh;
mod obvhs;
mod parry3d;
mod rstar;

use super::BuildError;
use super::items::Record;

pub use bevy_style::PeerBevyStyle;
pub use bvh::PeerBvh;
pub use obvhs::PeerObvhs;
pub use parry3d::PeerParry3d;
pub use rstar::PeerRstar;

/// Most items with the same bounds for a builder of quadratic time.
const MOST_ALIKE: usize = 50_000;

/// Refuses more than [`MOST_ALIKE`] items with the same bounds. O(n log n).
fn refuse_stacks(structure: &'static str, items: &[Record]) -> Result<(), BuildError> {
    if items.len() <= MOST_ALIKE {
        return Ok(());
    }
    let mut keys: Vec<_> = items.iter().map(|item| item.bounds.bits()).collect();
    keys.sort_unstable();
    match keys.chunk_by(|a, b| a == b).map(<[_]>::len).max() {
        Some(alike) if alike > MOST_ALIKE => Err(BuildError::Refused {
            structure,
            reason: format!(
                "{alike} items have the same bounds, and its builder needs quadratic time for \
                 such; expected at most {MOST_ALIKE}"
            ),
        }),
        _ => Ok(()),
    }
}
