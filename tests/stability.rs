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
use cullbench::geometry::Aabb;
use cullbench::index::{BACKENDS, DynIndex, StructureSpec};
use cullbench::kernel::Kernel;
use cullbench::measure::Workload;
use cullbench::path::{self, LensDefaults};
use cullbench::query::ItemId;
use cullbench::scene::{self, FAMILIES, SAMPLES, Scene};

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
        "f48909dfd535ea34",
    ],
    [
        "uniform:n=1200,seed=7",
        "flythrough:frames=5,visible=2%",
        "2a1f8adee228da11",
        "bfcc2f006eac7f9c",
    ],
    [
        "uniform:n=1200,seed=7",
        "zoom:frames=4",
        "9d38454c0bda6faf",
        "a61ea9696cc84193",
    ],
    [
        "uniform:n=1200,seed=7",
        "teleport:frames=5,seed=3",
        "9ab8cd90307d9f5c",
        "d9d89511c305cb5b",
    ],
    [
        "uniform:n=1200,seed=7",
        "spin:frames=3,far=inf",
        "522aca159d1461f1",
        "c23985333d0203f4",
    ],
    [
        "clustered:n=1200,seed=7",
        "orbit:frames=3",
        "76f44af35e5ab063",
        "f526ac38b80ed905",
    ],
    [
        "clustered:n=1200,seed=7",
        "flythrough:frames=5,visible=2%",
        "45ada1e6ca1991d6",
        "a9b15eeea36e2f59",
    ],
    [
        "clustered:n=1200,seed=7",
        "zoom:frames=4",
        "82d5753cf15ff736",
        "90cb2fbb67882b1e",
    ],
    [
        "clustered:n=1200,seed=7",
        "teleport:frames=5,seed=3",
        "0e5aaa4c5a97a069",
        "c1373d4fc2152f64",
    ],
    [
        "clustered:n=1200,seed=7",
        "spin:frames=3,far=inf",
        "fa33d32b78528a24",
        "dd18dfe139955dfb",
    ],
    [
        "city:n=1200,seed=7",
        "orbit:frames=3",
        "39d9b1ff0e6b7034",
        "1c0afab37a9a7e0f",
    ],
    [
        "city:n=1200,seed=7",
        "flythrough:frames=5,visible=2%",
        "b070505bf8b16a01",
        "9cae93b6769d2302",
    ],
    [
        "city:n=1200,seed=7",
        "zoom:frames=4",
        "f26bccc91c9839cc",
        "94222eea767bbd6c",
    ],
    [
        "city:n=1200,seed=7",
        "teleport:frames=5,seed=3",
        "2986423762645daf",
        "a04f83b9fd63b367",
    ],
    [
        "city:n=1200,seed=7",
        "spin:frames=3,far=inf",
        "6dd5078a476279dc",
        "23d0bd880b8ba1bc",
    ],
    [
        "forest:n=1200,seed=7",
        "orbit:frames=3",
        "2981bccbac1cb395",
        "c196b596b883c8f5",
    ],
    [
        "forest:n=1200,seed=7",
        "flythrough:frames=5,visible=2%",
        "ac91129e891abb02",
        "d9116ae0d947da45",
    ],
    [
        "forest:n=1200,seed=7",
        "zoom:frames=4",
        "ee5d01b2eede7285",
        "0c19498ff0503941",
    ],
    [
        "forest:n=1200,seed=7",
        "teleport:frames=5,seed=3",
        "f64ac26a2801fcc4",
        "e463dc4d973863a7",
    ],
    [
        "forest:n=1200,seed=7",
        "spin:frames=3,far=inf",
        "b4b9a0776b70ec84",
        "41ee6dcaeb92ecbc",
    ],
    [
        "rooms:n=1200,seed=7",
        "orbit:frames=3",
        "de740cfbb1512cb9",
        "5844bdb90f6538be",
    ],
    [
        "rooms:n=1200,seed=7",
        "flythrough:frames=5,visible=2%",
        "5a04d1eebf541521",
        "e26a9bae36bae2cd",
    ],
    [
        "rooms:n=1200,seed=7",
        "zoom:frames=4",
        "1cc27ddeafd72004",
        "56fd66398abfbcc5",
    ],
    [
        "rooms:n=1200,seed=7",
        "teleport:frames=5,seed=3",
        "f2e00f12e3e75540",
        "5c524a7fb277209e",
    ],
    [
        "rooms:n=1200,seed=7",
        "spin:frames=3,far=inf",
        "f8c3f8e377448309",
        "7de381e40c280f27",
    ],
    [
        "city:n=1200,seed=7,offset=1e7",
        "orbit:frames=3",
        "96e575cf9f60d9fe",
        "1c0afab37a9a7e0f",
    ],
    [
        "city:n=1200,seed=7,offset=1e7",
        "flythrough:frames=5,visible=2%",
        "e8ff85cc4c3d8c18",
        "9cae93b6769d2302",
    ],
    [
        "city:n=1200,seed=7,offset=1e7",
        "zoom:frames=4",
        "3f65d66e9380efd0",
        "94222eea767bbd6c",
    ],
    [
        "city:n=1200,seed=7,offset=1e7",
        "teleport:frames=5,seed=3",
        "7f635ca352999523",
        "a04f83b9fd63b367",
    ],
    [
        "city:n=1200,seed=7,offset=1e7",
        "spin:frames=3,far=inf",
        "9b2d543f26e56ac2",
        "23d0bd880b8ba1bc",
    ],
    [
        "freedm-map12",
        "orbit:frames=3",
        "e0cfe03cfec7a2ab",
        "04be44df2cd0ee73",
    ],
    [
        "freedm-map12",
        "flythrough:frames=5,visible=2%",
        "c6cb5204340c327b",
        "0f96b33f77cca114",
    ],
    [
        "freedm-map12",
        "zoom:frames=4",
        "de6317a92005ef5a",
        "f6a49bba85bd5617",
    ],
    [
        "freedm-map12",
        "teleport:frames=5,seed=3",
        "e7061e939fb470fc",
        "b0c54874e70f293a",
    ],
    [
        "freedm-map12",
        "spin:frames=3,far=inf",
        "11e72ae0f45ce2a3",
        "5a0544414559db5e",
    ],
    [
        "freedm-map20",
        "orbit:frames=3",
        "4fad6c35ec0b37f2",
        "1c2ce09c3e846835",
    ],
    [
        "freedm-map20",
        "flythrough:frames=5,visible=2%",
        "4eaa922a2a733774",
        "cc9292b91dd07b3e",
    ],
    [
        "freedm-map20",
        "zoom:frames=4",
        "d8e477fd6d339c2c",
        "43322457823b56a1",
    ],
    [
        "freedm-map20",
        "teleport:frames=5,seed=3",
        "e33854d1aafbcb49",
        "fe690d9887313f16",
    ],
    [
        "freedm-map20",
        "spin:frames=3,far=inf",
        "95cc2891376aedab",
        "7057976e5c8b72da",
    ],
    [
        "helsinki",
        "orbit:frames=3",
        "98a0acdac0edbb00",
        "9c0ca869a1ec2905",
    ],
    [
        "helsinki",
        "flythrough:frames=5,visible=2%",
        "a18316943632a230",
        "bfdb40a5c5f466f4",
    ],
    [
        "helsinki",
        "zoom:frames=4",
        "e26cfd5551b36580",
        "3a6d91d53d2d95e0",
    ],
    [
        "helsinki",
        "teleport:frames=5,seed=3",
        "4e298e493f1f8c13",
        "c77fc61d84fb4f1c",
    ],
    [
        "helsinki",
        "spin:frames=3,far=inf",
        "dbd7e661980a21a6",
        "0e35444917f6edd8",
    ],
    [
        "us-counties",
        "orbit:frames=3",
        "38e85fe036a99749",
        "41516187518bea56",
    ],
    [
        "us-counties",
        "flythrough:frames=5,visible=2%",
        "70eb38244399479e",
        "465aea8b5f7a4062",
    ],
    [
        "us-counties",
        "zoom:frames=4",
        "c544536eeef1af39",
        "7b715fd72c146082",
    ],
    [
        "us-counties",
        "teleport:frames=5,seed=3",
        "7f356e328982f28e",
        "8409dda6c67a272b",
    ],
    [
        "us-counties",
        "spin:frames=3,far=inf",
        "23d3dba764d67d4c",
        "c628658278c0337c",
    ],
];

/// Every structure over the boxes and over the cubes of the sphere test.
struct Structures {
    boxes: Vec<Box<dyn DynIndex>>,
    cubes: Vec<Box<dyn DynIndex>>,
    regions: Vec<Box<dyn DynIndex>>,
}

impl Structures {
    fn new(scene: &Scene) -> Structures {
        let over = |items: &[Aabb]| {
            let all = BACKENDS.iter().map(|backend| {
                let spec = StructureSpec::parse(backend.name).expect(backend.name);
                let own_tree = scene.own_tree.as_ref();
                spec.build_with(items, own_tree).expect(backend.name)
            });
            all.collect()
        };
        Structures {
            boxes: over(&scene.items),
            cubes: over(&CullingTest::Sphere.items(&scene.items)),
            regions: over(scene.regions.boxes(&scene.items)),
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
