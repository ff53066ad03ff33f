//! The whole road from a seed to ids, pinned: scenes, paths, planes of every
//! derivation, culling tests, structures, kernels, region search. What is
//! pinned here must come out on any x86-64 or AArch64 machine. A process of its
//! own with one test, because the kernel is chosen for the process.
//!
//! To renew the digests after a change that is meant: run the test, put the
//! lines that it prints in place of [`PINNED`], and give the change a line in
//! CHANGELOG.md, because it moves every published figure.

use cullbench::camera::{PLANE_METHODS, PlaneOptions};
use cullbench::culling::{ARITHMETICS, Arithmetic, CameraView, Culling, CullingTest, TESTS};
use cullbench::geometry::{Aabb, PlaneTree, WidePlane};
use cullbench::index::{BACKENDS, DynIndex, StructureSpec};
use cullbench::kernel::Kernel;
use cullbench::measure::Workload;
use cullbench::path::{self, LensDefaults};
use cullbench::query::ItemId;
use cullbench::scene::{self, FAMILIES, SAMPLES, Scene};
use cullbench::verify::points_on_faces;

/// Items of a generated scene. Large enough for trees of several levels.
const ITEMS: usize = 1200;
const PATHS: [&str; 5] = [
    "orbit:frames=3",
    "flythrough:frames=5,visible=2%",
    "zoom:frames=4",
    "teleport:frames=5,seed=3",
    "spin:frames=3,far=inf",
];

