//! Structures of other crates behind this crate's traits, one file a crate, so
//! that they are asked the same questions and held to the same answers. They get
//! their test one box at a time (`box_by_box`); what is refused to all of them
//! lives here. docs/PEERS.md has the calls.
//!
//! A peer's own code was compiled for the portable instruction set, unless the
//! compiler inlines it into the kernel that calls it.

mod bevy_style;
mod bvh;
mod bvh_arena;
mod kiddo;
mod obvhs;
mod parry3d;
mod rstar;

use super::BuildError;
use super::box_by_box::{self, BoxByBox, BoxTest, Item, Tally, half_of_largest, indexable};

pub use bevy_style::PeerBevyStyle;
pub use bvh::{PeerBvh, PeerBvhFlat};
pub use bvh_arena::PeerBvhArena;
pub use kiddo::PeerKiddo;
pub use obvhs::{PeerObvhs, PeerObvhsAabb, PeerObvhsTuned};
pub use parry3d::{PeerParry3d, PeerParry3dAccept, PeerParry3dPloc};
pub use rstar::{PeerRstar, PeerRstarAccept};

/// A peer has nothing to choose: its rows are its variants.
#[derive(Clone, Copy, Default, Debug, serde::Serialize, serde::Deserialize)]
#[serde(deny_unknown_fields)]
pub struct PeerParams {}

/// Most items with the very same bounds that a builder gets which needs
/// quadratic time for them.
const MOST_ALIKE: usize = 50_000;

/// Refuses more than [`MOST_ALIKE`] items with the same bounds. O(n log n) if
/// there are that many items at all.
fn refuse_stacks(structure: &'static str, items: &[Item]) -> Result<(), BuildError> {
    if items.len() <= MOST_ALIKE {
        return Ok(());
    }
    let key = |item: &Item| {
        let b = item.bounds;
        [b.min, b.max].map(|corner| corner.to_array().map(f32::to_bits))
    };
    let mut keys: Vec<_> = items.iter().map(key).collect();
    keys.sort_unstable();
    let alike = keys.chunk_by(|a, b| a == b).map(<[_]>::len).max();
    match alike {
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

/// A peer that is one way to ask the file's own `Tree` (`build`, `memory`): name,
/// summary, crate, the last argument of `build`, the method that searches.
macro_rules! peer_of_tree {
    ($(#[$doc:meta])* $peer:ident, $name:literal, $summary:literal, $crate_name:literal, $how:expr, $search:ident) => {
        $(#[$doc])*
        pub struct $peer(Tree);

        impl super::BoxByBox for $peer {
            #[inline(always)]
            fn search<T: super::BoxTest, S: $crate::query::Sink, R: $crate::query::Recorder>(
                &self,
                test: &T,
                sink: &mut S,
                recorder: &mut R,
            ) -> std::ops::ControlFlow<()> {
                self.0.$search(test, sink, recorder)
            }
        }

        impl $crate::index::RegionIndex for $peer {
            const INFO: $crate::index::Info = $crate::index::Info::new(
                $name,
                $summary,
                $crate::index::Kind::Tree,
                $crate::index::Origin::Crate($crate_name),
            );
            type Params = super::PeerParams;

            fn build(input: &$crate::index::Input<'_>, _: &super::PeerParams) -> Result<Self, $crate::index::BuildError> {
                let items = input.items;
                Tree::build(Self::INFO.name, items, $how).map($peer)
            }

            fn memory(&self) -> $crate::index::MemoryUsage {
                self.0.memory()
            }

            #[inline(always)]
            fn query<Q: $crate::query::QueryVolume, C: $crate::query::Context>(
                &self,
                volume: &Q,
                cx: &mut C,
            ) -> std::ops::ControlFlow<()> {
                $crate::index::box_by_box::query(self, volume, cx)
            }
        }
    };
}
use peer_of_tree;
