//! One object type for all structures. Dispatch happens once per query, never
//! per node: behind each method stands a traversal compiled for that structure,
//! view, recorder and instruction set.

use std::ops::Range;

use glam::Vec3;

use super::{By, FrustumQuery, MemoryUsage, RegionIndex};
use crate::geometry::{Aabb, ConvexVolume};
use crate::kernel::{BASELINE, Isa, Kernel, Work};
use crate::query::{AnyView, ItemId, Located, ManySink, NoRecorder, QueryCost, Ranges, View};

/// A built structure of any kind. Answers are appended to `out`.
pub trait DynIndex: Send + Sync {
    fn memory(&self) -> MemoryUsage;
    /// What a view of any kind sees. The timed path: nothing is counted.
    fn see(&self, view: AnyView<'_>, out: &mut Vec<ItemId>);
    /// The same query with its cost added up, by the portable instruction set
    /// whatever the kernel is: cost and answer are the same by all of them, and
    /// what is timed is to be asked for its answer itself.
    fn see_counted(&self, view: AnyView<'_>, out: &mut Vec<ItemId>, cost: &mut QueryCost);
    /// What a convex volume sees: [`DynIndex::see`] with the usual view.
    fn visible(&self, volume: &ConvexVolume, out: &mut Vec<ItemId>) {
        self.see(volume.into(), out);
    }
    /// The same query with its cost added up.
    fn visible_counted(&self, volume: &ConvexVolume, out: &mut Vec<ItemId>, cost: &mut QueryCost) {
        self.see_counted(volume.into(), out, cost);
    }
    /// The timed path: nothing is counted.
    fn locate(&self, p: Vec3, out: &mut Vec<ItemId>);
    /// The same search with its cost added up, as [`DynIndex::see_counted`] does
    /// it.
    fn locate_counted(&self, p: Vec3, out: &mut Vec<ItemId>, cost: &mut QueryCost);
    /// Searches for many points at once; `out` is cleared first. The timed
    /// path.
    fn locate_many(&self, points: &[Vec3], out: &mut Located) {
        out.clear();
        let mut ids = Vec::new();
        for (&p, point) in points.iter().zip(0..) {
            ids.clear();
            self.locate(p, &mut ids);
            // The collector never breaks off.
            let _ = out.accept(point, &ids);
        }
    }
    /// See [`RegionIndex::refit`].
    fn refit(&mut self, items: &[Aabb], moved: &[ItemId]) -> bool;
}

/// [`DynIndex`] for a structure and the kernel that it is asked by.
macro_rules! asked {
    ($this:ident, $index:expr, $kernel:expr) => {
        fn memory(&$this) -> MemoryUsage {
            RegionIndex::memory(&$index)
        }

        fn see(&$this, view: AnyView<'_>, out: &mut Vec<ItemId>) {
            see($kernel, &$index, view, out);
        }

        fn see_counted(&$this, view: AnyView<'_>, out: &mut Vec<ItemId>, cost: &mut QueryCost) {
            see_counted(&$index, view, out, cost);
        }

        fn locate(&$this, p: Vec3, out: &mut Vec<ItemId>) {
            locate($kernel, &$index, p, out);
        }

        fn locate_counted(&$this, p: Vec3, out: &mut Vec<ItemId>, cost: &mut QueryCost) {
            // A Vec never breaks off.
            let _ = $index.locate_by(BASELINE, p, out, cost);
        }

        fn locate_many(&$this, points: &[Vec3], out: &mut Located) {
            locate_many($kernel, &$index, points, out);
        }

        fn refit(&mut $this, items: &[Aabb], moved: &[ItemId]) -> bool {
            RegionIndex::refit(&mut $index, items, moved)
        }
    };
}

/// A structure by itself is asked by the best kernel of this machine.
impl<T: FrustumQuery> DynIndex for T {
    asked!(self, *self, Kernel::best());
}

impl<T: FrustumQuery> DynIndex for By<T> {
    asked!(self, self.index, self.kernel);
}

/// A frustum query as a kernel does it.
struct See<'a, T, V> {
    index: &'a T,
    view: &'a V,
    out: &'a mut Vec<ItemId>,
}

impl<T: FrustumQuery, V: View> Work for See<'_, T, V> {
    type Output = ();

