//! The contract of a structure: what it is built over, what it tells about
//! itself, and the one query that it answers. What users call besides follows
//! from that query and is provided.

use std::ops::{ControlFlow, Range};

use glam::Vec3;
use serde::de::DeserializeOwned;
use serde::{Deserialize, Serialize};

use super::Info;
use crate::geometry::{Aabb, PlaneTree};
use crate::kernel::{Isa, Kernel, Work};
use crate::query::{
    Context, ItemId, ManySink, NoRecorder, QueryContext, QueryVolume, Ranges, Recorder, Sink,
};
use crate::threads::Pool;

/// Why an index could not be built.
#[derive(Clone, PartialEq, Debug, thiserror::Error)]
#[non_exhaustive]
pub enum BuildError {
    /// A bound of an item is NaN or infinite.
    #[error("item {item} has the bounds {bounds:?}; expected finite numbers")]
    NonFiniteItem {
        /// Index of the item.
        item: usize,
        /// Its bounds.
        bounds: Aabb,
    },
    /// More items than ids.
    #[error("{count} items; expected at most {most}")]
    TooManyItems {
        /// Number of items.
        count: usize,
        /// Number of ids there are.
        most: usize,
    },
    /// The structure could, but not in reasonable time or memory.
    #[error("'{structure}' refuses these items: {reason}")]
    Refused {
        /// Name of the structure.
        structure: &'static str,
        /// What about the items, and what is expected.
        reason: String,
    },
    /// More memory than the process can have.
    #[error(
        "'{structure}' needs about {} MB for {count} items, more than this process can have; \
         expected fewer items",
        needed / 1_000_000
    )]
    OutOfMemory {
        /// Name of the structure.
        structure: &'static str,
        /// Number of items.
        count: usize,
        /// Bytes that are needed, the build included.
        needed: usize,
    },
    /// The structure's own code did.
    #[error("panicked: {message}")]
    Panicked {
        /// What the panic says.
        message: String,
    },
    /// A parameter is unknown, unreadable or out of range.
    #[error("parameters of '{structure}': {reason}")]
    Params {
        /// Name of the structure.
        structure: &'static str,
        /// The value and the rule.
        reason: String,
    },
}

/// Heap bytes of an index. Temporary memory of the build does not count.
#[derive(Clone, Copy, Default, PartialEq, Eq, Debug)]
pub struct MemoryUsage {
    /// Nodes, planes and links.
    pub node_bytes: usize,
    /// Copies of item bounds and the ids.
    pub item_bytes: usize,
}

impl MemoryUsage {
    /// Of nodes and items together.
    pub fn total(&self) -> usize {
        self.node_bytes + self.item_bytes
    }
}

/// What a structure is built over.
///
/// Items are numbered by their index in the slice. An empty box (min > max) is
/// an item that no query ever returns.
#[derive(Clone, Copy, Debug)]
#[non_exhaustive]
pub struct Input<'a> {
    /// The bounds of all items.
    pub items: &'a [Aabb],
    /// A partition that the scene itself brings, such as a map's own planes.
    pub own_tree: Option<&'a PlaneTree>,
    /// The threads that the build may use; `None` is this one alone.
    pub pool: Option<&'a Pool>,
}

