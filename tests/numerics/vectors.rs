//! The test vectors of `datasets/vectors.json`, whose answers come from exact
//! rational arithmetic: at planes level the volume and every structure must
//! give the recorded f32 answer bit for bit, at camera level the default
//! pipeline must not drop anything that is visible. Point location and what
//! must be refused come from there too.

use std::collections::BTreeSet;

use super::by_hand::{Kind, Setup};
use cullbench::camera::{Camera, CameraError, Lens, PlaneOptions, Surroundings, look_at};
use cullbench::geometry::{Aabb, ConvexVolume, Plane, VolumeError};
use cullbench::index::{BuildError, DynIndex, Execution, Registry, StructureSpec};
use cullbench::kernel::Kernel;
use cullbench::query::{ItemId, QueryCost};
use glam::{DVec3, Vec3};
use serde_json::Value;

struct Vector(Value);

/// A JSON number, or one of the words for what JSON cannot say.
fn number(value: &Value) -> f64 {
    match value.as_str() {
        None => value.as_f64().expect("a number"),
        Some("NaN") => f64::NAN,
        Some("Infinity" | "inf") => f64::INFINITY,
        Some("-Infinity" | "-inf") => f64::NEG_INFINITY,
        Some(other) => panic!("'{other}' is no number"),
    }
}

fn numbers(value: &Value) -> DVec3 {
    let all: Vec<f64> = value.as_array().unwrap().iter().map(number).collect();
    DVec3::from_slice(&all)
}

/// The file's box and plane numbers are f32 values.
fn exact_f32(value: &Value) -> Vec3 {
    let wide = numbers(value);
    let narrow = wide.as_vec3();
    for axis in 0..3 {
        let (x, exact) = (f64::from(narrow[axis]), wide[axis]);
        // serde_json's decimals may be off by the last bit of an f64.
        assert!(
            x == exact || exact.is_nan() || (x / exact - 1.0).abs() < 1e-15,
            "{exact:e} is no f32"
        );
    }
    narrow
}

fn strings(value: &Value) -> BTreeSet<String> {
    let all = value.as_array().into_iter().flatten();
    all.map(|s| s.as_str().unwrap().to_owned()).collect()
}

impl Vector {
    fn id(&self) -> &str {
        self.0["id"].as_str().unwrap()
    }

    fn has(&self, field: &str) -> bool {
        self.0.get(field).is_some()
    }

    fn set(&self, field: &str) -> BTreeSet<String> {
        assert!(self.has(field), "{} has no {field}", self.id());
        strings(&self.0[field])
    }

    /// All boxes with their names, those to be rejected as well.
    fn boxes(&self) -> Vec<(String, Aabb)> {
        let boxes = self.0["boxes"].as_array().unwrap().iter();
        boxes
            .map(|b| {
                let bounds = Aabb::new(exact_f32(&b["lo"]), exact_f32(&b["hi"]));
                (b["id"].as_str().unwrap().to_owned(), bounds)
            })
            .collect()
    }

    /// The boxes that a scene may hold.
    fn sound_boxes(&self) -> Vec<(String, Aabb)> {
        let rejected = strings(&self.0["expect_rejected_at_load"]);
        let mut boxes = self.boxes();
        boxes.retain(|(name, _)| !rejected.contains(name));
        boxes
    }

    /// The planes bit for bit.
    fn planes(&self) -> Vec<Plane> {
        let bits = |text: &Value| {
            let digits = text.as_str().unwrap().strip_prefix("0x").unwrap();
            f32::from_bits(u32::from_str_radix(digits, 16).unwrap())
        };
        let rows = self.0["planes_f32_hex"].as_array().unwrap();
        rows.iter()
            .map(|row| {
                let [x, y, z, d] = [0, 1, 2, 3].map(|i| bits(&row[i]));
                Plane::new(Vec3::new(x, y, z), d)
            })
            .collect()
    }

