//! The whole road from a seed to ids, pinned: scenes, paths, planes of every
//! derivation, culling tests, structures, kernels, region search. What is
//! pinned here must come out on any x86-64 or AArch64 machine.
//!
//! To renew the digests after a change that is meant: run the test, put the
//! lines that it prints in place of [`PINNED`], and give the change a line in
//! CHANGELOG.md, because it moves every published figure.

use cullbench::camera::{PLANE_METHODS, PlaneOptions};
use cullbench::culling::{ARITHMETICS, Arithmetic, CameraView, Culling, CullingTest, TESTS};
use cullbench::geometry::{Aabb, PlaneF64, PlaneTree};
use cullbench::index::{DynIndex, Execution, Input, Registry};
use cullbench::kernel::Kernel;
use cullbench::measure::Workload;
use cullbench::path::{self, LensDefaults};
use cullbench::query::ItemId;
use cullbench::scene::{self, SAMPLES, Scene};
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

/// Scene, path, and the first 64 bits of the SHA-256 of questions and of answers.
///
/// The questions are the digest of the scene, eyes and planes. A scene far from the
/// origin has exactly the answers of the one at the origin.
const PINNED: &[[&str; 4]] = &[
    [
        "uniform:n=1200,seed=7",
        "orbit:frames=3",
        "52fe9f4f9dee16a0",
        "a498638734bd5313",
    ],
    [
        "uniform:n=1200,seed=7",
        "flythrough:frames=5,visible=2%",
        "9b9c3efb9f1b0c91",
        "d4aed843e1c28476",
    ],
    [
        "uniform:n=1200,seed=7",
        "zoom:frames=4",
        "04a65c08f63b2972",
        "25786aaec9aaf6c9",
    ],
    [
        "uniform:n=1200,seed=7",
        "teleport:frames=5,seed=3",
        "affdfab02535e848",
        "43f66e049fc267b3",
    ],
    [
        "uniform:n=1200,seed=7",
        "spin:frames=3,far=inf",
        "38e0dfa9a0a67c31",
        "a32d9797c26597bf",
    ],
    [
        "clustered:n=1200,seed=7",
        "orbit:frames=3",
        "78d2002a904953fe",
        "9d4f70f05bd4bcd0",
    ],
    [
        "clustered:n=1200,seed=7",
        "flythrough:frames=5,visible=2%",
        "5a637f000103701a",
        "2193a0e181ced604",
    ],
    [
        "clustered:n=1200,seed=7",
        "zoom:frames=4",
        "8d13b734ce556618",
        "da75cedbe5f053f2",
    ],
    [
        "clustered:n=1200,seed=7",
        "teleport:frames=5,seed=3",
        "3ed56a7226d7e058",
        "4e87c4a900e545d9",
    ],
    [
        "clustered:n=1200,seed=7",
        "spin:frames=3,far=inf",
        "33f06a1e2b2c9684",
        "97fc4ef0da1d9dc3",
    ],
    [
        "city:n=1200,seed=7",
        "orbit:frames=3",
        "3b8b486cd94c90cd",
        "6363aaf5ae2e3e9d",
    ],
    [
        "city:n=1200,seed=7",
        "flythrough:frames=5,visible=2%",
        "2b6cf3e4b26f98fd",
        "615694947a8d0505",
    ],
    [
        "city:n=1200,seed=7",
        "zoom:frames=4",
        "715fcb09a7b33e52",
        "842644c62cdac0e6",
    ],
    [
        "city:n=1200,seed=7",
        "teleport:frames=5,seed=3",
        "5038c0947a0034fb",
        "71b3d0293b3eaf63",
    ],
    [
        "city:n=1200,seed=7",
        "spin:frames=3,far=inf",
        "be3a18d3a5452e32",
        "7b4f39a2e356789c",
    ],
    [
        "forest:n=1200,seed=7",
        "orbit:frames=3",
        "a736788e931de510",
        "ee056803c42ff573",
    ],
    [
        "forest:n=1200,seed=7",
        "flythrough:frames=5,visible=2%",
        "c8ff662eec14ae67",
        "5c36faa6e052da6e",
    ],
    [
        "forest:n=1200,seed=7",
        "zoom:frames=4",
        "5ef5107970cfd6b9",
        "4a6e213928f26ceb",
    ],
    [
        "forest:n=1200,seed=7",
        "teleport:frames=5,seed=3",
        "309a3be68970a405",
        "a59046f329efc1bb",
    ],
    [
        "forest:n=1200,seed=7",
        "spin:frames=3,far=inf",
        "452ef14daf4650d7",
        "a4201715435d8d57",
    ],
    [
        "rooms:n=1200,seed=7",
        "orbit:frames=3",
        "2dae8e4a40a85168",
        "865f266001e0082e",
    ],
    [
        "rooms:n=1200,seed=7",
        "flythrough:frames=5,visible=2%",
        "f274785f865090c7",
        "1fde509fdb0b93c0",
    ],
    [
        "rooms:n=1200,seed=7",
        "zoom:frames=4",
        "891ddaa144add362",
        "1a1a1c0007225726",
    ],
    [
        "rooms:n=1200,seed=7",
        "teleport:frames=5,seed=3",
        "332482bfcb7f9c4c",
        "d43b53be8809df65",
    ],
    [
        "rooms:n=1200,seed=7",
        "spin:frames=3,far=inf",
        "ce5386ddb080238e",
        "dc2d4dd42c7360d0",
    ],
    [
        "city:n=1200,seed=7,offset=1e7",
        "orbit:frames=3",
        "d45eb4c6f273c222",
        "f35a982cc68860e9",
    ],
    [
        "city:n=1200,seed=7,offset=1e7",
        "flythrough:frames=5,visible=2%",
        "35cec207b27605ca",
        "5bd6d1886f8b745f",
    ],
    [
        "city:n=1200,seed=7,offset=1e7",
        "zoom:frames=4",
        "0266ada97991e10e",
        "aa1846cdf197950e",
    ],
    [
        "city:n=1200,seed=7,offset=1e7",
        "teleport:frames=5,seed=3",
        "8f31600f9f47f8e3",
        "0fa592ccb564e0a8",
    ],
    [
        "city:n=1200,seed=7,offset=1e7",
        "spin:frames=3,far=inf",
        "82c9e851aa11c192",
        "d642685fdd997055",
    ],
    [
        "freedm-map12",
        "orbit:frames=3",
        "b206977bec5ef8ce",
        "081a443d8672cbad",
    ],
    [
        "freedm-map12",
        "flythrough:frames=5,visible=2%",
        "993eec32988178c0",
        "c78fb6e1b2ffe807",
    ],
    [
        "freedm-map12",
        "zoom:frames=4",
        "5ca8fce453374426",
        "215812640fbfd05c",
    ],
    [
        "freedm-map12",
        "teleport:frames=5,seed=3",
        "9c8c214a3763bab0",
        "b83366d12803bcab",
    ],
    [
        "freedm-map12",
        "spin:frames=3,far=inf",
        "36ad970b88a2a611",
        "ca39b972070411ba",
    ],
    [
        "freedm-map20",
        "orbit:frames=3",
        "e0b93200a654e5ff",
        "16d12385d633d6bc",
    ],
    [
        "freedm-map20",
        "flythrough:frames=5,visible=2%",
        "ee8a0537845a36df",
        "1b9bfde7a6396d6c",
    ],
    [
        "freedm-map20",
        "zoom:frames=4",
        "91b1ff79e53bdd2d",
        "7d4fe740c4a044e0",
    ],
    [
        "freedm-map20",
        "teleport:frames=5,seed=3",
        "7f04e7ed64d3fff4",
        "abed6c499c4503ff",
    ],
    [
        "freedm-map20",
        "spin:frames=3,far=inf",
        "22a107b684eacf29",
        "0bed7bd6c75c702f",
    ],
    [
        "helsinki",
        "orbit:frames=3",
        "9b568b765e4b4b92",
        "549d1f28d0f6b9df",
    ],
    [
        "helsinki",
        "flythrough:frames=5,visible=2%",
        "717ed71e6971c0d5",
        "2faa5fa59eebd5bf",
    ],
    [
        "helsinki",
        "zoom:frames=4",
        "4885b257f77e817a",
        "2c00ee330b729000",
    ],
    [
        "helsinki",
        "teleport:frames=5,seed=3",
        "2b3cbc6e36d9841e",
        "57ce99b3cf38ca43",
    ],
    [
        "helsinki",
        "spin:frames=3,far=inf",
        "df724ed6063693b4",
        "12a6e7965cea38b8",
    ],
    [
        "us-counties",
        "orbit:frames=3",
        "ce5458358f8e516b",
        "534ef734b0402cac",
    ],
    [
        "us-counties",
        "flythrough:frames=5,visible=2%",
        "227dc0437725fa12",
        "8c4859781e8e3d28",
    ],
    [
        "us-counties",
        "zoom:frames=4",
        "84771c96fba4070b",
        "400871b778807e7e",
    ],
    [
        "us-counties",
        "teleport:frames=5,seed=3",
        "80463b311d8e40e9",
        "f5714c6461a19721",
    ],
    [
        "us-counties",
        "spin:frames=3,far=inf",
        "cce9bd1a6fd3c6e3",
        "32c9008789788bec",
    ],
];

