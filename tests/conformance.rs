//! What every structure must do, on scenes made to be unpleasant: the exact
//! reference set, each id once, and the properties that follow from the
//! contract. New structures are picked up from the table.

use cullbench::camera::PlaneOptions;
use cullbench::geometry::{Aabb, ConvexVolume, Plane};
use cullbench::index::{BACKENDS, DynIndex, StructureSpec};
use cullbench::measure::Workload;
use cullbench::path::{self, LensDefaults};
use cullbench::query::{Containment, NoRecorder, Region};
use cullbench::scene;
use cullbench::verify::{RandomCase, Reference};
use glam::Vec3;
use proptest::prelude::*;

fn build(name: &str, items: &[Aabb]) -> Box<dyn DynIndex> {
    let spec = StructureSpec::parse(name).expect(name);
    spec.build(items).expect(name)
}

fn visible(index: &dyn DynIndex, volume: &ConvexVolume) -> Vec<u32> {
    let mut ids = Vec::new();
    index.visible(volume, &mut ids);
    ids.sort_unstable();
    ids
}

fn cube(x: f32, y: f32, z: f32, half: f32) -> Aabb {
    Aabb::around(Vec3::new(x, y, z), Vec3::splat(half))
}

/// Scenes at the edge of what a structure may meet.
fn edge_scenes() -> Vec<(&'static str, Vec<Aabb>)> {
    let line = |n: u16, scale: f32| -> Vec<Aabb> {
        (0..n)
            .map(|i| cube(f32::from(i) * scale, 0.0, 0.0, 0.4 * scale))
            .collect()
    };
    let needle = |i: u16| {
        let at = f32::from(i) * 0.01;
        Aabb::new(Vec3::new(-1e3, at, -at), Vec3::new(1e3, at, -at))
    };
    let everything = Aabb::new(Vec3::splat(-1e6), Vec3::splat(1e6));
    vec![
        ("empty", vec![]),
        ("one", vec![cube(0.0, 0.0, 0.0, 1.0)]),
        ("one point", vec![Aabb::new(Vec3::ZERO, Vec3::ZERO)]),
        ("two", line(2, 1.0)),
        ("all the same", vec![cube(1.0, 2.0, 3.0, 0.5); 3000]),
        (
            "all the same point",
            vec![Aabb::new(Vec3::ONE, Vec3::ONE); 3000],
        ),
        ("collinear", line(1000, 1.0)),
        (
            "coplanar",
            (0..900u16)
                .map(|i| {
                    let (x, y) = (f32::from(i % 30), f32::from(i / 30));
                    Aabb::new(Vec3::new(x, y, 2.0), Vec3::new(x + 1.0, y + 1.0, 2.0))
                })
                .collect(),
        ),
        ("needles", (0..500).map(needle).collect()),
        (
            "huge and tiny",
            line(200, 1e30)
                .into_iter()
                .chain(line(200, 1e-30))
                .collect(),
        ),
        ("subnormal", line(100, f32::from_bits(64))),
        ("near the largest float", line(100, 1e36)),
        (
            "far away",
            (0..500u16)
                .map(|i| cube(1e7 + f32::from(i), 1e7, -1e7, 1.0))
                .collect(),
        ),
        (
            "everything overlaps",
            vec![everything; 50]
                .into_iter()
                .chain(line(500, 1.0))
                .collect(),
        ),
        (
            "inverted among sound",
            line(300, 1.0)
                .into_iter()
                .enumerate()
                .map(|(i, b)| {
                    if i % 3 == 0 {
                        Aabb::new(b.max, b.min)
                    } else {
                        b
                    }
                })
                .collect(),
        ),
        ("only inverted", vec![Aabb::new(Vec3::ONE, Vec3::ZERO); 10]),
    ]
}