    /// The camera as stated, and what the crate makes of it.
    fn camera(&self) -> (Setup, Result<Camera, CameraError>) {
        let c = &self.0["camera"];
        let far = number(&c["far"]);
        let kind = Kind::Perspective {
            fovy_deg: number(&c["fovy_deg"]),
            aspect: number(&c["aspect"]),
        };
        let setup = Setup {
            eye: numbers(&c["eye"]),
            look: numbers(&c["look"]),
            up: numbers(&c["up"]),
            kind,
            near: number(&c["near"]),
            far: far.is_finite().then_some(far),
        };
        let Kind::Perspective { fovy_deg, aspect } = kind else {
            unreachable!("just made");
        };
        let camera = look_at(setup.eye, setup.look, setup.up).and_then(|frame| {
            let lens = Lens::perspective(fovy_deg, aspect, setup.near, setup.far)?;
            Ok(Camera { frame, lens })
        });
        (setup, camera)
    }
}

fn vectors() -> Vec<Vector> {
    let file: Value = serde_json::from_str(include_str!("../../datasets/vectors.json")).unwrap();
    assert_eq!(file["format"], 1);
    let vectors = file["vectors"].as_array().unwrap();
    assert_eq!(file["count"], vectors.len());
    vectors.iter().cloned().map(Vector).collect()
}

fn structures(kernel: Kernel, items: &[Aabb]) -> Vec<(&'static str, Box<dyn DynIndex>)> {
    let registry = Registry::builtin();
    let named = registry.rows().iter().map(|row| row.info.name);
    named
        .map(|name| {
            let spec = StructureSpec::parse(name).unwrap();
            let built = spec.by(Execution { kernel, threads: 1 }).build(items);
            (name, built.unwrap_or_else(|e| panic!("{name}: {e}")))
        })
        .collect()
}

fn split(boxes: Vec<(String, Aabb)>) -> (Vec<String>, Vec<Aabb>) {
    boxes.into_iter().unzip()
}

/// The names of an answer, each of which may come only once.
fn named(names: &[String], ids: &[ItemId], what: &str) -> BTreeSet<String> {
    let found: BTreeSet<String> = ids.iter().map(|&id| names[id as usize].clone()).collect();
    assert_eq!(found.len(), ids.len(), "{what}: an id came twice: {ids:?}");
    found
}

/// Panics with the missing and the extra ids if two sets differ.
fn check_equal(what: &str, found: &BTreeSet<String>, wanted: &BTreeSet<String>) {
    let missing: Vec<_> = wanted.difference(found).collect();
    let extra: Vec<_> = found.difference(wanted).collect();
    assert!(
        missing.is_empty() && extra.is_empty(),
        "{what}: missing {missing:?}, too much {extra:?}"
    );
}

/// Asks the volume box by box and every structure, counted and not.
fn answers(
    kernel: Kernel,
    id: &str,
    names: &[String],
    items: &[Aabb],
    volume: &ConvexVolume,
) -> Vec<(String, BTreeSet<String>)> {
    let mut all = Vec::new();
    let seen = items.iter().zip(names).filter(|(b, _)| volume.sees(b));
    let seen = seen.map(|(_, name)| name.clone()).collect();
    all.push((format!("{id}, ConvexVolume::sees"), seen));
    for (name, structure) in structures(kernel, items) {
        let what = format!("{id}, {name}");
        let (mut plain, mut counted) = (Vec::new(), Vec::new());
        structure.visible(volume, &mut plain);
        structure.query_counted(volume.into(), &mut counted, &mut QueryCost::default());
        assert_eq!(plain, counted, "{what}: counting changed the answer");
        let found = named(names, &plain, &what);
        all.push((what, found));
    }
    all
}

