//! The test of one box at a time, prepared once per query.
//!
//! For the uniform grid and the structures of other crates. Structures that test plane by plane
//! with masks use [`QueryVolume`] itself.

use std::ops::ControlFlow;

use glam::Vec3;
use serde::Serialize;
use serde::de::DeserializeOwned;

use super::items::Record;
use super::{BuildError, Info, Input, MemoryUsage, RegionIndex, centre_bounds};
use crate::geometry::{Aabb, PlaneRows};
use crate::query::{Bits, Context, ItemId, NoRecorder, QueryVolume, Recorder};

/// A query as a test of one box at a time. Boxes are finite and not empty.
pub trait BoxTest {
    /// True if `admits` is `!rejects`.
    #[inline(always)]
    fn nodes_as_items(&self) -> bool {
        true
    }
    /// No item within this box belongs to the answer.
    fn rejects(&self, node: &Aabb) -> bool;
    /// Every item within this box belongs to the answer.
    fn accepts(&self, node: &Aabb) -> bool;
    /// Both results; the second is unspecified for a rejected node.
    #[inline(always)]
    fn rejects_accepts(&self, node: &Aabb) -> (bool, bool) {
        let rejects = self.rejects(node);
        (rejects, !rejects && self.accepts(node))
    }
    /// This item belongs to the answer.
    fn admits(&self, item: &Aabb) -> bool;
    /// Bounds of the centres of answers.
    ///
    /// No item extends farther than `half` from its centre, and all lie in `scene`.
    fn centres(&self, half: Vec3, scene: &Aabb) -> Aabb;
    /// Number of planes per test.
    fn planes(&self) -> u32 {
        0
    }
}

/// THE plane test in f32 against at most eight planes at once.
///
/// Nodes and items are tested alike.
impl BoxTest for PlaneRows {
    #[inline(always)]
    fn rejects(&self, node: &Aabb) -> bool {
        self.exclude(node)
    }
    #[inline(always)]
    fn accepts(&self, node: &Aabb) -> bool {
        self.contain(node)
    }
    #[inline(always)]
    fn rejects_accepts(&self, node: &Aabb) -> (bool, bool) {
        self.exclude_contain(node)
    }
    #[inline(always)]
    fn admits(&self, item: &Aabb) -> bool {
        !self.exclude(item)
    }
    fn centres(&self, half: Vec3, scene: &Aabb) -> Aabb {
        centre_bounds::of_planes(self, half, scene)
    }
    #[inline(always)]
    fn planes(&self) -> u32 {
        self.count()
    }
}

/// Any other volume, plane by plane: correct, not fast.
///
/// Used as `dyn` [`BoxTest`], so that one compiled traversal serves all of them.
struct PlaneByPlane<'a, Q>(&'a Q);

impl<Q: QueryVolume> BoxTest for PlaneByPlane<'_, Q> {
    fn nodes_as_items(&self) -> bool {
        false
    }
    fn rejects(&self, node: &Aabb) -> bool {
        Bits(self.0.mask().into()).any(|plane| self.0.excludes(plane, node))
    }
    fn accepts(&self, node: &Aabb) -> bool {
        Bits(self.0.mask().into()).all(|plane| self.0.contains(plane, node))
    }
    fn admits(&self, item: &Aabb) -> bool {
        self.0.admits(item, self.0.mask(), &mut NoRecorder)
    }
    fn centres(&self, _: Vec3, scene: &Aabb) -> Aabb {
        *scene
    }
    fn planes(&self) -> u32 {
        Q::planes_open(self.0.mask())
    }
}

/// Region search: the boxes that hold a point.
impl BoxTest for Vec3 {
    #[inline(always)]
    fn rejects(&self, node: &Aabb) -> bool {
        !node.contains_point(*self)
    }
    #[inline(always)]
    fn accepts(&self, _: &Aabb) -> bool {
        false
    }
    #[inline(always)]
    fn admits(&self, item: &Aabb) -> bool {
        item.contains_point(*self)
    }
    fn centres(&self, half: Vec3, scene: &Aabb) -> Aabb {
        centre_bounds::of_point(*self, half, scene)
    }
}