    #[inline(always)]
    fn run<I: Isa>(self, isa: I) {
        // A Vec never breaks off.
        let _ = self
            .index
            .visible_by(isa, self.view, self.out, &mut NoRecorder);
    }
}

/// A frustum query for ranges as a kernel does it.
struct SeeRanges<'a, T, V> {
    index: &'a T,
    view: &'a V,
    out: &'a mut Vec<Range<u32>>,
}

impl<T: FrustumQuery, V: View> Work for SeeRanges<'_, T, V> {
    type Output = ();

    #[inline(always)]
    fn run<I: Isa>(self, isa: I) {
        let mut sink = Ranges::onto(self.out);
        // This sink never breaks off.
        let _ = self
            .index
            .visible_by(isa, self.view, &mut sink, &mut NoRecorder);
    }
}

/// [`TreeOrder::visible_ranges_by`](super::TreeOrder::visible_ranges_by).
pub(super) fn see_ranges<T: FrustumQuery, V: View>(
    kernel: Kernel,
    index: &T,
    view: &V,
    out: &mut Vec<Range<u32>>,
) {
    kernel.run(SeeRanges { index, view, out });
}

/// A region search as a kernel does it.
struct Locate<'a, T> {
    index: &'a T,
    p: Vec3,
    out: &'a mut Vec<ItemId>,
}

impl<T: RegionIndex> Work for Locate<'_, T> {
    type Output = ();

    #[inline(always)]
    fn run<I: Isa>(self, isa: I) {
        // A Vec never breaks off.
        let _ = self.index.locate_by(isa, self.p, self.out, &mut NoRecorder);
    }
}

/// A batch of region searches as a kernel does it.
struct LocateMany<'a, T> {
    index: &'a T,
    points: &'a [Vec3],
    out: &'a mut Located,
}

impl<T: RegionIndex> Work for LocateMany<'_, T> {
    type Output = ();

    #[inline(always)]
    fn run<I: Isa>(self, isa: I) {
        // The collector never breaks off.
        let _ = self.index.locate_many_by(isa, self.points, self.out);
    }
}

/// A traversal of its own for each view and kernel.
fn see<T: FrustumQuery>(kernel: Kernel, index: &T, view: AnyView<'_>, out: &mut Vec<ItemId>) {
    match view {
        AnyView::Volume(view) => kernel.run(See { index, view, out }),
        AnyView::Spheres(view) => kernel.run(See { index, view, out }),
        AnyView::Wide(view) => kernel.run(See { index, view, out }),
        AnyView::Relative(view) => kernel.run(See { index, view, out }),
    }
}

/// A traversal of its own for each view.
fn see_counted<T: FrustumQuery>(
    index: &T,
    view: AnyView<'_>,
    out: &mut Vec<ItemId>,
    cost: &mut QueryCost,
) {
    // A Vec never breaks off.
    let _ = match view {
        AnyView::Volume(view) => index.visible_by(BASELINE, view, out, cost),
        AnyView::Spheres(view) => index.visible_by(BASELINE, view, out, cost),
        AnyView::Wide(view) => index.visible_by(BASELINE, view, out, cost),
        AnyView::Relative(view) => index.visible_by(BASELINE, view, out, cost),
    };
}

pub(super) fn locate<T: RegionIndex>(kernel: Kernel, index: &T, p: Vec3, out: &mut Vec<ItemId>) {
    kernel.run(Locate { index, p, out });
}

pub(super) fn locate_many<T: RegionIndex>(
    kernel: Kernel,
    index: &T,
    points: &[Vec3],
    out: &mut Located,
) {
    out.clear();
    kernel.run(LocateMany { index, points, out });
}