/// Every structure over the boxes and over the cubes of the sphere test.
struct Structures {
    boxes: Vec<Named>,
    cubes: Vec<Named>,
    regions: Vec<Named>,
}

/// A structure that one of the kernels queries, with the names of both.
type Named = (String, Box<dyn DynIndex>);

fn over(items: &[Aabb], own_tree: Option<&PlaneTree>) -> Vec<Named> {
    let registry = Registry::builtin();
    let all = Kernel::available().flat_map(|kernel| {
        let specs = registry.structures("all").expect("all").into_iter();
        specs.map(move |spec| {
            let spec = spec.by(Execution { kernel, threads: 1 });
            let what = format!("{}, {kernel}", spec.label);
            let built = spec
                .build(Input::new(items).own_tree(own_tree))
                .expect(&what);
            (what, built)
        })
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

    fn of(&self, test: CullingTest) -> &[Named] {
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
    structures: &[Named],
    what: &str,
    ask: impl Fn(&dyn DynIndex, &mut Vec<ItemId>),
) -> Vec<ItemId> {
    let mut wanted: Option<Vec<ItemId>> = None;
    for (name, index) in structures {
        let mut ids = Vec::new();
        ask(index.as_ref(), &mut ids);
        ids.sort_unstable();
        let wanted = wanted.get_or_insert_with(|| ids.clone());
        assert!(ids == *wanted, "{what}: {name}");
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

/// Digests of a scene along a path: of the questions, and of the answers.
///
/// Adds the number of ids to `found`.
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
                index.query(view.as_any(), out);
            });
            *found += ids.len();
            answered.take(&ids);
        }
        if let (Some(camera), [CameraView::Volume(view), ..]) =
            (path.cameras.first(), &workload.views[..])
        {
            let faces: Vec<PlaneF64> = view.planes().iter().map(PlaneF64::from).collect();
            let points = points_on_faces(camera, scene.origin, &faces);
            let ids = agreed(&over(&points, None), &what, |index, out| {
                index.query(view.into(), out);
            });
            *found += ids.len();
            answered.take(&ids);
        }
        // The points are the same for every culling.
        if culling == Culling::default() {
            for (n, &p) in workload.points.iter().enumerate() {
                let what = format!("{}, {}, region search", scene.name, path.name);
                let ids = agreed(&structures.regions, &what, |index, out| {
                    index.locate(p, out);
                    workload.scene.refine(&workload.sought[n], out, 0);
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
    let worlds = ["uniform", "clustered", "city", "forest", "rooms"];
    let generated = worlds.map(|name| format!("{name}:n={ITEMS},seed=7"));
    let far = ["city:n=1200,seed=7,offset=1e7".to_owned()];
    let real = SAMPLES.iter().map(|sample| sample.name.to_owned());
    let mut lines = Vec::new();
    let mut ids = 0;
    for name in generated.into_iter().chain(far).chain(real) {
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
