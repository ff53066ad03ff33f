//! Does `stress` catch what it is there for? Structures that are wrong in one
//! way each, and planes without their margin, must fail a vector or a
//! generated case, and the row must name it.

use cullbench::camera::PlaneOptions;
use cullbench::culling::{Culling, CullingTest};
use cullbench::geometry::{Aabb, Plane};
use cullbench::index::{
    BuildError, DynIndex, Info, Kind, MemoryUsage, Origin, Row as Structure, StructureSpec,
    indexable,
};
use cullbench::query::{AnyVolume, ItemId, Located, QueryCost};
use cullbench::stress::extremes::{CAMERA_FAMILIES, Case, Findings, PLANES_FAMILIES, camera_case};
use cullbench::stress::{Replay, Row, Status, built_in, replay};
use cullbench::verify;
use glam::Vec3;
use serde_json::Value;

/// A replacement of the plane test: returns `true` if the plane drops the box.
type Drops = fn(usize, &Plane, &Aabb) -> bool;

/// A scan that asks a plane test of its own instead of THE plane test.
struct Scan {
    items: Vec<Aabb>,
    ids: Vec<ItemId>,
    drops: Drops,
}

impl DynIndex for Scan {
    fn memory(&self) -> MemoryUsage {
        MemoryUsage::default()
    }

    fn query(&self, view: AnyVolume<'_>, out: &mut Vec<ItemId>) {
        let kept = self.ids.iter().filter(|&&id| {
            let b = &self.items[id as usize];
            match view {
                AnyVolume::Planes(volume) => {
                    let mut planes = volume.planes().iter().enumerate();
                    !planes.any(|(i, plane)| (self.drops)(i, plane, b))
                }
                other => other.sees(b),
            }
        });
        out.extend(kept);
    }

    fn query_counted(&self, view: AnyVolume<'_>, out: &mut Vec<ItemId>, _: &mut QueryCost) {
        self.query(view, out);
    }

    fn query_many(&self, points: &[Vec3], out: &mut Located) {
        out.clear();
        for &p in points {
            let mut ids = Vec::new();
            self.locate(p, &mut ids);
            out.push(&ids);
        }
    }

    fn refit(&mut self, _: &[Aabb], _: &[ItemId]) -> bool {
        false
    }
}

fn scan(items: &[Aabb], drops: Drops) -> Result<Box<dyn DynIndex>, BuildError> {
    Ok(Box::new(Scan {
        ids: indexable(items)?,
        items: items.to_vec(),
        drops,
    }))
}

fn sound(_: usize, plane: &Plane, b: &Aabb) -> bool {
    plane.excludes(b)
}

fn fused(_: usize, plane: &Plane, b: &Aabb) -> bool {
    let (n, p) = (plane.normal, plane.p_vertex(b));
    n.z.mul_add(p.z, n.y.mul_add(p.y, n.x * p.x)) + plane.d < 0.0
}

fn open(_: usize, plane: &Plane, b: &Aabb) -> bool {
    plane.value_at(plane.p_vertex(b)) <= 0.0
}

fn swapped(index: usize, plane: &Plane, b: &Aabb) -> bool {
    let n = plane.normal;
    let mirrored = Plane::new(Vec3::new(-n.x, n.y, n.z), plane.d);
    if index == 0 {
        mirrored.excludes(b)
    } else {
        plane.excludes(b)
    }
}

fn wrong_corner(_: usize, plane: &Plane, b: &Aabb) -> bool {
    let mut p = plane.p_vertex(b);
    p.y = plane.n_vertex(b).y;
    plane.value_at(p) < 0.0
}

fn flushed(_: usize, plane: &Plane, b: &Aabb) -> bool {
    let flush = |x: f32| if x.is_subnormal() { 0.0 } else { x };
    let (n, p) = (plane.normal, plane.p_vertex(b));
    let [x, y, z] = [0, 1, 2].map(|k| flush(flush(n[k]) * flush(p[k])));
    flush(flush(flush(x + y) + z) + flush(plane.d)) < 0.0
}

const fn info(name: &'static str) -> Info {
    Info::new(name, "for this test", Kind::Scan, Origin::Ours)
}

macro_rules! scan {
    ($drops:ident) => {
        Structure {
            info: info(stringify!($drops)),
            build: |_, input, _| scan(input.items, $drops),
            params: |params| Ok(params.clone()),
        }
    };
}

const SOUND: Structure = scan!(sound);
/// Each with a vector that must catch it, if one can, and a family.
const BROKEN: [(Structure, &str, &str); 5] = [
    (scan!(fused), "B01-ratio-1e3-gh", "near-far"),
    (scan!(open), "A02-touch-integer-planes", "ties"),
    (scan!(swapped), "A01-basic", "lens"),
    (scan!(wrong_corner), "A02-touch-integer-planes", "fov"),
    (scan!(flushed), "E08-ftz-false-negative", "denormals"),
];

/// Another crate's code may end the thread that it runs on.
const PANICKING: [Structure; 2] = [
    Structure {
        info: info("panics-while-building"),
        build: |_, _, _| panic!("deep in a crate"),
        params: |params| Ok(params.clone()),
    },
    Structure {
        info: info("panics-while-asked"),
        build: |_, input, _| scan(input.items, |_, _, _| panic!("deep in a crate")),
        params: |params| Ok(params.clone()),
    },
];

fn spec(row: Structure) -> StructureSpec {
    StructureSpec {
        label: row.info.name.to_owned(),
        row,
        params: Value::Null,
        execution: Default::default(),
        policy: Default::default(),
    }
}