/// Scene, path, and the first 64 bits of a SHA-256 over what is asked (the
/// scene's digest, eyes, planes) and of one over all answers. A scene far from
/// zero gives the very answers of the one at zero.
const PINNED: &[[&str; 4]] = &[
    [
        "uniform:n=1200,seed=7",
        "orbit:frames=3",
        "22e56858b6612f22",
        "695395e2513b064e",
    ],
    [
        "uniform:n=1200,seed=7",
        "flythrough:frames=5,visible=2%",
        "2a1f8adee228da11",
        "7805588c6cecf20d",
    ],
    [
        "uniform:n=1200,seed=7",
        "zoom:frames=4",
        "9d38454c0bda6faf",
        "25c0884311ec650e",
    ],
    [
        "uniform:n=1200,seed=7",
        "teleport:frames=5,seed=3",
        "9ab8cd90307d9f5c",
        "cce59eba58aa9bb0",
    ],
    [
        "uniform:n=1200,seed=7",
        "spin:frames=3,far=inf",
        "522aca159d1461f1",
        "b5916814e5489860",
    ],
    [
        "clustered:n=1200,seed=7",
        "orbit:frames=3",
        "76f44af35e5ab063",
        "9faa011ad3b0772f",
    ],
    [
        "clustered:n=1200,seed=7",
        "flythrough:frames=5,visible=2%",
        "45ada1e6ca1991d6",
        "382c7ec786c4a6a5",
    ],
    [
        "clustered:n=1200,seed=7",
        "zoom:frames=4",
        "82d5753cf15ff736",
        "44364b23dc93e63c",
    ],
    [
        "clustered:n=1200,seed=7",
        "teleport:frames=5,seed=3",
        "0e5aaa4c5a97a069",
        "49f2f2f5099ddae5",
    ],
    [
        "clustered:n=1200,seed=7",
        "spin:frames=3,far=inf",
        "fa33d32b78528a24",
        "3da94c71c5e2b08c",
    ],
    [
        "city:n=1200,seed=7",
        "orbit:frames=3",
        "39d9b1ff0e6b7034",
        "7d69173598b7fc88",
    ],
    [
        "city:n=1200,seed=7",
        "flythrough:frames=5,visible=2%",
        "b070505bf8b16a01",
        "012c0fff9a32f190",
    ],
    [
        "city:n=1200,seed=7",
        "zoom:frames=4",
        "f26bccc91c9839cc",
        "969b43269c6c661c",
    ],
    [
        "city:n=1200,seed=7",
        "teleport:frames=5,seed=3",
        "2986423762645daf",
        "370bfe28b09f0a62",
    ],
    [
        "city:n=1200,seed=7",
        "spin:frames=3,far=inf",
        "6dd5078a476279dc",
        "31540ee5954acacc",
    ],
    [
        "forest:n=1200,seed=7",
        "orbit:frames=3",
        "2981bccbac1cb395",
        "84d429e1a661439b",
    ],
    [
        "forest:n=1200,seed=7",
        "flythrough:frames=5,visible=2%",
        "ac91129e891abb02",
        "4bff8cce000e67cf",
    ],
    [
        "forest:n=1200,seed=7",
        "zoom:frames=4",
        "ee5d01b2eede7285",
        "85df56179a38854b",
    ],
    [
        "forest:n=1200,seed=7",
        "teleport:frames=5,seed=3",
        "f64ac26a2801fcc4",
        "eb375fc1c33ef0a0",
    ],
    [
        "forest:n=1200,seed=7",
        "spin:frames=3,far=inf",
        "b4b9a0776b70ec84",
        "259c3534e4a2e9a5",
    ],
    [
        "rooms:n=1200,seed=7",
        "orbit:frames=3",
        "de740cfbb1512cb9",
        "503073c6a4a6a902",
    ],
    [
        "rooms:n=1200,seed=7",
        "flythrough:frames=5,visible=2%",
        "5a04d1eebf541521",
        "bc800c8fdae18cab",
    ],
    [
        "rooms:n=1200,seed=7",
        "zoom:frames=4",
        "1cc27ddeafd72004",
        "5d6b62db78fc7c4c",
    ],
    [
        "rooms:n=1200,seed=7",
        "teleport:frames=5,seed=3",
        "f2e00f12e3e75540",
        "a1be2ee6fdba4c5b",
    ],
    [
        "rooms:n=1200,seed=7",
        "spin:frames=3,far=inf",
        "f8c3f8e377448309",
        "4e12d8a468781b75",
    ],
    [
        "city:n=1200,seed=7,offset=1e7",
        "orbit:frames=3",
        "96e575cf9f60d9fe",
        "afea342089185705",
    ],
    [
        "city:n=1200,seed=7,offset=1e7",
        "flythrough:frames=5,visible=2%",
        "e8ff85cc4c3d8c18",
        "3bf394d7f77d389b",
    ],
    [
        "city:n=1200,seed=7,offset=1e7",
        "zoom:frames=4",
        "3f65d66e9380efd0",
        "fbb17e9767dc2dfd",
    ],
    [
        "city:n=1200,seed=7,offset=1e7",
        "teleport:frames=5,seed=3",
        "7f635ca352999523",
        "d6e0560ed94c8aa0",
    ],
    [
        "city:n=1200,seed=7,offset=1e7",
        "spin:frames=3,far=inf",
        "9b2d543f26e56ac2",
        "c2666eb6f5cf4d72",
    ],
    [
        "freedm-map12",
        "orbit:frames=3",
        "e0cfe03cfec7a2ab",
        "8066a32039afaca2",
    ],
    [
        "freedm-map12",
        "flythrough:frames=5,visible=2%",
        "c6cb5204340c327b",
        "c78fb6e1b2ffe807",
    ],
    [
        "freedm-map12",
        "zoom:frames=4",
        "de6317a92005ef5a",
        "3fa88f1583b6f90f",
    ],
    [
        "freedm-map12",
        "teleport:frames=5,seed=3",
        "e7061e939fb470fc",
        "5ce1fade00dd1dde",
    ],
    [
        "freedm-map12",
        "spin:frames=3,far=inf",
        "11e72ae0f45ce2a3",
        "546c013198d86f23",
    ],
    [
        "freedm-map20",
        "orbit:frames=3",
        "4fad6c35ec0b37f2",
        "4666c4e00c934465",
    ],
    [
        "freedm-map20",
        "flythrough:frames=5,visible=2%",
        "4eaa922a2a733774",
        "b38282b853d455a1",
    ],
    [
        "freedm-map20",
        "zoom:frames=4",
        "d8e477fd6d339c2c",
        "3506a10360953464",
    ],
    [
        "freedm-map20",
        "teleport:frames=5,seed=3",
        "e33854d1aafbcb49",
        "a9a0c529577e6d91",
    ],
    [
        "freedm-map20",
        "spin:frames=3,far=inf",
        "95cc2891376aedab",
        "a6e5a05ce94bd7d7",
    ],
    [
        "helsinki",
        "orbit:frames=3",
        "98a0acdac0edbb00",
        "ee73c9c72e13f2e5",
    ],
    [
        "helsinki",
        "flythrough:frames=5,visible=2%",
        "a18316943632a230",
        "17e745f2c8ecb954",
    ],
    [
        "helsinki",
        "zoom:frames=4",
        "e26cfd5551b36580",
        "560928d66d3bcd32",
    ],
    [
        "helsinki",
        "teleport:frames=5,seed=3",
        "4e298e493f1f8c13",
        "cd08b20f57bbb3e3",
    ],
    [
        "helsinki",
        "spin:frames=3,far=inf",
        "dbd7e661980a21a6",
        "b2d556b60759fe56",
    ],
    [
        "us-counties",
        "orbit:frames=3",
        "38e85fe036a99749",
        "adbd2fa9b9c339c7",
    ],
    [
        "us-counties",
        "flythrough:frames=5,visible=2%",
        "70eb38244399479e",
        "a1cad2c1fa1b48d0",
    ],
    [
        "us-counties",
        "zoom:frames=4",
        "c544536eeef1af39",
        "4d095a87801ab693",
    ],
    [
        "us-counties",
        "teleport:frames=5,seed=3",
        "7f356e328982f28e",
        "8b0997da6f2383c5",
    ],
    [
        "us-counties",
        "spin:frames=3,far=inf",
        "23d3dba764d67d4c",
        "3d45273810656407",
    ],
];

