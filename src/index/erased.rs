//! [`DynIndex`], the object type of all structures, and its update policies.
//!
//! Dispatch happens once per query, never per node: behind each method is a traversal compiled for
//! that structure, volume, recorder and instruction set.

use std::fmt;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::str::FromStr;

use glam::Vec3;

use super::{MemoryUsage, Query, RegionIndex, TreeCell};
use crate::geometry::{Aabb, ConvexVolume};
use crate::kernel::{Isa, Kernel, Plain, Work};
use crate::query::{
    AnyVolume, Dispatched, ItemId, Located, NoRecorder, QueryContext, QueryCost, each_volume,
};
use crate::spec::SpecError;

/// Runs a closure; returns the message of a panic.
///
/// State that the closure changed before the panic is kept and must not be relied upon.
pub fn caught<T>(work: impl FnOnce() -> T) -> Result<T, String> {
    catch_unwind(AssertUnwindSafe(work)).map_err(|panic| {
        let text = panic.downcast_ref::<String>().map(String::as_str);
        let text = text.or_else(|| panic.downcast_ref::<&str>().copied());
        text.unwrap_or("no message").to_owned()
    })
}

/// Work of a frame after items have moved.
#[derive(Clone, Copy, PartialEq, Default, Debug)]
pub enum UpdatePolicy {
    /// A refit; a new build only where the structure cannot refit.
    #[default]
    Refit,
    /// A new build in every frame.
    Rebuild,
    /// A new build in every n-th frame, refits in the others.
    Every(u32),
}

impl fmt::Display for UpdatePolicy {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            UpdatePolicy::Refit => f.write_str("refit"),
            UpdatePolicy::Rebuild => f.write_str("rebuild"),
            UpdatePolicy::Every(frames) => write!(f, "every={frames}"),
        }
    }
}

impl FromStr for UpdatePolicy {
    type Err = SpecError;

    fn from_str(text: &str) -> Result<Self, SpecError> {
        let every = text
            .strip_prefix("every=")
            .and_then(|n| n.parse::<u32>().ok());
        match (text, every) {
            ("refit", _) => Ok(UpdatePolicy::Refit),
            ("rebuild", _) => Ok(UpdatePolicy::Rebuild),
            (_, Some(frames @ 2..=1_000_000)) => Ok(UpdatePolicy::Every(frames)),
            _ => Err(SpecError::new(format_args!(
                "--update '{text}'; expected refit, rebuild or every=N (frames, 2 to 1,000,000)"
            ))),
        }
    }
}

defaults! {
    /// Kernel of queries and number of threads of builds; answers depend on neither.
    #[derive(Clone, Copy, PartialEq, Eq, Debug)]
    pub struct Execution {
        /// Instruction set of queries.
        pub kernel: Kernel = Kernel::best(),
        /// Threads of builds, at least 1.
        pub threads: usize = 1,
    }
}

/// A built structure of any kind. Queries append ids to `out`.
pub trait DynIndex: Send + Sync {
    /// See [`RegionIndex::memory`].
    fn memory(&self) -> MemoryUsage;
    /// See [`RegionIndex::query`]. Nothing is counted.
    fn query(&self, volume: AnyVolume<'_>, out: &mut Vec<ItemId>);
    /// The same query; adds its cost to `cost`.
    ///
    /// Runs on the portable instruction set: cost and answer do not depend on it. All volumes of
    /// planes share one compiled traversal.
    fn query_counted(&self, volume: AnyVolume<'_>, out: &mut Vec<ItemId>, cost: &mut QueryCost);
    /// See [`RegionIndex::query_many`]; clears `out` first.
    fn query_many(&self, points: &[Vec3], out: &mut Located);
    /// See [`RegionIndex::cells`].
    fn cells(&self) -> Vec<TreeCell<'_>> {
        Vec::new()
    }
    /// See [`RegionIndex::chose`].
    fn chose(&self) -> Option<String> {
        None
    }
    /// See [`RegionIndex::refit`].
    fn refit(&mut self, items: &[Aabb], moved: &[ItemId]) -> bool;

    /// [`DynIndex::query`] for the items that a frustum of f32 planes sees.
    fn visible(&self, volume: &ConvexVolume, out: &mut Vec<ItemId>) {
        self.query(volume.into(), out);
    }
    /// [`DynIndex::query`] for the items whose closed box holds a point.
    fn locate(&self, p: Vec3, out: &mut Vec<ItemId>) {
        self.query(p.into(), out);
    }
}

/// A structure with the kernel of its queries.
#[derive(Clone, Debug)]
pub struct WithKernel<T> {
    /// The structure.
    pub index: T,
    /// The kernel.
    pub kernel: Kernel,
}

// Sinks that collect never end a query.
impl<T: RegionIndex> DynIndex for WithKernel<T> {
    fn memory(&self) -> MemoryUsage {
        self.index.memory()
    }