/// Half-spaces, slabs and wedges through the scene, touching boxes exactly
/// where they can.
fn volumes(items: &[Aabb]) -> Vec<ConvexVolume> {
    let bounds = Aabb::union_of(items);
    let bounds = if bounds.is_empty() {
        cube(0.0, 0.0, 0.0, 1.0)
    } else {
        bounds
    };
    let mut sets: Vec<Vec<Plane>> = vec![vec![], vec![Plane::new(Vec3::ZERO, -1.0)]];
    for axis in [Vec3::X, Vec3::Y, Vec3::Z, Vec3::new(0.3, -0.5, 0.8)] {
        let anchors = items
            .iter()
            .take(3)
            .map(|b| b.max)
            .chain([bounds.centre(), bounds.max]);
        for anchor in anchors {
            let low = Plane::new(axis, -axis.dot(anchor));
            let high = Plane::new(-axis, axis.dot(anchor));
            sets.extend([vec![low], vec![high], vec![low, high]]);
        }
    }
    sets.iter()
        .filter_map(|planes| ConvexVolume::from_planes(planes).ok())
        .collect()
}

#[test]
fn every_structure_returns_the_reference_set_on_edge_scenes() {
    for (scene, items) in edge_scenes() {
        let mut reference = Reference::new(items.len());
        for backend in BACKENDS {
            let index = build(backend.name, &items);
            for (i, volume) in volumes(&items).iter().enumerate() {
                reference.see(&items, volume);
                let mut found = Vec::new();
                index.visible(volume, &mut found);
                let difference = reference.compare(&found);
                assert!(
                    difference.is_none(),
                    "{} on '{scene}', volume {i}: {difference}",
                    backend.name
                );
            }
            for p in items
                .iter()
                .take(20)
                .flat_map(|b| [b.min, b.max, b.centre()])
            {
                let wanted = items.iter().zip(0..).filter(|(b, _)| b.contains_point(p));
                reference.expect(wanted.map(|(_, id)| id));
                let mut found = Vec::new();
                index.locate(p, &mut found);
                let difference = reference.compare(&found);
                assert!(
                    difference.is_none(),
                    "{} on '{scene}' at {p}: {difference}",
                    backend.name
                );
            }
        }
    }
}

#[test]
fn every_structure_returns_the_reference_set_on_every_scene_and_path() {
    let families = scene::FAMILIES.iter().map(|f| format!("{}:n=2000", f.name));
    let samples = scene::SAMPLES.iter().map(|s| s.name.to_owned());
    for source in families.chain(samples) {
        let scene = scene::load(&source, &Default::default()).expect(&source);
        let built: Vec<_> = BACKENDS
            .iter()
            .map(|b| build(b.name, &scene.items))
            .collect();
        let regions: Vec<_> = BACKENDS
            .iter()
            .map(|b| build(b.name, scene.regions.boxes(&scene.items)))
            .collect();
        for path in [
            "orbit:frames=6",
            "flythrough:frames=12",
            "teleport:frames=12",
            "outside:frames=2",
            "zoom:frames=4,far=inf",
        ] {
            let cameras = path::load(path, &scene, &LensDefaults::default()).expect(path);
            let workload = Workload::new(&scene, &cameras, &PlaneOptions::default()).expect(path);
            let mut reference = Reference::new(scene.items.len());
            for volume in &workload.volumes {
                reference.see(&scene.items, volume);
                for (index, backend) in built.iter().zip(BACKENDS) {
                    let mut found = Vec::new();
                    index.visible(volume, &mut found);
                    let difference = reference.compare(&found);
                    assert!(
                        difference.is_none(),
                        "{} on {source}, {path}: {difference}",
                        backend.name
                    );
                }
            }
            for &p in &workload.points {
                let wanted = scene.regions.holding(p, &scene.items);
                for (index, backend) in regions.iter().zip(BACKENDS) {
                    let mut found = Vec::new();
                    index.locate(p, &mut found);
                    scene.regions.refine(p, &mut found);
                    found.sort_unstable();
                    assert_eq!(found, wanted, "{} on {source} at {p}", backend.name);
                }
            }
        }
    }
}