/// Every structure over the boxes and over the cubes of the sphere test.
struct Structures {
    boxes: Vec<Box<dyn DynIndex>>,
    cubes: Vec<Box<dyn DynIndex>>,
    regions: Vec<Box<dyn DynIndex>>,
}

fn over(items: &[Aabb], own_tree: Option<&PlaneTree>) -> Vec<Box<dyn DynIndex>> {
    let all = BACKENDS.iter().map(|backend| {
        let spec = StructureSpec::parse(backend.name).expect(backend.name);
        spec.build_with(items, own_tree).expect(backend.name)
    });
    all.collect()
}

impl Structures {
    fn new(scene: &Scene) -> Structures {
        let own_tree = scene.own_tree.as_ref();
        Structures {
            boxes: over(&scene.items, own_tree),
            cubes: over(&CullingTest::Sphere.items(&scene.items), own_tree),
            regions: over(scene.regions.boxes(&scene.items), own_tree),
        }
    }

    fn of(&self, test: CullingTest) -> &[Box<dyn DynIndex>] {
        match test {
            CullingTest::Sphere => &self.cubes,
            _ => &self.boxes,
        }
    }
}

/// Every test with every arithmetic, every derivation of the planes, and no
/// epsilon once.
fn cullings() -> Vec<Culling> {
    let mut all = Vec::new();
    for (test, ..) in TESTS {
        for (arithmetic, ..) in ARITHMETICS {
            all.push(Culling {
                test,
                arithmetic,
                ..Culling::default()
            });
        }
    }
    all.extend(PLANE_METHODS.iter().map(|&(method, ..)| Culling {
        planes: PlaneOptions {
            method,
            epsilon: 0.0,
        },
        ..Culling::default()
    }));
    all.retain(|culling| culling.check().is_ok());
    all
}

/// The ids that every structure with every kernel gives, sorted.
fn agreed(
    structures: &[Box<dyn DynIndex>],
    what: &str,
    ask: impl Fn(&dyn DynIndex, &mut Vec<ItemId>),
) -> Vec<ItemId> {
    let mut wanted: Option<Vec<ItemId>> = None;
    for kernel in Kernel::available() {
        kernel.choose().expect("available");
        for (backend, index) in BACKENDS.iter().zip(structures) {
            let mut ids = Vec::new();
            ask(index.as_ref(), &mut ids);
            ids.sort_unstable();
            let wanted = wanted.get_or_insert_with(|| ids.clone());
            assert!(ids == *wanted, "{what}: {}, {kernel}", backend.name);
        }
    }
    wanted.unwrap_or_default()
}

/// SHA-256 over numbers; an id set has its size before it.
#[derive(Default)]
struct Digest(hmac_sha256::Hash);