#[test]
fn given_planes_see_exactly_the_recorded_boxes() {
    let mut asked = 0;
    for vector in vectors().iter().filter(|v| v.has("planes_f32_hex")) {
        let id = vector.id();
        let volume = ConvexVolume::from_planes(&vector.planes());
        if vector.has("expect_planes_error") {
            assert!(
                matches!(volume, Err(VolumeError::NotFinite { .. })),
                "{id}: {volume:?}"
            );
            continue;
        }
        let volume = volume.unwrap_or_else(|error| panic!("{id}: {error}"));
        let wanted = vector.set("observed_f32_pvertex_mul_add");
        let (names, items) = split(vector.sound_boxes());
        // Some of the vectors come out otherwise where products and sums are
        // fused, as an instruction set might offer to.
        for kernel in Kernel::available() {
            for (what, found) in answers(kernel, id, &names, &items, &volume) {
                check_equal(&format!("{what}, {kernel}"), &found, &wanted);
                asked += 1;
            }
        }
    }
    let kernels = Kernel::available().count();
    assert!(
        asked >= 48 * kernels * (1 + Registry::builtin().rows().len()),
        "only {asked} answers"
    );
}

#[test]
fn the_planes_in_decimal_are_the_planes_in_hexadecimal() {
    for vector in vectors().iter().filter(|v| v.has("planes")) {
        let decimal = vector.0["planes"].as_array().unwrap();
        for (row, plane) in decimal.iter().zip(vector.planes()) {
            let hex = plane.normal.extend(plane.d).to_array();
            for (value, hex) in row.as_array().unwrap().iter().zip(hex) {
                let value = number(value) as f32;
                let same = value.to_bits() == hex.to_bits() || value.is_nan() && hex.is_nan();
                assert!(same, "{}: {value} is not {hex}", vector.id());
            }
        }
    }
}

#[test]
fn bounds_that_are_not_finite_are_refused_by_name() {
    let mut refused = 0;
    for vector in vectors()
        .iter()
        .filter(|v| v.has("expect_rejected_at_load"))
    {
        let (names, items) = split(vector.boxes());
        let rejected = vector.set("expect_rejected_at_load");
        let first = names.iter().position(|n| rejected.contains(n)).unwrap();
        // Each bad box by itself behind all the sound ones, and all together.
        let (_, sound) = split(vector.sound_boxes());
        let mut scenes = vec![(items.clone(), first)];
        for (name, &b) in names.iter().zip(&items) {
            if rejected.contains(name) {
                let mut scene = sound.clone();
                scene.push(b);
                scenes.push((scene, sound.len()));
            }
        }
        for (scene, wanted) in &scenes {
            for row in Registry::builtin().rows() {
                let what = format!("{}, {}, {scene:?}", vector.id(), row.info.name);
                let spec = StructureSpec::parse(row.info.name).unwrap();
                let Some(error) = spec.build(scene).err() else {
                    panic!("{what}: built");
                };
                let named = error.to_string().contains(&format!("item {wanted} "));
                assert!(named, "{what}: {error}");
                let BuildError::NonFiniteItem { item, .. } = error else {
                    panic!("{what}: {error}");
                };
                assert_eq!(item, *wanted, "{what}");
                refused += 1;
            }
        }
    }
    assert!(refused >= 3 * Registry::builtin().rows().len());
}

#[test]
fn empty_boxes_are_never_returned() {
    let mut met = 0;
    for vector in vectors().iter().filter(|v| v.has("expect_empty_boxes")) {
        let (names, items) = split(vector.sound_boxes());
        let empty = vector.set("expect_empty_boxes");
        let everything = ConvexVolume::from_planes(&[]).unwrap();
        let given = ConvexVolume::from_planes(&vector.planes()).unwrap();
        for volume in [everything, given] {
            for (what, found) in answers(Kernel::best(), vector.id(), &names, &items, &volume) {
                assert!(found.is_disjoint(&empty), "{what} returns {found:?}");
                met += 1;
            }
        }
        for (name, structure) in structures(Kernel::best(), &items) {
            for b in items.iter().filter(|b| b.is_empty()) {
                let mut ids = Vec::new();
                structure.locate(b.centre(), &mut ids);
                let found = named(&names, &ids, name);
                assert!(found.is_disjoint(&empty), "{name} locates {found:?}");
            }
        }
    }
    assert!(met > 0);
}