#[test]
fn memory_and_counters_fit_the_items() {
    let scene = scene::load("uniform:n=5000", &Default::default()).expect("uniform");
    let nothing = ConvexVolume::from_planes(&[Plane::new(Vec3::X, -1e9)]).expect("a plane");
    for backend in BACKENDS {
        let index = build(backend.name, &scene.items);
        assert!(index.memory().item_bytes >= 5000 * 28, "{}", backend.name);
        let (mut out, mut cost) = (Vec::new(), Default::default());
        index.visible_counted(&nothing, &mut out, &mut cost);
        assert!(out.is_empty());
        let most = if backend.name.starts_with("linear") {
            5000
        } else {
            1
        };
        assert_eq!(
            cost.comparisons(),
            most,
            "{}: one look is enough for a tree",
            backend.name
        );
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(64))]

    #[test]
    fn random_cases_agree(seed in any::<u64>()) {
        let case = RandomCase::new(seed);
        let mut reference = Reference::new(case.items.len());
        for backend in BACKENDS {
            let index = build(backend.name, &case.items);
            reference.see(&case.items, &case.volume);
            let mut found = Vec::new();
            index.visible(&case.volume, &mut found);
            prop_assert!(reference.compare(&found).is_none(), "{}", backend.name);
            found.clear();
            index.locate(case.point, &mut found);
            reference.expect(scene::Regions::Items.holding(case.point, &case.items).into_iter());
            prop_assert!(reference.compare(&found).is_none(), "{}", backend.name);
        }
    }

    #[test]
    fn the_order_of_the_items_changes_nothing(seed in any::<u64>(), shift in 1..500usize) {
        let case = RandomCase::new(seed);
        let n = case.items.len();
        let mut turned = case.items.clone();
        if n > 0 {
            turned.rotate_left(shift % n);
        }
        for backend in BACKENDS {
            let here = visible(build(backend.name, &case.items).as_ref(), &case.volume);
            let there = visible(build(backend.name, &turned).as_ref(), &case.volume);
            let mut mapped: Vec<u32> =
                there.iter().map(|&id| ((id as usize + shift % n) % n) as u32).collect();
            mapped.sort_unstable();
            prop_assert_eq!(&here, &mapped, "{}", backend.name);
        }
    }

    #[test]
    fn a_smaller_volume_sees_a_subset(seed in any::<u64>()) {
        let case = RandomCase::new(seed);
        let more = RandomCase::new(seed.wrapping_add(1));
        let planes: Vec<Plane> = case.volume.planes().iter().chain(more.volume.planes()).copied().take(32).collect();
        let smaller = ConvexVolume::from_planes(&planes).expect("finite planes");
        for backend in BACKENDS {
            let index = build(backend.name, &case.items);
            let (large, small) = (visible(index.as_ref(), &case.volume), visible(index.as_ref(), &smaller));
            prop_assert!(small.iter().all(|id| large.binary_search(id).is_ok()), "{}", backend.name);
        }
    }

    #[test]
    fn inside_means_all_items_and_outside_none(seed in any::<u64>()) {
        let case = RandomCase::new(seed);
        let bounds = Aabb::union_of(&case.items);
        if bounds.is_empty() {
            return Ok(());
        }
        let (verdict, _) = case.volume.classify(&bounds, case.volume.start(), &mut NoRecorder);
        let sound = case.items.iter().filter(|b| !b.is_empty()).count();
        for backend in BACKENDS {
            let found = visible(build(backend.name, &case.items).as_ref(), &case.volume).len();
            match verdict {
                Containment::Inside => prop_assert_eq!(found, sound),
                Containment::Outside => prop_assert_eq!(found, 0),
                Containment::Straddles => {}
            }
        }
    }

    #[test]
    fn building_again_gives_the_same_structure(seed in any::<u64>()) {
        let case = RandomCase::new(seed);
        for backend in BACKENDS {
            // Unsorted: the order of answers is the structure's own and must
            // repeat as well.
            let (mut first, mut second) = (Vec::new(), Vec::new());
            build(backend.name, &case.items).visible(&case.volume, &mut first);
            build(backend.name, &case.items).visible(&case.volume, &mut second);
            prop_assert_eq!(first, second, "{}", backend.name);
        }
    }
}