impl Digest {
    /// The bits of what a view is made of. Spheres are made of the planes of
    /// the six-plane test.
    fn view(&mut self, view: &CameraView) {
        match view {
            CameraView::Volume(volume) => volume.planes().iter().for_each(|p| {
                self.f64s(&p.normal.as_dvec3().to_array());
                self.f64s(&[p.d.into()]);
            }),
            CameraView::Wide(volume) => volume.planes().iter().for_each(|p| {
                self.f64s(&p.normal.to_array());
                self.f64s(&[p.d]);
            }),
            CameraView::Spheres(_) | CameraView::Relative(_) => {}
        }
    }

    fn f64s(&mut self, numbers: &[f64]) {
        for number in numbers {
            self.0.update(number.to_bits().to_le_bytes());
        }
    }

    fn take(&mut self, ids: &[ItemId]) {
        self.0.update((ids.len() as u64).to_le_bytes());
        for id in ids {
            self.0.update(id.to_le_bytes());
        }
    }

    /// The first half of a SHA-256 is long enough to tell by.
    fn hex(self) -> String {
        let bytes = self.0.finalize();
        bytes[..8].iter().map(|b| format!("{b:02x}")).collect()
    }
}

/// The digests of a scene along a path: of what is asked, and of the answers.
/// Adds up how many ids went into it.
fn digests(scene: &Scene, structures: &Structures, path: &str, found: &mut usize) -> [String; 2] {
    let path = path::load(path, scene, &LensDefaults::default()).expect(path);
    let (mut asked, mut answered) = (Digest::default(), Digest::default());
    asked.0.update(scene.digest());
    for camera in &path.cameras {
        asked.f64s(&camera.frame.eye.to_array());
    }
    for culling in cullings() {
        let what = format!("{}, {}, {culling:?}", scene.name, path.name);
        let workload = Workload::new(scene, &path, &culling).expect(&what);
        for view in &workload.views {
            asked.view(view);
            let ids = agreed(structures.of(culling.test), &what, |index, out| {
                index.see(view.as_any(), out);
            });
            *found += ids.len();
            answered.take(&ids);
        }
        if let (Some(camera), [CameraView::Volume(view), ..]) =
            (path.cameras.first(), &workload.views[..])
        {
            let faces: Vec<WidePlane> = view.planes().iter().map(WidePlane::from).collect();
            let points = points_on_faces(camera, scene.origin, &faces);
            let ids = agreed(&over(&points, None), &what, |index, out| {
                index.see(view.into(), out);
            });
            *found += ids.len();
            answered.take(&ids);
        }
        // The points are the same for every culling.
        if culling == Culling::default() {
            for &p in &workload.points {
                let what = format!("{}, {}, region search", scene.name, path.name);
                let ids = agreed(&structures.regions, &what, |index, out| {
                    index.locate(p, out);
                    workload.refine(p, out);
                });
                *found += ids.len();
                answered.take(&ids);
            }
        }
    }
    [asked.hex(), answered.hex()]
}

#[test]
fn every_answer_is_the_published_one_from_every_structure_and_kernel() {
    let in_f32 = |c: &&Culling| c.arithmetic == Arithmetic::F32;
    let count = cullings().iter().filter(in_f32).count();
    assert_eq!(count, TESTS.len() + PLANE_METHODS.len());
    let generated = FAMILIES
        .iter()
        .map(|family| format!("{}:n={ITEMS},seed=7", family.name));
    let far = ["city:n=1200,seed=7,offset=1e7".to_owned()];
    let real = SAMPLES.iter().map(|sample| sample.name.to_owned());
    let mut lines = Vec::new();
    let mut ids = 0;
    for name in generated.chain(far).chain(real) {
        let scene = scene::load(&name, &Default::default()).expect(&name);
        let structures = Structures::new(&scene);
        for path in PATHS {
            let [asked, answered] = digests(&scene, &structures, path, &mut ids);
            lines.push([name.clone(), path.to_owned(), asked, answered]);
        }
    }
    assert!(ids > 500_000, "{ids} ids");
    let shown = |line: &[String; 4]| format!("    {line:?},");
    let now: Vec<String> = lines.iter().map(shown).collect();
    let differing = (0..lines.len()).filter(|&i| PINNED.get(i).is_none_or(|p| *p != lines[i]));
    let differing: Vec<&str> = differing.map(|i| now[i].as_str()).collect();
    assert!(
        lines.len() == PINNED.len() && differing.is_empty(),
        "{} lines differ:\n{}\nall lines now:\n{}",
        differing.len(),
        differing.join("\n"),
        now.join("\n")
    );
}