/// A query in progress: its test, and the context for its answers and counts.
pub struct BoxQuery<'a, T: ?Sized, C> {
    pub test: &'a T,
    pub cx: &'a mut C,
}

impl<T: BoxTest + ?Sized, C: Context> BoxQuery<'_, T, C> {
    /// Counts tests of nodes.
    #[inline(always)]
    pub fn count_nodes(&mut self, count: u32) {
        // Only with counters on: the planes of a `dyn` test take a call.
        if size_of::<C::Recorder>() != 0 {
            self.cx.recorder().nodes_tested(count);
            let planes = count * self.test.planes();
            self.cx.recorder().planes_tested(planes);
        }
    }

    /// [`BoxTest::rejects`], counted.
    #[inline(always)]
    pub fn rejects(&mut self, node: &Aabb) -> bool {
        self.count_nodes(1);
        self.test.rejects(node)
    }

    /// [`BoxTest::rejects_accepts`], counted.
    #[inline(always)]
    pub fn rejects_accepts(&mut self, node: &Aabb) -> (bool, bool) {
        self.count_nodes(1);
        self.test.rejects_accepts(node)
    }

    /// [`BoxTest::admits`], counted.
    #[inline(always)]
    pub fn admits(&mut self, item: &Aabb) -> bool {
        if size_of::<C::Recorder>() != 0 {
            self.cx.recorder().items_tested(1);
            self.cx.recorder().planes_tested(self.test.planes());
        }
        self.test.admits(item)
    }

    /// Tests an item and passes it to the sink if it belongs to the answer.
    #[inline(always)]
    pub fn item(&mut self, item: &Aabb, id: &ItemId) -> ControlFlow<()> {
        if self.admits(item) {
            self.cx.accept(std::slice::from_ref(id))?;
        }
        ControlFlow::Continue(())
    }
}

/// A structure that is searched one box at a time.
pub trait BoxTested: Sized + Send + Sync {
    /// Its [`RegionIndex::INFO`].
    const ABOUT: Info;
    /// Its [`RegionIndex::Params`]: how it is updated.
    type Params: Default + Serialize + DeserializeOwned;

    /// Builds it over all items that are not empty.
    ///
    /// # Errors
    /// If it cannot hold the items.
    fn of(items: Vec<Record>, params: &Self::Params) -> Result<Self, BuildError>;

    /// Its [`RegionIndex::refit`]; `None` if a rebuild is needed.
    fn follow(&mut self, _items: &[Aabb], _moved: &[ItemId]) -> Option<()> {
        None
    }

    /// Its [`RegionIndex::memory`].
    fn used(&self) -> MemoryUsage;

    /// Passes every item that the test admits to the sink.
    fn search<T: BoxTest + ?Sized, C: Context>(&self, ask: &mut BoxQuery<T, C>) -> ControlFlow<()>;
}

impl<X: BoxTested> RegionIndex for X {
    const INFO: Info = X::ABOUT;
    type Params = X::Params;

    fn build(input: &Input<'_>, params: &X::Params) -> Result<Self, BuildError> {
        X::of(Record::all(input.items)?, params)
    }

    fn refit(&mut self, items: &[Aabb], moved: &[ItemId]) -> bool {
        self.follow(items, moved).is_some()
    }

    fn memory(&self) -> MemoryUsage {
        self.used()
    }

    #[inline(always)]
    fn query<Q: QueryVolume, C: Context>(&self, volume: &Q, cx: &mut C) -> ControlFlow<()> {
        if Q::IS_POINT {
            return match &volume.as_point() {
                Some(test) => self.search(&mut BoxQuery { test, cx }),
                None => ControlFlow::Continue(()),
            };
        }
        match &volume.rows() {
            Some(test) => self.search(&mut BoxQuery { test, cx }),
            None => {
                let test: &dyn BoxTest = &PlaneByPlane(volume);
                self.search(&mut BoxQuery { test, cx })
            }
        }
    }
}
