//! Structures of other crates behind this crate's traits, one file a crate, so
//! that they are asked the same questions and held to the same answers. What
//! they share lives here: the test of one box at a time that all of them get,
//! counting through their closures, refusals. docs/PEERS.md has the calls.
//!
//! A peer's own code was compiled for the portable instruction set, unless the
//! compiler inlines it into the kernel that calls it.

mod bevy_style;
mod bvh;
mod bvh_arena;
mod centres;
mod kiddo;
mod obvhs;
mod parry3d;
mod rstar;
mod uniform_grid;

use std::cell::RefCell;

use glam::Vec3;

use super::BuildError;
use crate::geometry::{Aabb, PlaneRows};
use crate::query::{ItemId, NoRecorder, Recorder, Region, View};

pub use bevy_style::PeerBevyStyle;
pub use bvh::{PeerBvh, PeerBvhFlat};
pub use bvh_arena::PeerBvhArena;
pub use kiddo::PeerKiddo;
pub use obvhs::{PeerObvhs, PeerObvhsAabb, PeerObvhsTuned};
pub use parry3d::{PeerParry3d, PeerParry3dAccept, PeerParry3dPloc};
pub use rstar::{PeerRstar, PeerRstarAccept};
pub use uniform_grid::PeerUniformGrid;

/// A peer has nothing to choose: its rows are its variants.
#[derive(Clone, Copy, Default, Debug, serde::Serialize, serde::Deserialize)]
#[serde(deny_unknown_fields)]
pub struct PeerParams {}

/// A question, asked of one box at a time. Boxes are finite and not empty.
pub(super) trait BoxTest {
    /// Whether `admits` is `!rejects`.
    const NODES_AS_ITEMS: bool;
    /// No item within this box belongs to the answer.
    fn rejects(&self, node: &Aabb) -> bool;
    /// Every item within this box belongs to the answer.
    fn accepts(&self, node: &Aabb) -> bool;
    /// This item belongs to the answer.
    fn admits(&self, item: &Aabb) -> bool;
    /// Where the centre of an item of the answer can be, if no item is larger
    /// than `half` either way from its centre and all lie in `scene`.
    fn centres(&self, half: Vec3, scene: &Aabb) -> Aabb;
    /// How many planes a test looks at.
    fn planes(&self) -> u32 {
        0
    }
}

/// A view with THE plane test in f32 and at most eight planes, all of them at
/// once. Nodes and items are tested alike.
struct AtOnce(PlaneRows);

impl BoxTest for AtOnce {
    const NODES_AS_ITEMS: bool = true;

    #[inline(always)]
    fn rejects(&self, node: &Aabb) -> bool {
        self.0.exclude(node)
    }
    #[inline(always)]
    fn accepts(&self, node: &Aabb) -> bool {
        self.0.contain(node)
    }
    #[inline(always)]
    fn admits(&self, item: &Aabb) -> bool {
        !self.0.exclude(item)
    }
    fn centres(&self, half: Vec3, scene: &Aabb) -> Aabb {
        centres::of_planes(&self.0, half, scene)
    }
    #[inline(always)]
    fn planes(&self) -> u32 {
        self.0.count()
    }
}

/// Any other view, plane by plane: right, and not meant to be fast. Behind a
/// pointer, so that a peer's code is compiled for it once and not once a view.
struct PlaneByPlane<'a>(&'a dyn Planes);

/// A view without its type.
trait Planes {
    fn exclude(&self, node: &Aabb) -> bool;
    fn contain(&self, node: &Aabb) -> bool;
    fn keep(&self, item: &Aabb) -> bool;
    fn count(&self) -> u32;
}

impl<V: View> Planes for V {
    fn exclude(&self, node: &Aabb) -> bool {
        let mut mask = self.mask();
        while mask != 0 {
            if self.excludes(mask.trailing_zeros(), node) {
                return true;
            }
            mask &= mask - 1;
        }
        false
    }
    fn contain(&self, node: &Aabb) -> bool {
        let mut mask = self.mask();
        while mask != 0 {
            if !self.contains(mask.trailing_zeros(), node) {
                return false;
            }
            mask &= mask - 1;
        }
        true
    }
    fn keep(&self, item: &Aabb) -> bool {
        self.admits(item, self.mask(), &mut NoRecorder)
    }
    fn count(&self) -> u32 {
        self.mask().count_ones()
    }
}

impl BoxTest for PlaneByPlane<'_> {
    const NODES_AS_ITEMS: bool = false;

    fn rejects(&self, node: &Aabb) -> bool {
        self.0.exclude(node)
    }
    fn accepts(&self, node: &Aabb) -> bool {
        self.0.contain(node)
    }
    fn admits(&self, item: &Aabb) -> bool {
        self.0.keep(item)
    }
    fn centres(&self, _: Vec3, scene: &Aabb) -> Aabb {
        *scene
    }
    fn planes(&self) -> u32 {
        self.0.count()
    }
}

