//! Every instruction set gives the same answer: the same ids in the same
//! order and the same counts, from every structure, for every view; and the one
//! that a spec names is the one that runs.

use std::ops::ControlFlow;

use cullbench::geometry::{Aabb, ConvexVolumeF64, RelativeVolume, Spheres, sphere_cube};
use cullbench::index::{
    BuildError, DynIndex, Execution, Info, Input, Kind, MemoryUsage, Origin, RegionIndex, Registry,
    StructureSpec,
};
use cullbench::kernel::{Isa, Kernel};
use cullbench::query::{AnyVolume, Context, ItemId, Located, QueryCost, QueryVolume, Sink};
use cullbench::verify::RandomCase;
use glam::Vec3;

/// All that a structure says when asked everything.
#[derive(PartialEq, Debug, Default)]
struct Said {
    ids: Vec<Vec<ItemId>>,
    costs: Vec<QueryCost>,
}

impl Said {
    fn see(&mut self, index: &dyn DynIndex, view: AnyVolume<'_>) {
        let (mut plain, mut ids, mut cost) = (Vec::new(), Vec::new(), QueryCost::default());
        index.query(view, &mut plain);
        index.query_counted(view, &mut ids, &mut cost);
        assert_eq!(plain, ids, "counting changes the answer");
        self.ids.push(ids);
        self.costs.push(cost);
    }

    fn locate(&mut self, index: &dyn DynIndex, p: Vec3) {
        let (mut plain, mut ids, mut cost) = (Vec::new(), Vec::new(), QueryCost::default());
        index.locate(p, &mut plain);
        index.query_counted(p.into(), &mut ids, &mut cost);
        assert_eq!(plain, ids, "counting changes the answer");
        self.ids.push(ids);
        self.costs.push(cost);
    }
}

fn ask(structure: &str, kernel: Kernel, case: &RandomCase) -> Said {
    let build = |items: &[Aabb]| {
        let spec = StructureSpec::parse(structure).expect(structure);
        let threads = 1;
        let spec = spec.by(Execution { kernel, threads });
        spec.build(items).expect(structure)
    };
    let cubes: Vec<Aabb> = case.items.iter().map(sphere_cube).collect();
    let (index, index_of_cubes) = (build(&case.items), build(&cubes));
    let volume = &case.volume;
    let mut said = Said::default();
    said.see(&*index, volume.into());
    said.see(&*index_of_cubes, (&Spheres::new(volume)).into());
    said.see(&*index, (&ConvexVolumeF64::from(volume)).into());
    if let Ok(relative) = RelativeVolume::about(case.point, volume) {
        said.see(&*index, (&relative).into());
    }
    said.locate(&*index, case.point);
    said
}

#[test]
fn every_kernel_gives_the_same_ids_in_the_same_order_and_the_same_counts() {
    let unless_told_otherwise = Execution::default().kernel;
    assert_eq!(unless_told_otherwise, Kernel::best());
    let (mut answers, mut items) = (0, 0);
    for seed in 0..200 {
        let case = RandomCase::new(seed);
        for row in Registry::builtin().rows() {
            let wanted = ask(row.info.name, Kernel::Portable, &case);
            for kernel in Kernel::available() {
                let said = ask(row.info.name, kernel, &case);
                assert_eq!(said, wanted, "{}, {kernel}, case {seed}", row.info.name);
            }
            answers += wanted.ids.len();
            items += wanted.ids.iter().map(Vec::len).sum::<usize>();
        }
    }
    assert!(answers > 5000 && items > 100_000, "{answers}, {items}");
}

/// Answers every question with the place of the instruction set that it is
/// compiled for, in [`Kernel::ALL`].
struct TellsKernel;

fn told<I: Isa>(sink: &mut impl Sink) -> ControlFlow<()> {
    let name = std::any::type_name::<I>();
    let is = |kernel: &Kernel| name.to_lowercase().ends_with(kernel.name());
    let place = Kernel::ALL.iter().position(is).unwrap_or_default();
    sink.accept(&[place as ItemId])
}

impl RegionIndex for TellsKernel {
    const INFO: Info = Info::new("tells-kernel", "for this test", Kind::Scan, Origin::Ours);
    type Params = ();

    fn build(_: &Input<'_>, _: &()) -> Result<Self, BuildError> {
        Ok(TellsKernel)
    }
    fn memory(&self) -> MemoryUsage {
        MemoryUsage::default()
    }
    fn query<Q: QueryVolume, C: Context>(&self, _: &Q, cx: &mut C) -> ControlFlow<()> {
        told::<C::Isa>(cx.sink())
    }
    fn query_many<I: Isa>(&self, _: I, _: &[Vec3], out: &mut Located) {
        let mut ids = Vec::new();
        let _ = told::<I>(&mut ids);
        out.push(&ids);
    }
}

/// Two specs side by side keep to their own kernels, whatever the other does.
#[test]
fn a_structure_is_asked_by_the_kernel_of_its_spec() {
    let row = Registry::empty().with::<TellsKernel>();
    let spec = row.structure("tells-kernel").expect("registered");
    let built = Kernel::available().map(|kernel| {
        let by = Execution { kernel, threads: 1 };
        (
            kernel,
            spec.clone()
                .by(by)
                .build(Input::new(&[]))
                .expect("no items"),
        )
    });
    let built: Vec<_> = built.collect();
    let volume = RandomCase::new(1).volume;
    for (kernel, index) in built.iter().rev().chain(&built) {
        let mut told = [const { Vec::new() }; 5];
        let [seen, counted, located, located_counted, batched] = &mut told;
        let cost = &mut QueryCost::default();
        index.visible(&volume, seen);
        index.query_counted((&volume).into(), counted, cost);
        index.locate(Vec3::ZERO, located);
        index.query_counted(Vec3::ZERO.into(), located_counted, cost);
        let mut all = Located::default();
        index.query_many(&[Vec3::ZERO], &mut all);
        batched.extend(all.iter().flatten());
        // What is counted is counted by the portable one.
        let by = |i| match i {
            1 | 3 => Kernel::Portable,
            _ => *kernel,
        };
        let wanted = std::array::from_fn(|i| vec![by(i) as ItemId]);
        assert_eq!(told, wanted, "{kernel}");
    }
}