impl<'a> Input<'a> {
    /// Items without a partition of their own, built over on one thread.
    pub fn new(items: &'a [Aabb]) -> Input<'a> {
        Input {
            items,
            own_tree: None,
            pool: None,
        }
    }

    /// The same with the scene's own partition, if it has one.
    pub fn own_tree(self, own_tree: Option<&'a PlaneTree>) -> Input<'a> {
        Input { own_tree, ..self }
    }

    /// The same with the threads of a pool.
    pub fn pool(self, pool: &'a Pool) -> Input<'a> {
        Input {
            pool: Some(pool),
            ..self
        }
    }

    /// How many threads the build may use: 1 or more. A structure that reads it
    /// declares [`Capabilities::threaded_build`](super::Capabilities).
    pub fn threads(&self) -> usize {
        self.pool.map_or(1, Pool::threads)
    }
}

impl<'a, Items: AsRef<[Aabb]> + ?Sized> From<&'a Items> for Input<'a> {
    fn from(items: &'a Items) -> Self {
        Input::new(items.as_ref())
    }
}

/// Parameters of a structure that has nothing to choose.
#[derive(Clone, Copy, Default, Debug, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct NoParams {}

/// A structure built over item bounds.
pub trait RegionIndex: Sized + Send + Sync {
    /// Its name and what it declares of itself. The conformance suite checks
    /// what can be checked.
    const INFO: Info;
    /// Build parameters, `name:key=value` on the command line.
    type Params: Default + Serialize + DeserializeOwned;

    /// Builds the structure. Deterministic: the same items and parameters give
    /// the same structure, whatever the number of threads.
    ///
    /// # Errors
    /// An item with a NaN or infinite bound (named), more items than ids,
    /// parameters out of range.
    fn build(input: &Input<'_>, params: &Self::Params) -> Result<Self, BuildError>;

    /// Heap bytes.
    fn memory(&self) -> MemoryUsage;

    /// Hands every item that the volume sees to the sink of the context: exactly
    /// the set `{ i : volume.sees(items[i]) }`, bit for bit, each id once, in the
    /// structure's own order. `Break` if the sink ended the query.
    ///
    /// The volume is a frustum in any form, a point (region search: every item
    /// whose closed box holds it) or a box (every item that shares a point with
    /// it). Mark the function and what it calls `#[inline(always)]`:
    /// [`DynIndex`](super::DynIndex) compiles it for each [`Kernel`], and a call
    /// that stays a call runs portable code.
    fn query<Q: QueryVolume, C: Context>(&self, volume: &Q, context: &mut C) -> ControlFlow<()>;

    /// Region search for many points: for every point, in ascending order, what
    /// [`RegionIndex::query`] hands over, in the same order, in one slice.
    /// `Break` if the sink ended the batch.
    ///
    /// By default one point after the other; a structure that overlaps the waits
    /// of several descents overrides it.
    #[inline(always)]
    fn query_many<I: Isa, S: ManySink>(
        &self,
        isa: I,
        points: &[Vec3],
        sink: &mut S,
    ) -> ControlFlow<()> {
        let mut ids = Vec::new();
        for (p, point) in points.iter().zip(0..) {
            ids.clear();
            // A Vec never breaks off.
            let _ = self.query(p, &mut QueryContext::new(isa, &mut ids, &mut NoRecorder));
            sink.accept(point, &ids)?;
        }
        ControlFlow::Continue(())
    }

    /// Takes over the new bounds of `moved` items (`items` holds all bounds,
    /// the new ones included; they are finite) without building anew. False,
    /// with the structure unchanged, if it cannot; the caller then rebuilds.
    /// A structure that declares [`Capabilities::refits`](super::Capabilities)
    /// declines only where an item becomes or ceases to be empty; one that does
    /// not, always.
    fn refit(&mut self, _items: &[Aabb], _moved: &[ItemId]) -> bool {
        false
    }

    /// Item ids in the structure's own order, if its answers can be ranges of it
    /// (it hands them over by [`Sink::accept_places`]):
    /// [`Capabilities::ranges`](super::Capabilities).
    fn tree_order(&self) -> Option<&[ItemId]> {
        None
    }
}

/// What users call, provided for every structure: frustum culling and region
/// search by the best [`Kernel`] of this machine, nothing counted.
pub trait FrustumQuery: RegionIndex {
    /// Hands every item that a camera's volume sees to the sink. `Break` if the
    /// sink ended the query.
    fn visible<Q: QueryVolume, S: Sink>(&self, volume: &Q, sink: &mut S) -> ControlFlow<()> {
        Kernel::best().run(Query {
            index: self,
            volume,
            sink,
            recorder: &mut NoRecorder,
        })
    }

    /// [`FrustumQuery::visible`] as ranges of the order that is returned
    /// ([`RegionIndex::tree_order`]), appended to `ranges`; together they hold
    /// each visible item once. Adjoining ranges that follow each other are one.
    /// `None` from a structure without such an order.
    fn visible_ranges<Q: QueryVolume>(
        &self,
        volume: &Q,
        ranges: &mut Vec<Range<u32>>,
    ) -> Option<&[ItemId]> {
        let order = self.tree_order()?;
        // This sink never breaks off.
        let _ = self.visible(volume, &mut Ranges::onto(ranges));
        Some(order)
    }

    /// Region search: hands every item whose closed box holds `p` to the sink.
    /// `Break` if the sink ended the query.
    fn locate<S: Sink>(&self, p: Vec3, sink: &mut S) -> ControlFlow<()> {
        self.visible(&p, sink)
    }
}

impl<T: RegionIndex> FrustumQuery for T {}

/// A query as a [`Kernel`] of one's choice does it:
/// `kernel.run(Query { index, volume, sink, recorder })`.
pub struct Query<'a, T, Q, S, R> {
    /// The structure.
    pub index: &'a T,
    /// What is asked.
    pub volume: &'a Q,
    /// Where answers go.
    pub sink: &'a mut S,
    /// What is counted.
    pub recorder: &'a mut R,
}

impl<T: RegionIndex, Q: QueryVolume, S: Sink, R: Recorder> Work for Query<'_, T, Q, S, R> {
    type Output = ControlFlow<()>;

    #[inline(always)]
    fn run<I: Isa>(self, isa: I) -> ControlFlow<()> {
        let mut context = QueryContext::new(isa, self.sink, self.recorder);
        self.index.query(self.volume, &mut context)
    }
}

/// A parameter in its range, or the error that names both.
pub(crate) fn check_range(
    structure: &'static str,
    name: &str,
    value: f64,
    low: f64,
    high: f64,
) -> Result<(), BuildError> {
    if (low..=high).contains(&value) {
        return Ok(());
    }
    Err(BuildError::Params {
        structure,
        reason: format!("{name}={value}; expected {low} to {high}"),
    })
}
