//! Processes after the first: comparisons, and the given schedule.

use super::*;
use crate::culling::{Culling, CullingTest};
use crate::index::Registry;
use crate::path;
use crate::scene::{self, Scene};

fn protocol() -> Protocol {
    Protocol {
        rounds: [2, 2],
        task_ns: 1e5,
        cameras: 8,
        cold: false,
        seed: 1,
        cache_bytes: 1 << 20,
    }
}

fn scene() -> Scene {
    scene::load("city:n=300", &Default::default()).expect("a scene")
}

fn workload(scene: &Scene) -> Workload<'_> {
    let way = path::load("orbit:frames=8", scene, &Default::default()).expect("a path");
    Workload::new(scene, &way, &Culling::default()).expect("a workload")
}

fn subjects(names: &str, scene: &Scene) -> Vec<Subject> {
    let specs = Registry::builtin().structures(names).expect("structures");
    let build = |spec| Subject::build(spec, false, scene, CullingTest::SixPlane);
    specs.into_iter().map(build).collect()
}

fn measured(names: &str, process: u32, known: Option<&ReferenceResults>, plan_only: bool) -> Part {
    let scene = scene();
    let (workload, subjects) = (workload(&scene), subjects(names, &scene));
    let info = SceneInfo::of(&scene);
    let plan = GroupPlan {
        process,
        known,
        plan_only,
        ..GroupPlan::new(&workload, &info, protocol())
    };
    queries(&workload, &subjects, plan).0
}

fn statuses(part: &Part) -> Vec<(&str, Status)> {
    let subjects = part.subjects.iter();
    subjects
        .map(|s| (s.label.as_str(), s.verdict.status))
        .collect()
}

#[test]
fn a_later_process_keeps_to_the_plan_of_the_first() {
    let first = measured("linear,bvh", 0, None, false);
    let known = first.known.as_ref().expect("the first process plans");
    assert_eq!(known.visible.len(), 8);
    let second = measured("linear,bvh", 1, Some(known), false);
    assert_eq!(second.known, None);
    assert_eq!(
        statuses(&second),
        [("linear", Status::Ok), ("bvh", Status::Ok)]
    );
    let names = |part: &Part| -> Vec<(String, TaskKind)> {
        let tasks = part.tasks.iter();
        tasks.map(|t| (t.label.clone(), t.task)).collect()
    };
    assert_eq!(names(&first), names(&second));
    // The first process alone counts.
    assert!(!first.subjects[1].counts.is_empty() && second.subjects[1].counts.is_empty());
}

#[test]
fn a_process_that_only_plans_times_nothing() {
    let part = measured("linear,bvh", 0, None, true);
    assert!(part.tasks.is_empty());
    let known = part.known.expect("a plan");
    assert_eq!(known.query.map(|plan| plan.keys.len()), Some(2));
    assert_eq!(known.locate.map(|plan| plan.keys.len()), Some(4));
}

#[test]
fn an_answer_of_another_digest_is_wrong() {
    let first = measured("linear,bvh", 0, None, true);
    let known = first.known.expect("a plan");
    let of = |change: &dyn Fn(&mut ReferenceResults)| {
        let mut stale = known.clone();
        change(&mut stale);
        let part = measured("linear,bvh", 1, Some(&stale), false);
        let reason = part.subjects[1].verdict.reason.clone().unwrap_or_default();
        let all_wrong = part
            .subjects
            .iter()
            .all(|s| s.verdict.status == Status::Wrong);
        assert!(all_wrong, "{:?}", statuses(&part));
        assert!(part.tasks.is_empty(), "what is wrong is not timed");
        reason
    };
    let reason = of(&|known| known.visible[5].digest ^= 1);
    assert!(reason.starts_with("camera 5: "), "{reason}");
    let reason = of(&|known| known.visible[3].count += 1);
    assert!(reason.starts_with("camera 3: "), "{reason}");
    let reason = of(&|known| known.located[2].digest ^= 1);
    assert!(reason.starts_with("point 2: "), "{reason}");
    // Answers for fewer cameras than there are.
    let reason = of(&|known| known.visible.truncate(6));
    assert!(reason.contains("8 cameras"), "{reason}");
}

#[test]
fn what_has_no_plan_is_not_timed_and_the_rest_keeps_its_own() {
    let first = measured("linear,octree,bvh", 0, None, true);
    let mut known = first.known.expect("a plan");
    let plan = known.query.as_mut().expect("queries are timed");
    for (batch, task) in (1..).zip(&mut plan.schedule.tasks) {
        task.batch = batch;
    }
    plan.keys.remove(1);
    plan.schedule.tasks.remove(1);
    let part = measured("linear,octree,bvh", 1, Some(&known), false);
    let queries = part.tasks.iter().filter(|t| t.task == TaskKind::Query);
    let labels: Vec<&str> = queries.map(|t| t.label.as_str()).collect();
    assert_eq!(labels, ["linear", "bvh"]);
    // The schedule names an absent structure: one that ended a process.
    let part = measured("bvh", 2, Some(&known), false);
    let queries = part.tasks.iter().filter(|t| t.task == TaskKind::Query);
    assert_eq!(queries.count(), 1);
    let scene = scene();
    let (workload, subjects) = (workload(&scene), subjects("bvh", &scene));
    let entry = |subject| Entry {
        subject,
        part: SubjectPart::of(subject, Verdict::default()),
        counted: None,
    };
    let entries: Vec<Entry> = subjects.iter().map(entry).collect();
    let info = SceneInfo::of(&scene);
    let plan = GroupPlan::new(&workload, &info, protocol());
    let tasks = tasks_of(&workload, &entries, &plan, Pass::Queries, &known.visible);
    let (planned, _) = scheduled(tasks, known.query.as_ref(), 8, &protocol());
    let batches: Vec<u32> = planned.schedule.tasks.iter().map(|t| t.batch).collect();
    assert_eq!(batches, [3], "its own, not the one in its place");
}

/// Lower bounds take less time than a query, and so have larger batches.
#[test]
fn lower_bounds_take_no_tail_from_a_structure() {
    let scene = scene();
    let way = path::load("orbit:frames=40", &scene, &Default::default()).expect("a path");
    let workload = Workload::new(&scene, &way, &Culling::default()).expect("a workload");
    let (subjects, info) = (subjects("linear", &scene), SceneInfo::of(&scene));
    let plan = |known, plan_only: bool| GroupPlan {
        bounds: crate::measure::BOUNDS,
        locate: false,
        process: u32::from(!plan_only),
        known,
        plan_only,
        ..GroupPlan::new(&workload, &info, protocol())
    };
    let first = queries(&workload, &subjects, plan(None, true)).0;
    let mut known = first.known.expect("a plan");
    let planned = known.query.as_mut().expect("queries");
    planned.schedule.cameras = (0..40).collect();
    for (key, task) in planned.keys.iter().zip(&mut planned.schedule.tasks) {
        task.batch = if key.0 == "linear" { 1 } else { 40 };
    }
    let part = queries(&workload, &subjects, plan(Some(&known), false)).0;
    let tails = part.tasks.iter().map(|task| task.tail_ns.len());
    assert_eq!(tails.collect::<Vec<_>>(), [40, 0, 0]);
}