    fn query(&self, volume: AnyVolume<'_>, out: &mut Vec<ItemId>) {
        let (index, recorder) = (&self.index, &mut NoRecorder);
        let _ = each_volume!(volume, volume => {
            self.kernel.run(Query { index, volume, sink: out, recorder })
        });
    }

    fn query_counted(&self, volume: AnyVolume<'_>, out: &mut Vec<ItemId>, cost: &mut QueryCost) {
        let mut context = QueryContext::new(Plain, out, cost);
        let _ = match volume {
            AnyVolume::Point(p) => self.index.query(&p, &mut context),
            planes => self.index.query(&Dispatched(planes), &mut context),
        };
    }

    fn query_many(&self, points: &[Vec3], out: &mut Located) {
        out.clear();
        let index = &self.index;
        self.kernel.run(QueryMany { index, points, out });
    }

    fn cells(&self) -> Vec<TreeCell<'_>> {
        self.index.cells()
    }

    fn chose(&self) -> Option<String> {
        self.index.chose()
    }

    fn refit(&mut self, items: &[Aabb], moved: &[ItemId]) -> bool {
        self.index.refit(items, moved)
    }
}

/// Region search for many points, for a [`Kernel`] to run.
pub(crate) struct QueryMany<'a, T> {
    pub index: &'a T,
    pub points: &'a [Vec3],
    pub out: &'a mut Located,
}

impl<T: RegionIndex> Work for QueryMany<'_, T> {
    type Output = ();

    #[inline(always)]
    fn run<I: Isa>(self, isa: I) {
        self.index.query_many(isa, self.points, self.out);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::{ConvexVolumeF64, Plane, RelativeVolume, Spheres};
    use crate::index::{FrustumQuery, Input, Linear, OctreeTextbook, Wide};

    /// Answer and cost of the structure compiled for the volume, and dispatched.
    fn both<T: RegionIndex>(index: T, volume: AnyVolume<'_>) -> [(Vec<ItemId>, QueryCost); 2] {
        let own = each_volume!(volume, v => index.counted(v));
        let mut counted = <(Vec<ItemId>, QueryCost)>::default();
        let kernel = Kernel::best();
        WithKernel { index, kernel }.query_counted(volume, &mut counted.0, &mut counted.1);
        [own, counted]
    }

    #[test]
    fn what_engines_store_can_be_shown_in_a_line() {
        #[derive(Debug)]
        struct Engine {
            _tree: crate::index::Bvh,
            _textbook: OctreeTextbook,
            _any: Box<dyn DynIndex>,
            _volume: ConvexVolume,
        }
        let items = vec![Aabb::new(Vec3::ZERO, Vec3::ONE); 1000];
        let input = Input::new(&items);
        let (kernel, index) = (
            Kernel::best(),
            Wide::build(&input, &Default::default()).unwrap(),
        );
        let engine = Engine {
            _tree: RegionIndex::build(&input, &Default::default()).unwrap(),
            _textbook: RegionIndex::build(&input, &Default::default()).unwrap(),
            _any: Box::new(WithKernel { index, kernel }),
            _volume: ConvexVolume::of_box(&items[0]),
        };
        let shown = format!("{engine:?}");
        assert!(
            shown.contains("Tree") && shown.contains("node_bytes"),
            "{shown}"
        );
        let index = Box::new(engine._any);
        assert!(format!("{index:?}").len() < 200);
    }

    #[test]
    fn what_is_counted_is_the_cost_of_the_volume_itself() {
        let corner = |i: u16| Vec3::new(f32::from(i % 40), f32::from(i / 40), f32::from(i % 7));
        let items: Vec<Aabb> = (0..2000)
            .map(|i| Aabb::around(corner(i) * 1.7, Vec3::splat(0.3)))
            .collect();
        let input = Input::new(&items);
        let normal = Vec3::new(0.6, -0.5, 0.3);
        let planes = [Plane::new(normal, -9.0), Plane::new(-normal, 14.0)];
        let volume = ConvexVolume::from_planes(&planes).unwrap();
        let (spheres, wide) = (Spheres::new(&volume), ConvexVolumeF64::from(&volume));
        let relative = RelativeVolume::new(Vec3::splat(3.0), volume.clone()).unwrap();
        let volumes: [AnyVolume; 5] = [
            (&volume).into(),
            (&spheres).into(),
            (&wide).into(),
            (&relative).into(),
            items[77].centre().into(),
        ];
        fn check<T: RegionIndex>(input: &Input<'_>, volume: AnyVolume<'_>) {
            let index = T::build(input, &Default::default()).unwrap();
            let [own, counted] = both(index, volume);
            assert!(!own.0.is_empty() && own.0.len() < input.items.len());
            assert_eq!(own, counted, "{} {volume:?}", T::INFO.name);
        }
        for volume in volumes {
            check::<Wide>(&input, volume);
            check::<Linear>(&input, volume);
            check::<OctreeTextbook>(&input, volume);
        }
    }
}
