//! Every instruction set gives the same answer: the same ids in the same
//! order and the same counts, from every structure, for every view. A process
//! of its own with one test, because the kernel is chosen for the process.

use cullbench::geometry::{Aabb, RelativeVolume, Spheres, WideVolume, sphere_cube};
use cullbench::index::{BACKENDS, DynIndex, StructureSpec};
use cullbench::kernel::Kernel;
use cullbench::query::{AnyView, ItemId, QueryCost};
use cullbench::verify::RandomCase;
use glam::Vec3;

/// All that a structure says when asked everything.
#[derive(PartialEq, Debug, Default)]
struct Said {
    ids: Vec<Vec<ItemId>>,
    costs: Vec<QueryCost>,
}

impl Said {
    fn see(&mut self, index: &dyn DynIndex, view: AnyView<'_>) {
        let (mut plain, mut ids, mut cost) = (Vec::new(), Vec::new(), QueryCost::default());
        index.see(view, &mut plain);
        index.see_counted(view, &mut ids, &mut cost);
        assert_eq!(plain, ids, "counting changes the answer");
        self.ids.push(ids);
        self.costs.push(cost);
    }

    fn locate(&mut self, index: &dyn DynIndex, p: Vec3) {
        let (mut plain, mut ids, mut cost) = (Vec::new(), Vec::new(), QueryCost::default());
        index.locate(p, &mut plain);
        index.locate_counted(p, &mut ids, &mut cost);
        assert_eq!(plain, ids, "counting changes the answer");
        self.ids.push(ids);
        self.costs.push(cost);
    }
}

fn ask(structure: &str, case: &RandomCase) -> Said {
    let build = |items: &[Aabb]| {
        let spec = StructureSpec::parse(structure).expect(structure);
        spec.build(items).expect(structure)
    };
    let cubes: Vec<Aabb> = case.items.iter().map(sphere_cube).collect();
    let (index, index_of_cubes) = (build(&case.items), build(&cubes));
    let volume = &case.volume;
    let mut said = Said::default();
    said.see(&*index, volume.into());
    said.see(&*index_of_cubes, (&Spheres::new(volume)).into());
    said.see(&*index, (&WideVolume::from(volume)).into());
    if let Ok(relative) = RelativeVolume::about(case.point, volume) {
        said.see(&*index, (&relative).into());
    }
    said.locate(&*index, case.point);
    said
}

#[test]
fn every_kernel_gives_the_same_ids_in_the_same_order_and_the_same_counts() {
    assert_eq!(Kernel::chosen(), Kernel::best(), "unless told otherwise");
    let (mut answers, mut items) = (0, 0);
    for seed in 0..200 {
        let case = RandomCase::new(seed);
        for backend in BACKENDS {
            Kernel::Portable.choose().expect("always there");
            let wanted = ask(backend.name, &case);
            for kernel in Kernel::available() {
                kernel.choose().expect("available");
                assert_eq!(Kernel::chosen(), kernel);
                let said = ask(backend.name, &case);
                assert_eq!(said, wanted, "{}, {kernel}, case {seed}", backend.name);
            }
            answers += wanted.ids.len();
            items += wanted.ids.iter().map(Vec::len).sum::<usize>();
        }
    }
    assert!(answers > 5000 && items > 100_000, "{answers}, {items}");
    // One that is not there is refused and changes nothing.
    for kernel in Kernel::ALL.into_iter().filter(|k| !k.is_available()) {
        let before = Kernel::chosen();
        assert!(kernel.choose().is_err());
        assert_eq!(Kernel::chosen(), before);
    }
}
