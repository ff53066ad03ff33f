//! The contract of a structure, [`RegionIndex`].
//!
//! Build, memory, one generic query. [`FrustumQuery`] provides the forms of the query that
//! callers use.

use std::ops::{ControlFlow, Range};

use glam::Vec3;
use serde::de::DeserializeOwned;
use serde::{Deserialize, Serialize};

use super::{Info, TreeCell};
use crate::geometry::{Aabb, PlaneTree};
use crate::kernel::{Isa, Kernel, Plain, Work};
use crate::query::{
    Context, ItemId, Located, NoRecorder, QueryContext, QueryCost, QueryVolume, Ranges, Recorder,
    Sink,
};
use crate::threads::Pool;

/// The failure of a build.
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
        /// Number of ids available.
        most: usize,
    },
    /// The build would take unreasonable time or memory.
    #[error("'{structure}' refuses these items: {reason}")]
    Refused {
        /// Name of the structure.
        structure: &'static str,
        /// The offending property of the items, and the expected one.
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
    /// The structure's own code panicked.
    #[error("panicked: {message}")]
    Panicked {
        /// Message of the panic.
        message: String,
    },
    /// A parameter is unknown, malformed or out of range.
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
    /// Sum of nodes and items.
    pub fn total(&self) -> usize {
        self.node_bytes.saturating_add(self.item_bytes)
    }
}

/// Input of a build: items, and optionally a partition and a thread pool.
///
/// Items are numbered by their index in the slice. An empty box of finite numbers (min > max),
/// such as [`REMOVED`](crate::motion::REMOVED), is an item that no query ever returns.
#[derive(Clone, Copy, Default, Debug)]
pub struct Input<'a> {
    /// Bounds of all items.
    pub items: &'a [Aabb],
    /// The scene's own partition, such as a map's planes.
    pub own_tree: Option<&'a PlaneTree>,
    /// The threads that the build may use; `None` for the current one.
    pub pool: Option<&'a Pool>,
    /// True if the items are [cubes about spheres](crate::geometry::sphere_cube).
    ///
    /// For structures that keep spheres beside the bounds. Answers do not depend on it.
    pub spheres: bool,
    /// True if items come and go, for structures that can keep a lane for each.
    pub come_and_go: bool,
}

impl<'a> Input<'a> {
    /// Items without a partition, for a build on one thread.
    pub fn new(items: &'a [Aabb]) -> Input<'a> {
        Input {
            items,
            ..Input::default()
        }
    }

    /// Declares the items cubes about spheres.
    pub fn spheres(self, spheres: bool) -> Input<'a> {
        Input { spheres, ..self }
    }

    /// Declares that absent items may appear in a refit.
    pub fn come_and_go(self, come_and_go: bool) -> Input<'a> {
        Input {
            come_and_go,
            ..self
        }
    }

    /// Sets the scene's own partition, if it has one.
    pub fn own_tree(self, own_tree: Option<&'a PlaneTree>) -> Input<'a> {
        Input { own_tree, ..self }
    }

    /// Sets the threads of a pool.
    pub fn pool(self, pool: &'a Pool) -> Input<'a> {
        Input {
            pool: Some(pool),
            ..self
        }
    }

    /// Number of threads that the build may use, at least 1.
    ///
    /// A structure that reads it declares `threaded_build` in its [`Info`].
    pub fn threads(&self) -> usize {
        self.pool.map_or(1, Pool::threads)
    }
}

impl<'a, Items: AsRef<[Aabb]> + ?Sized> From<&'a Items> for Input<'a> {
    fn from(items: &'a Items) -> Self {
        Input::new(items.as_ref())
    }
}

/// [`RegionIndex::Params`] of a structure without parameters.
#[derive(Clone, Copy, Default, Debug, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct NoParams {}

/// A structure built over item bounds.
pub trait RegionIndex: Sized + Send + Sync {
    /// Name and declaration; the conformance suite checks it as far as possible.
    const INFO: Info;
    /// Build parameters, `name:key=value` on the command line.
    ///
    /// Missing keys take the values of `Default`; unknown keys are refused. A field `threads` is
    /// the number of threads that share one query.
    type Params: Default + Serialize + DeserializeOwned;

    /// Builds the structure.
    ///
    /// Deterministic: the same items and parameters give the same structure for any number of
    /// threads.
    ///
    /// # Errors
    /// An item with a NaN or infinite bound (named), more items than ids, parameters out of range.
    fn build(input: &Input<'_>, params: &Self::Params) -> Result<Self, BuildError>;

    /// Heap bytes.
    fn memory(&self) -> MemoryUsage;

    /// Passes every item that the volume sees to the sink of the context.
    ///
    /// Exactly the set `{ i : volume.sees(items[i]) }`, bit for bit, each id once, in the
    /// structure's own order. `Break` if the sink ended the query.
    ///
    /// The volume is a frustum in any form, a point (region search: every item whose closed box
    /// holds it) or a box (every item that shares a point with it). Mark the function and its
    /// callees `#[inline(always)]`: [`DynIndex`](super::DynIndex) compiles it for each [`Kernel`],
    /// and a callee that is not inlined runs portable code.
    fn query<Q: QueryVolume, C: Context>(&self, volume: &Q, context: &mut C) -> ControlFlow<()>;

    /// Region search for many points: appends the ids of each point to `out`.
    ///
    /// Per point in the order of [`RegionIndex::query`]. The default searches point by point; a
    /// structure that interleaves several descents overrides it.
    #[inline(always)]
    fn query_many<I: Isa>(&self, isa: I, points: &[Vec3], out: &mut Located) {
        let mut ids = Vec::new();
        for p in points {
            ids.clear();
            // A Vec never ends the query.
            let _ = self.query(p, &mut QueryContext::new(isa, &mut ids, &mut NoRecorder));
            out.push(&ids);
        }
    }

    /// Takes over the new bounds of `moved` items without a rebuild.
    ///
    /// `items` holds the bounds of all items, the new ones included: finite, and as many as were
    /// built. Ids are below their number; others may panic, and
    /// [`StructureSpec::update`](super::StructureSpec::update) refuses them. `moved` may be empty,
    /// as before the first frame of a motion; it has any order and may name an item twice. Returns
    /// false, with the structure unchanged, if a rebuild is needed. A structure may return false if
    /// an item becomes or ceases to be empty; one that does not declare `refits` in its [`Info`]
    /// always does.
    fn refit(&mut self, _items: &[Aabb], _moved: &[ItemId]) -> bool {
        false
    }

    /// A phrase for the choice of an adaptive structure and the options it rejected.
    fn chose(&self) -> Option<String> {
        None
    }

    /// Cells of the structure in depth-first order, for `cullbench scene draw`.
    ///
    /// None from a structure without nested cells. A query with a volume of planes must
    /// test exactly the roots and the cells directly within those that straddle it.
    fn cells(&self) -> Vec<TreeCell<'_>> {
        Vec::new()
    }

