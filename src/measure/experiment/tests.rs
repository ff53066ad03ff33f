//! Shards, keys, and the share of one process.

use super::super::Group;
use super::*;
use crate::index::Registry;

fn planned(source: &str, paths: &[&str], cold: bool) -> PlannedScene {
    PlannedScene {
        cold,
        ..PlannedScene::new(source, paths)
    }
}

fn plan() -> Plan {
    let sphere = Culling {
        test: CullingTest::Sphere,
        ..Culling::default()
    };
    Plan {
        scenes: vec![
            planned("city:n=100", &["orbit:frames=8", "spin"], true),
            planned("uniform:n=50", &["outside:frames=4"], false),
            planned("city:n=200", &["orbit:frames=8", "spin", "zoom"], false),
        ],
        structures: Registry::builtin().structures("linear,bvh,octree").unwrap(),
        cullings: vec![sphere, Culling::default()],
        lens: LensDefaults::default(),
        motions: Vec::new(),
        views_per_frame: 1,
        load: LoadOptions::default(),
        effort: Effort {
            processes: 1,
            rounds: [1, 1],
            task_ns: 1e4,
            pass_ns: 1e4,
            extras: Extras::All,
        },
        bounds: false,
        seed: 1,
    }
}

#[test]
fn shards_are_the_plan_and_leave_what_is_compared_together() {
    let whole = plan();
    let cells = whole.cells();
    // (2 paths x 2 caches + 1 + 3 paths) x 2 tests x 3 structures.
    assert_eq!(cells.len(), 8 * 2 * 3);
    for n in 1..=8 {
        let shards: Vec<Vec<CellKey>> =
            (1..=n).map(|i| whole.clone().shard(i, n).cells()).collect();
        let of_pair = |cell: &CellKey, other: &CellKey| {
            (&cell.group.scene, &cell.group.path) == (&other.group.scene, &other.group.path)
        };
        for cell in &cells {
            let holding = shards.iter().filter(|shard| shard.contains(cell));
            let holding: Vec<_> = holding.collect();
            assert_eq!(holding.len(), 1, "{cell:?} in {n} shards");
            let together = cells.iter().filter(|other| of_pair(cell, other));
            assert!(together.clone().all(|other| holding[0].contains(other)));
        }
        let sum: usize = shards.iter().map(Vec::len).sum();
        assert_eq!(sum, cells.len(), "nothing twice in {n} shards");
    }
    // Six pairs: the seventh of seven shards is empty.
    assert!(whole.clone().shard(7, 7).scenes.is_empty());
}

#[test]
fn keys_are_told_apart_and_structures_built_twice_at_most() {
    let plan = plan();
    let cells = plan.cells();
    for (n, cell) in cells.iter().enumerate() {
        assert!(!cells[..n].contains(cell), "{cell:?} comes twice");
    }
    for scene in &plan.scenes {
        let groups = plan.groups_of(scene);
        let mut spheres = groups
            .iter()
            .map(|group| group.1.test == CullingTest::Sphere);
        let first = spheres.position(|is_sphere| is_sphere);
        assert!(first.is_some_and(|first| first > 0));
        assert!(spheres.all(|is_sphere| is_sphere), "boxes after spheres");
    }
}

#[test]
fn one_process_has_the_cells_of_the_plan_in_its_order() {
    let plan = plan();
    let mut groups = Vec::new();
    let all_of = |planned: &PlannedScene| Share::first(plan.groups_of(planned).len());
    for planned in &plan.scenes {
        let mut keep = |part: Part, _| groups.push((part.key.clone(), Group::of(&[part])));
        let share = all_of(planned);
        measure_scene(&plan, planned, &share, &mut keep, &|_, _| ()).unwrap();
    }
    let found = groups.iter().flat_map(|(key, group)| {
        group.cells.iter().map(|cell| CellKey {
            group: key.clone(),
            structure: cell.structure.clone(),
        })
    });
    assert!(found.eq(plan.cells()));
    for (_, group) in &groups {
        assert!(group.twin.as_ref().is_some_and(|t| t.structure == "bvh"));
        for cell in &group.cells {
            assert_eq!(cell.status, super::super::Status::Ok);
        }
    }
}

/// Structures of a share in the order of their builds, and its parts.
fn measured(plan: &Plan, share: &Share) -> (Vec<String>, Vec<Part>) {
    let building = std::cell::RefCell::new(Vec::new());
    let notice = |structure: Option<&str>, step: &str| {
        if let (Some(structure), "building") = (structure, step) {
            building.borrow_mut().push(structure.to_owned());
        }
    };
    let mut parts = Vec::new();
    let mut keep = |part: Part, _| parts.push(part);
    measure_scene(plan, &plan.scenes[0], share, &mut keep, &notice).unwrap();
    (building.into_inner(), parts)
}

#[test]
fn what_has_ended_a_process_is_not_built_again() {
    let mut plan = plan();
    plan.scenes.truncate(1);
    let verdict = Verdict::new(super::super::Status::OutOfMemory, "while building");
    let mut share = Share::first(plan.groups_of(&plan.scenes[0]).len());
    share.failed.insert("bvh".to_owned(), verdict.clone());
    let (building, parts) = measured(&plan, &share);
    assert!(!building.contains(&"bvh".to_owned()));
    for part in &parts {
        let own = part.subjects.iter().find(|s| s.label == "bvh");
        assert_eq!(own.map(|s| &s.verdict), Some(&verdict));
        assert!(part.tasks.iter().all(|t| !t.label.starts_with("bvh")));
    }
}

#[test]
fn another_process_builds_in_another_order_and_keeps_that_of_the_plan() {
    let mut plan = plan();
    plan.scenes.truncate(1);
    let share = Share {
        process: 1,
        ..Share::first(plan.groups_of(&plan.scenes[0]).len())
    };
    let (building, parts) = measured(&plan, &share);
    assert_eq!(building[..4], ["bvh", "octree", "bvh", "linear"]);
    for part in &parts {
        let labels = part.subjects.iter().map(|s| s.label.as_str());
        assert!(labels.eq(["linear", "bvh", "octree", "bvh#twin"]));
    }
}
