//! One object type for all structures. Dispatch happens once per query, never
//! per node: behind each method stands a traversal compiled for that structure,
//! volume, recorder and instruction set.

use glam::Vec3;

use super::{By, MemoryUsage, Query, RegionIndex};
use crate::geometry::{Aabb, ConvexVolume};
use crate::kernel::{BASELINE, Isa, Kernel, Work};
use crate::query::{
    AnyVolume, Dispatched, ItemId, Located, ManySink, NoRecorder, QueryContext, QueryCost,
    each_volume,
};

/// A built structure of any kind. Answers are appended to `out`.
pub trait DynIndex: Send + Sync {
    /// See [`RegionIndex::memory`].
    fn memory(&self) -> MemoryUsage;
    /// See [`RegionIndex::query`]. The timed path: nothing is counted.
    fn query(&self, volume: AnyVolume<'_>, out: &mut Vec<ItemId>);
    /// The same query with its cost added up, by the portable instruction set
    /// whatever the kernel is: cost and answer are the same by all of them, and
    /// what is timed is to be asked for its answer itself. All volumes of planes
    /// share one compiled traversal.
    fn query_counted(&self, volume: AnyVolume<'_>, out: &mut Vec<ItemId>, cost: &mut QueryCost);
    /// Region search for many points at once; `out` is cleared first. The timed
    /// path.
    fn query_many(&self, points: &[Vec3], out: &mut Located) {
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

    /// [`DynIndex::query`] for what a frustum of f32 planes sees.
    fn visible(&self, volume: &ConvexVolume, out: &mut Vec<ItemId>) {
        self.query(volume.into(), out);
    }
    /// [`DynIndex::query`] for the items whose closed box holds a point.
    fn locate(&self, p: Vec3, out: &mut Vec<ItemId>) {
        self.query(p.into(), out);
    }
}

/// A structure by itself is asked by the best kernel of this machine.
impl<T: RegionIndex> DynIndex for T {
    fn memory(&self) -> MemoryUsage {
        RegionIndex::memory(self)
    }

    fn query(&self, volume: AnyVolume<'_>, out: &mut Vec<ItemId>) {
        query(Kernel::best(), self, volume, out);
    }

    fn query_counted(&self, volume: AnyVolume<'_>, out: &mut Vec<ItemId>, cost: &mut QueryCost) {
        let mut context = QueryContext::new(BASELINE, out, cost);
        // A Vec never breaks off.
        let _ = match Dispatched::of(volume) {
            Ok(planes) => RegionIndex::query(self, &planes, &mut context),
            Err(p) => RegionIndex::query(self, &p, &mut context),
        };
    }

    fn query_many(&self, points: &[Vec3], out: &mut Located) {
        query_many(Kernel::best(), self, points, out);
    }

    fn refit(&mut self, items: &[Aabb], moved: &[ItemId]) -> bool {
        RegionIndex::refit(self, items, moved)
    }
}

impl<T: RegionIndex> DynIndex for By<T> {
    fn memory(&self) -> MemoryUsage {
        RegionIndex::memory(&self.index)
    }

    fn query(&self, volume: AnyVolume<'_>, out: &mut Vec<ItemId>) {
        query(self.kernel, &self.index, volume, out);
    }

    fn query_counted(&self, volume: AnyVolume<'_>, out: &mut Vec<ItemId>, cost: &mut QueryCost) {
        DynIndex::query_counted(&self.index, volume, out, cost);
    }

    fn query_many(&self, points: &[Vec3], out: &mut Located) {
        query_many(self.kernel, &self.index, points, out);
    }

    fn refit(&mut self, items: &[Aabb], moved: &[ItemId]) -> bool {
        RegionIndex::refit(&mut self.index, items, moved)
    }
}

/// A traversal of its own for each volume and kernel.
fn query<T: RegionIndex>(kernel: Kernel, index: &T, volume: AnyVolume<'_>, out: &mut Vec<ItemId>) {
    let recorder = &mut NoRecorder;
    // A Vec never breaks off.
    let _ =
        each_volume!(volume, volume => kernel.run(Query { index, volume, sink: out, recorder }));
}

/// A batch of region searches as a kernel does it.
struct QueryMany<'a, T> {
    index: &'a T,
    points: &'a [Vec3],
    out: &'a mut Located,
}

impl<T: RegionIndex> Work for QueryMany<'_, T> {
    type Output = ();

    #[inline(always)]
    fn run<I: Isa>(self, isa: I) {
        // The collector never breaks off.
        let _ = self.index.query_many(isa, self.points, self.out);
    }
}

pub(super) fn query_many<T: RegionIndex>(
    kernel: Kernel,
    index: &T,
    points: &[Vec3],
    out: &mut Located,
) {
    out.clear();
    kernel.run(QueryMany { index, points, out });
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::{ConvexVolumeF64, Plane, RelativeVolume, Spheres};
    use crate::index::{Input, Linear, OctreeTextbook, Trace, Wide};

    /// Answer and cost of the structure compiled for the volume, and counted.
    fn both<T: RegionIndex>(index: &T, volume: AnyVolume<'_>) -> [(Vec<ItemId>, QueryCost); 2] {
        let [mut own, mut counted] = <[(Vec<ItemId>, QueryCost); 2]>::default();
        let mut context = QueryContext::new(BASELINE, &mut own.0, &mut own.1);
        let _ = each_volume!(volume, v => RegionIndex::query(index, v, &mut context));
        index.query_counted(volume, &mut counted.0, &mut counted.1);
        [own, counted]
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
            let [own, counted] = both(&index, volume);
            assert!(!own.0.is_empty() && own.0.len() < input.items.len());
            assert_eq!(own, counted, "{} {volume:?}", T::INFO.name);
        }
        let wide_tree = Wide::build(&input, &Default::default()).unwrap();
        for volume in volumes {
            if let Ok(planes) = Dispatched::of(volume) {
                let own = each_volume!(volume, v => Trace::of(&wide_tree, v));
                assert_eq!(Trace::of(&wide_tree, &planes), own, "{volume:?}");
            }
            check::<Wide>(&input, volume);
            check::<Linear>(&input, volume);
            check::<OctreeTextbook>(&input, volume);
        }
    }
}