    /// Item ids in the order that ranges passed to [`Sink::accept_range`] refer to.
    ///
    /// `None` from a structure without such an order, which does not declare
    /// `ranges` in its [`Info`].
    fn tree_order(&self) -> Option<&[ItemId]> {
        None
    }
}

/// Queries as callers write them, provided for every structure.
///
/// They use the best [`Kernel`] of this machine. A volume is a frustum in any form, a point
/// or a box.
///
/// ```
/// use cullbench::geometry::Aabb;
/// use cullbench::index::{Bvh, FrustumQuery, Input, RegionIndex};
/// use glam::Vec3;
///
/// let cube = |x: f32| Aabb::around(Vec3::X * x, Vec3::ONE);
/// let bvh = Bvh::build(&Input::new(&[cube(0.0), cube(9.0)]), &Default::default())?;
/// let region = Aabb::around(Vec3::ZERO, Vec3::splat(2.0));
/// assert_eq!(bvh.visible(&region), [0]);
/// bvh.each_visible(&region, |id| assert_eq!(id, 0));
/// let (ids, cost) = bvh.counted(&region);
/// assert!(ids == [0] && cost.comparisons() > 0);
/// assert_eq!(bvh.locate(Vec3::X * 9.5), [1]);
/// # Ok::<(), cullbench::index::BuildError>(())
/// ```
pub trait FrustumQuery: RegionIndex {
    /// Ids of the items that the volume sees, in the structure's own order.
    fn visible<Q: QueryVolume>(&self, volume: &Q) -> Vec<ItemId> {
        let mut ids = Vec::new();
        let _ = self.query_into(volume, &mut ids);
        ids
    }

    /// Calls `each` with the id of every item that the volume sees.
    fn each_visible<Q: QueryVolume>(&self, volume: &Q, mut each: impl FnMut(ItemId)) {
        let _ = self.query_into(volume, &mut |ids: &[ItemId]| {
            each_of(ids, &mut each);
            ControlFlow::Continue(())
        });
    }

    /// [`FrustumQuery::visible`] with the cost of the query, by the portable kernel.
    ///
    /// Ids and cost are the same with every kernel.
    fn counted<Q: QueryVolume>(&self, volume: &Q) -> (Vec<ItemId>, QueryCost) {
        let (mut ids, mut cost) = Default::default();
        let _ = self.query(volume, &mut QueryContext::new(Plain, &mut ids, &mut cost));
        (ids, cost)
    }

    /// Region search: ids of the items whose closed box holds `p`.
    fn locate(&self, p: Vec3) -> Vec<ItemId> {
        self.visible(&p)
    }

    /// Passes every item that the volume sees to the sink.
    ///
    /// `Break` if the sink ended the query.
    fn query_into<Q: QueryVolume, S: Sink>(&self, volume: &Q, sink: &mut S) -> ControlFlow<()> {
        Kernel::best().run(Query {
            index: self,
            volume,
            sink,
            recorder: &mut NoRecorder,
        })
    }

    /// [`FrustumQuery::visible`] as ranges of the returned order, appended to `ranges`.
    ///
    /// The order is [`RegionIndex::tree_order`]. Together the ranges hold each visible item once;
    /// consecutive adjoining ranges are merged. `None` from a structure without such an order.
    fn visible_ranges<Q: QueryVolume>(
        &self,
        volume: &Q,
        ranges: &mut Vec<Range<u32>>,
    ) -> Option<&[ItemId]> {
        let order = self.tree_order()?;
        let _ = self.query_into(volume, &mut Ranges::onto(ranges));
        Some(order)
    }
}

impl<T: RegionIndex> FrustumQuery for T {}

/// Calls a function with each id of a slice.
///
/// `for_each` would become a call per id in another codegen unit; so would a loop in code of a
/// larger instruction set.
#[inline(never)]
fn each_of(ids: &[ItemId], each: &mut impl FnMut(ItemId)) {
    for &id in ids {
        each(id);
    }
}

/// One query with its arguments, for a [`Kernel`] to run.
///
/// `kernel.run(Query { index, volume, sink, recorder })`
pub struct Query<'a, T, Q, S, R> {
    /// The structure.
    pub index: &'a T,
    /// The volume that sees items.
    pub volume: &'a Q,
    /// The destination of the answers.
    pub sink: &'a mut S,
    /// The counters.
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

/// Checks that a parameter is in its range; the error names both.
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