fn failed(structure: &[StructureSpec]) -> Vec<Row> {
    let vectors = built_in().expect("part of the repository");
    let rows = vectors.iter().flat_map(|v| replay(v, structure));
    rows.filter(|row| row.status == Status::Fail).collect()
}

/// A few cases of a family, at whatever level it is.
fn findings(family: &str, structure: &[StructureSpec]) -> Vec<Findings> {
    let mut found = Vec::new();
    for family in CAMERA_FAMILIES.iter().filter(|f| f.name == family) {
        for (seed, &variant) in family.variants.iter().enumerate() {
            let case = camera_case(family, variant, seed as u64);
            found.push(case.expect("a camera").check(structure, 2000));
        }
    }
    for family in PLANES_FAMILIES.iter().filter(|f| f.name == family) {
        found.extend((0..4).map(|seed| family.check(&(family.case)(seed), structure)));
    }
    assert!(!found.is_empty(), "{family}");
    found
}

#[test]
fn a_sound_structure_passes() {
    let structure = [spec(SOUND)];
    assert_eq!(failed(&structure), []);
    for (_, _, family) in BROKEN {
        for found in findings(family, &structure) {
            assert_eq!(found.faults, [], "{family}");
        }
    }
}

#[test]
fn each_broken_structure_fails_a_vector_and_a_generated_case() {
    for (broken, vector, family) in BROKEN {
        let structure = [spec(broken)];
        let rows = failed(&structure);
        let named = |row: &&Row| {
            row.id.starts_with(vector)
                && row.structure == broken.info.name
                && row.test == "six-plane"
        };
        assert!(
            rows.iter().any(|row| named(&row)),
            "{}: {rows:?}",
            broken.info.name
        );
        let boxed = format!("{vector}/");
        assert!(
            rows.iter().any(|row| row.id.starts_with(&boxed)),
            "{}",
            broken.info.name
        );
        let found = findings(family, &structure);
        let mut faults = found.iter().flat_map(|f| &f.faults);
        let caught = faults.any(|f| f.subject[0] == broken.info.name && f.item.is_some());
        assert!(caught, "{} passes {family}", broken.info.name);
    }
}

#[test]
fn a_panic_is_a_failure_of_that_structure_alone() {
    for broken in PANICKING {
        let structures = [spec(broken), spec(SOUND)];
        let rows = failed(&structures);
        let told = |text: &str| text == "panicked: deep in a crate";
        assert!(rows.len() > 5, "{}: {rows:?}", broken.info.name);
        for row in rows {
            assert_eq!(row.structure, broken.info.name, "{row:?}");
            assert!(told(&row.got.to_string()), "{row:?}");
        }
        for family in ["near-far", PLANES_FAMILIES[0].name] {
            let faults: Vec<_> = findings(family, &structures)
                .into_iter()
                .flat_map(|f| f.faults)
                .collect();
            assert!(!faults.is_empty(), "{} passes {family}", broken.info.name);
            for fault in faults {
                assert_eq!(fault.subject[0], broken.info.name, "{family}: {fault:?}");
                assert!(told(&fault.got), "{family}: {fault:?}");
            }
        }
    }
}

#[test]
fn planes_without_a_margin_fail_vectors_and_every_family() {
    let structure = [spec(SOUND)];
    let bare = Replay {
        structures: &structure,
        planes: PlaneOptions {
            epsilon: 0.0,
            ..PlaneOptions::default()
        },
    };
    let vectors = built_in().expect("part of the repository");
    let rows = vectors.iter().flat_map(|v| bare.vector(v));
    let failed: Vec<Row> = rows.filter(|row| row.status == Status::Fail).collect();
    let boxes = failed
        .iter()
        .filter(|row| row.got.to_string().starts_with("dropped"));
    assert!(boxes.count() > 5, "{failed:?}");
    for family in CAMERA_FAMILIES {
        let caught = family.variants.iter().any(|&variant| {
            (0..30).any(|seed| {
                let case = camera_case(family, variant, seed);
                let mut case = case.expect("a camera");
                case.planes.epsilon = 0.0;
                let faults = case.check(&[], 0).faults;
                faults.iter().any(|fault| fault.subject[1] == "six-plane")
            })
        });
        assert!(caught, "{}", family.name);
    }
}

/// The suite reports items that a wrong camera loses or gains.
#[test]
fn a_view_that_is_a_little_off_drops_boxes() {
    let family = &CAMERA_FAMILIES[0];
    let case = |seed| camera_case(family, 1e3, seed).expect("a camera");
    let view = |case: &Case, change: fn(&mut Case)| {
        let mut other = camera_case(family, 1e3, 3).expect("a camera");
        change(&mut other);
        let culling = Culling {
            test: CullingTest::SixPlane,
            ..Culling::default()
        };
        let view = culling.view(&other.camera, &case.around).expect("planes");
        let seen: Vec<ItemId> = verify::scan(&case.items, |b| view.as_any().sees(b)).collect();
        case.errors(&seen)
    };
    let case = case(3);
    let right = view(&case, |_| {});
    assert_eq!((right.false_negatives, right.touch_dropped), (0, 0));
    let turned = view(&case, |other| other.camera.frame.yaw(1e-3));
    assert!(
        turned.false_negatives > 10 && turned.worst_miss > 0.0,
        "{turned:?}"
    );
    let nearer = view(&case, |other| {
        let far = other.camera.lens.far().map(|far| far * 0.9999);
        other.camera.lens = other.camera.lens.with_far(far).expect("a lens");
    });
    assert!(nearer.false_negatives > 0, "{nearer:?}");
}
