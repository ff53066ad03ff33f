//! Structures of other crates behind this crate's traits, one file a crate, so
//! that they are asked the same questions and held to the same answers. They get
//! their test one box at a time (`box_by_box`); what is refused to all of them
//! lives here. docs/PEERS.md has the calls.
//!
//! A peer's own code was compiled for the portable instruction set, unless the
//! compiler inlines it into the kernel that calls it.

mod bevy_style;
mod bvh;
mod obvhs;
mod parry3d;
mod rstar;

use super::box_by_box::{BoxByBox, BoxTest, Tally};
use super::partition::Record;
use super::{BuildError, ploc};

pub use bevy_style::PeerBevyStyle;
pub use bvh::PeerBvh;
pub use obvhs::PeerObvhs;
pub use parry3d::PeerParry3d;
pub use rstar::PeerRstar;

/// Refuses more items with the same bounds than a builder gets which needs
/// quadratic time for them.
fn refuse_stacks(structure: &'static str, items: &[Record]) -> Result<(), BuildError> {
    let most = ploc::MOST_ALIKE;
    match ploc::too_many_alike(items.iter().map(|item| &item.bounds)) {
        None => Ok(()),
        Some(alike) => Err(BuildError::Refused {
            structure,
            reason: format!(
                "{alike} items have the same bounds, and its builder needs quadratic time for \
                 such; expected at most {most}"
            ),
        }),
    }
}

/// A peer that is one way to ask the file's own tree (`build`, `memory`): name,
/// summary, crate, type of the tree, the last argument of `build`, the method that
/// searches.
macro_rules! peer_of_tree {
    ($(#[$doc:meta])* $peer:ident, $name:literal, $summary:literal, $crate_name:literal, $Tree:ty, $how:expr, $search:ident) => {
        $(#[$doc])*
        pub struct $peer($Tree);

        impl super::BoxByBox for $peer {
            const ABOUT: $crate::index::Info = $crate::index::Info::new(
                $name,
                $summary,
                $crate::index::Kind::Tree,
                $crate::index::Origin::Crate($crate_name),
            );

            fn of(items: Vec<super::Record>) -> Result<Self, super::BuildError> {
                <$Tree>::build(Self::ABOUT.name, items, $how).map($peer)
            }

            fn used(&self) -> $crate::index::MemoryUsage {
                self.0.memory()
            }

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
    };
}
use peer_of_tree;