/// Region search: the boxes that hold a point.
struct Holding(Vec3);

impl BoxTest for Holding {
    const NODES_AS_ITEMS: bool = true;

    #[inline(always)]
    fn rejects(&self, node: &Aabb) -> bool {
        !node.contains_point(self.0)
    }
    #[inline(always)]
    fn accepts(&self, _: &Aabb) -> bool {
        false
    }
    #[inline(always)]
    fn admits(&self, item: &Aabb) -> bool {
        item.contains_point(self.0)
    }
    fn centres(&self, half: Vec3, scene: &Aabb) -> Aabb {
        centres::of_point(self.0, half, scene)
    }
}

/// A recorder that several closures of a peer's call can reach. The counts of
/// a recorder without a state are dropped, and nothing is borrowed.
struct Tally<'a, R>(RefCell<&'a mut R>);

impl<'a, R: Recorder> Tally<'a, R> {
    #[inline(always)]
    fn new(recorder: &'a mut R) -> Self {
        Tally(RefCell::new(recorder))
    }

    #[inline(always)]
    fn count(&self, note: impl FnOnce(&mut R)) {
        if size_of::<R>() != 0 {
            note(&mut self.0.borrow_mut());
        }
    }

    #[inline(always)]
    fn node(&self, test: &impl BoxTest) {
        self.count(|recorder| {
            recorder.node_tested();
            recorder.planes_tested(test.planes());
        });
    }

    #[inline(always)]
    fn item(&self, test: &impl BoxTest) {
        self.count(|recorder| {
            recorder.items_tested(1);
            recorder.planes_tested(test.planes());
        });
    }
}

/// An item as a peer stores it: exact bounds and its id. 28 bytes.
#[derive(Clone, Copy, Debug)]
struct Item {
    bounds: Aabb,
    id: ItemId,
}

/// The items that a structure has to hold.
///
/// # Errors
/// As [`super::indexable`].
fn indexable(items: &[Aabb]) -> Result<Vec<Item>, BuildError> {
    let ids = super::indexable(items)?;
    let item = |id: ItemId| Item {
        bounds: items[id as usize],
        id,
    };
    Ok(ids.into_iter().map(item).collect())
}

/// Half the size of the largest item, axis by axis.
fn half_of_largest(items: &[Item]) -> Vec3 {
    let halves = items.iter().map(|item| item.bounds.extent() * 0.5);
    halves.fold(Vec3::ZERO, Vec3::max)
}

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

/// [`crate::index::FrustumQuery`] of a peer with a method `search` (a
/// [`BoxTest`], a sink, a recorder).
macro_rules! seen_box_by_box {
    ($peer:ty) => {
        impl $crate::index::FrustumQuery for $peer {
            #[inline(always)]
            fn visible<
                V: $crate::query::View,
                S: $crate::query::Sink,
                R: $crate::query::Recorder,
            >(
                &self,
                view: &V,
                sink: &mut S,
                recorder: &mut R,
            ) -> std::ops::ControlFlow<()> {
                match view.rows() {
                    Some(rows) => self.search(&super::AtOnce(rows), sink, recorder),
                    None => self.search(&super::PlaneByPlane(view), sink, recorder),
                }
            }
        }
    };
}
use seen_box_by_box;

/// Region search of such a peer.
macro_rules! located_box_by_box {
    () => {
        #[inline(always)]
        fn locate<S: $crate::query::Sink, R: $crate::query::Recorder>(
            &self,
            p: glam::Vec3,
            sink: &mut S,
            recorder: &mut R,
        ) -> std::ops::ControlFlow<()> {
            self.search(&super::Holding(p), sink, recorder)
        }
    };
}
use located_box_by_box;

/// A peer that is one way to ask the file's own `Tree` (`build`, `memory`): name,
/// summary, crate, the last argument of `build`, the method that searches.
macro_rules! peer_of_tree {
    ($(#[$doc:meta])* $peer:ident, $name:literal, $summary:literal, $crate_name:literal, $how:expr, $search:ident) => {
        $(#[$doc])*
        pub struct $peer(Tree);

        impl $peer {
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

            fn build(
                items: &[$crate::geometry::Aabb],
                _: Option<&$crate::geometry::PlaneTree>,
                _: &super::PeerParams,
            ) -> Result<Self, $crate::index::BuildError> {
                Tree::build(Self::INFO.name, items, $how).map($peer)
            }

            fn memory(&self) -> $crate::index::MemoryUsage {
                self.0.memory()
            }

            super::located_box_by_box!();
        }

        super::seen_box_by_box!($peer);
    };
}
use peer_of_tree;
