//! The whole road from a seed to ids, pinned: scenes, paths, planes of every
//! derivation, culling tests, structures, kernels, region search. What is
//! pinned here must come out on any x86-64 or AArch64 machine.
//!
//! To renew the digests after a change that is meant: run the test, put the
//! lines that it prints in place of [`PINNED`], and give the change a line in
//! CHANGELOG.md, because it moves every published figure.

mod pinned;

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

use pinned::PINNED;

/// Items of a generated scene. Large enough for trees of several levels.
const ITEMS: usize = 1200;
const PATHS: [&str; 5] = [
    "orbit:frames=3",
    "flythrough:frames=5,visible=2%",
    "zoom:frames=4",
    "teleport:frames=5,seed=3",
    "spin:frames=3,far=inf",
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
            CameraView::PlanesF64(volume) => volume.planes().iter().for_each(|p| {
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