/// How far the whole box lies outside the camera's volume by one plane alone,
/// in f64 and by hand; negative if no plane excludes it.
fn excluded_by(setup: &Setup, b: &Aabb) -> f64 {
    let view = setup.view();
    let outside = view.faces().iter().map(|&face| {
        let corners = (0..8).map(|i| b.corner(i).as_dvec3());
        let deepest = corners.map(|corner| view.inside(face, corner));
        -deepest.fold(f64::NEG_INFINITY, f64::max)
    });
    outside.fold(f64::NEG_INFINITY, f64::max)
}

#[test]
fn the_default_pipeline_drops_nothing_that_the_camera_sees() {
    let (mut cameras, mut refused) = (0, 0);
    for vector in vectors().iter().filter(|v| v.has("camera")) {
        let id = vector.id();
        let (setup, camera) = vector.camera();
        if vector.has("expect_camera_error") {
            assert!(camera.is_err(), "{id} is a camera: {camera:?}");
            refused += 1;
            continue;
        }
        let wanted = vector.set("expected_visible_camera");
        let camera = match camera {
            Ok(camera) => camera,
            // near > far: refusing the lens is seeing nothing.
            Err(error) if error.to_string().ends_with("expected near < far") => {
                assert!(wanted.is_empty(), "{id} was refused but sees {wanted:?}");
                refused += 1;
                continue;
            }
            Err(error) => panic!("{id}: {error}"),
        };
        let (names, items) = split(vector.sound_boxes());
        let around = Surroundings {
            origin: DVec3::ZERO,
            reach: Aabb::union_of(&items).reach(),
        };
        let volume = camera.volume(&PlaneOptions::default(), &around);
        let volume = volume.unwrap_or_else(|error| panic!("{id}: {error}"));
        for (what, found) in answers(Kernel::best(), id, &names, &items, &volume) {
            let dropped: Vec<_> = wanted.difference(&found).collect();
            assert!(dropped.is_empty(), "{what} drops {dropped:?}");
            // More may come, but not what lies far beyond a plane.
            for (name, b) in names.iter().zip(&items).filter(|(n, _)| found.contains(*n)) {
                let size = (b.reach().as_dvec3() + setup.eye.abs()).element_sum()
                    + setup.far.unwrap_or(around.reach.as_dvec3().element_sum());
                let excluded = excluded_by(&setup, b);
                assert!(
                    excluded <= 1e-5 * size,
                    "{what} returns {name}, which lies {excluded} beyond a plane"
                );
            }
        }
        cameras += 1;
    }
    assert!(cameras >= 40 && refused >= 5, "{cameras} and {refused}");
}

#[test]
fn points_are_located_in_the_closed_boxes() {
    let mut located = 0;
    for vector in vectors().iter().filter(|v| v.has("points")) {
        let (names, items) = split(vector.sound_boxes());
        let structures = structures(Kernel::best(), &items);
        for point in vector.0["points"].as_array().unwrap() {
            let p = exact_f32(&point["p"]);
            let wanted = strings(&point["expected_containing"]);
            for (name, structure) in &structures {
                let what = format!("{}, point {}, {name}", vector.id(), point["id"]);
                let (mut plain, mut counted) = (Vec::new(), Vec::new());
                structure.locate(p, &mut plain);
                structure.query_counted(p.into(), &mut counted, &mut QueryCost::default());
                assert_eq!(plain, counted, "{what}: counting changed the answer");
                check_equal(&what, &named(&names, &plain, &what), &wanted);
                located += 1;
            }
        }
    }
    assert!(
        located >= 12 * Registry::builtin().rows().len(),
        "only {located} points"
    );
}
