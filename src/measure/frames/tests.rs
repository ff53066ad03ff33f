//! Frames as a whole and in parts, wrong updates, policies.

use std::ops::ControlFlow;

use super::*;
use crate::culling::{Culling, CullingTest};
use crate::geometry::Aabb;
use crate::index::{
    BuildError, Info, Input, Linear, MemoryUsage, NoParams, RegionIndex, Registry, StructureSpec,
};
use crate::measure::{Group, ReferenceResults, SceneInfo};
use crate::motion::Motion;
use crate::path;
use crate::query::{Context, ItemId, QueryVolume};
use crate::scene;

/// A part of a motion in a small city, with two queries per frame.
fn part(
    specs: &[StructureSpec],
    motion: &str,
    test: CullingTest,
    known: Option<&ReferenceResults>,
) -> Part {
    let scene = scene::load("city:n=300", &Default::default()).unwrap();
    let way = path::load("orbit:frames=7", &scene, &Default::default()).unwrap();
    let culling = Culling {
        test,
        ..Culling::default()
    };
    let motion = Motion::load(motion, &scene).unwrap();
    let workload = Workload::moving(&scene, &way, &culling, Some(motion), 2).unwrap();
    let build = |spec: &StructureSpec| Subject::build(spec.clone(), false, &scene, test);
    let subjects: Vec<Subject> = specs.iter().map(build).collect();
    let info = SceneInfo::of(&scene);
    let protocol = Protocol {
        rounds: [2, 2],
        task_ns: 1e9,
        cameras: 8,
        cold: false,
        seed: 1,
        cache_bytes: 0,
    };
    let plan = GroupPlan {
        process: u32::from(known.is_some()),
        known,
        ..GroupPlan::new(&workload, &info, protocol)
    };
    measure(&workload, &subjects, plan).0
}

/// A structure by its label, `wide@every=5`.
fn by_policy(label: &str) -> StructureSpec {
    let (structure, policy) = label.split_once('@').unwrap_or((label, "refit"));
    StructureSpec {
        label: label.to_owned(),
        policy: policy.parse().unwrap(),
        ..StructureSpec::parse(structure).unwrap()
    }
}

#[test]
fn frames_are_measured_as_one_thing_and_in_parts() {
    let specs = Registry::builtin()
        .structures("linear,wide,octree")
        .unwrap();
    let first = part(
        &specs,
        "spawn:share=0.2,frames=12",
        CullingTest::SixPlane,
        None,
    );
    let known = first.known.as_ref().unwrap();
    assert_eq!(known.visible.len(), 24);
    let second = part(
        &specs,
        "spawn:share=0.2,frames=12",
        CullingTest::SixPlane,
        Some(known),
    );
    for part in [&first, &second] {
        assert_eq!(part.tasks.len(), 3 * KINDS.len());
        assert!(part.tasks.iter().all(|task| task.rounds_ns.len() == 2));
    }
    let parts = [first.clone(), second.clone(), second.clone()];
    let group = Group::of(&parts);
    for (cell, rank) in group.cells.iter().zip(0_usize..) {
        assert_eq!(cell.status, Status::Ok, "{:?}", cell.reason);
        let of = |name: &str| {
            cell.value(name)
                .unwrap_or_else(|| panic!("{name} of {rank}"))
        };
        let sum = of("update_ns") + of("query_ns") + of("further_query_ns");
        assert!((of("frame_ns") / sum - 1.0).abs() < 0.5, "{cell:?}");
        assert!(of("worst_frame_ns") >= of("frame_ns"));
        let firsts = known.visible.iter().step_by(2).map(|answer| answer.count);
        let returned = firsts.sum::<u64>() as f64 / 12.0;
        assert!((of("ns_per_visible") * returned / of("query_ns") - 1.0).abs() < 1e-9);
        // The octree cannot refit items that come or go.
        assert_eq!(cell.value("ageing_10").is_some(), rank < 2);
        assert!(cell.value("ageing_100").is_none());
        assert!(of("memory_after_bytes_per_item") > 0.0 && of("visible_count") > 0.0);
        assert_eq!(cell.key().group.motion, "spawn:share=0.2,frames=12");
        assert_eq!(
            (cell.ranked_by(), cell.times.cameras_checked),
            ("frame_ns", 24)
        );
    }
    // A first process with different answers.
    let mut other = known.clone();
    other.visible[5].digest ^= 1;
    let odd = part(
        &specs,
        "spawn:share=0.2,frames=12",
        CullingTest::SixPlane,
        Some(&other),
    );
    for subject in &odd.subjects {
        let reason = subject.verdict.reason.as_deref().unwrap_or_default();
        assert_eq!(subject.verdict.status, Status::Wrong);
        assert!(
            reason.starts_with("frame 3, camera 5: another set"),
            "{reason}"
        );
    }
}

#[test]
fn a_twin_gets_the_rounds_of_its_original() {
    let scene = scene::load("city:n=300", &Default::default()).unwrap();
    let way = path::load("orbit:frames=7", &scene, &Default::default()).unwrap();
    let motion = Motion::load("drift:frames=3", &scene).unwrap();
    let workload = Workload::moving(&scene, &way, &Culling::default(), Some(motion), 1).unwrap();
    let motion = workload.motion.as_ref().unwrap();
    let frames = Frames::new(&workload, motion, None, &|_, _| ());
    let test = CullingTest::SixPlane;
    let subjects = [("linear", false), ("wide", false), ("wide", true)].map(|(name, is_twin)| {
        Subject::build(StructureSpec::parse(name).unwrap(), is_twin, &scene, test)
    });
    // An interruption doubled the time of one replay.
    let times = [8e5, 4e5, 2e5];
    let entries = subjects
        .iter()
        .zip(times)
        .map(|(subject, replay_ns)| Entry {
            subject,
            part: SubjectPart::of(subject, Verdict::default()),
            replay_ns,
            rounds: Vec::new(),
        });
    let protocol = Protocol {
        rounds: [2, 40],
        task_ns: 1.6e6,
        cameras: 8,
        cold: false,
        seed: 1,
        cache_bytes: 0,
    };
    let planned = schedule(&entries.collect::<Vec<_>>(), &frames, &protocol);
    let every = |label: &str| {
        let at = planned.keys.iter().position(|key| key.0 == label).unwrap();
        planned.schedule.tasks[at].every
    };
    assert_eq!(["linear", "wide", "wide#twin"].map(every), [4, 1, 1]);
}

#[test]
fn spheres_move_as_cubes() {
    let own = ["linear", "wide", "moving", "auto:use=wide", "wide@every=2"];
    let specs: Vec<_> = own.iter().chain(&["bvh"]).copied().map(by_policy).collect();
    let [boxes, cubes] = [CullingTest::SixPlane, CullingTest::Sphere]
        .map(|test| part(&specs, "drift:share=0.5,frames=5", test, None).subjects);
    for (subject, of_boxes) in cubes.iter().zip(&boxes) {
        assert_eq!(subject.verdict, Verdict::default());
        // Centre and radius in addition to the bounds, up to the last frame.
        let [with, without] = [subject, of_boxes].map(|of| of.memory_after_bytes.unwrap());
        let has_spheres = own.contains(&&subject.label[..]);
        let more = with >= without + 300 * 16;
        assert_eq!(more, has_spheres, "{}: {with} {without}", subject.label);
    }
}

/// A scan whose refits lose the last mover.
struct Forgetful(Linear, Vec<Aabb>);

impl RegionIndex for Forgetful {
    const INFO: Info = Linear::INFO.named("forgetful");
    type Params = NoParams;

    fn build(input: &Input<'_>, _: &NoParams) -> Result<Self, BuildError> {
        let linear = Linear::build(input, &Default::default())?;
        Ok(Forgetful(linear, input.items.to_vec()))
    }

    fn memory(&self) -> MemoryUsage {
        self.0.memory()
    }

    fn query<Q: QueryVolume, C: Context>(&self, volume: &Q, context: &mut C) -> ControlFlow<()> {
        self.0.query(volume, context)
    }

    fn refit(&mut self, items: &[Aabb], moved: &[ItemId]) -> bool {
        for &id in &moved[..moved.len().saturating_sub(1)] {
            self.1[id as usize] = items[id as usize];
        }
        let built = Linear::build(&Input::new(&self.1), &Default::default());
        built.map(|linear| self.0 = linear).is_ok()
    }
}

#[test]
fn an_update_that_loses_an_item_is_no_right_answer() {
    let registry = Registry::builtin().with::<Forgetful>();
    let specs = registry.structures("linear,forgetful").unwrap();
    let part = part(
        &specs,
        "shuffle:share=0.2,frames=20",
        CullingTest::SixPlane,
        None,
    );
    let verdicts: Vec<Status> = part.subjects.iter().map(|s| s.verdict.status).collect();
    assert!(
        verdicts[0] == Status::Ok && verdicts[1].is_failure(),
        "{verdicts:?}"
    );
    let reason = part.subjects[1]
        .verdict
        .reason
        .as_deref()
        .unwrap_or_default();
    assert!(reason.starts_with("frame "), "{reason}");
    let group = Group::of(&[part]);
    assert_eq!((group.cells[0].rank, group.cells[1].rank), (Some(1), None));
}

#[test]
fn all_policies_are_right() {
    let labels = ["wide@refit", "wide@rebuild", "wide@every=5"];
    let specs = labels.map(by_policy);
    for motion in ["drift:share=0.3,frames=20", "spawn:share=0.3,frames=20"] {
        let part = part(&specs, motion, CullingTest::SixPlane, None);
        let cells = Group::of(&[part]).cells;
        assert!(
            cells.iter().all(|cell| cell.status == Status::Ok),
            "{cells:?}"
        );
        assert!(cells.iter().all(|cell| cell.rank.is_some()));
        // In the tenth frame of every=5 the tree is new.
        let aged = |n: usize, frame| cells[n].value(&format!("ageing_{frame}")).is_some();
        assert_eq!([0, 1, 2].map(|n| aged(n, 10)), [true, false, false]);
        assert!(aged(0, 1) && !aged(2, 1));
    }
}

#[test]
fn new_builds_in_place_of_refits_are_said() {
    let labels = [
        "bvh",
        "linear-scalar",
        "wide",
        "wide@every=3",
        "wide@rebuild",
    ];
    let specs = labels.map(by_policy);
    let noted = |motion: &str| {
        let cells = Group::of(&[part(&specs, motion, CullingTest::SixPlane, None)]).cells;
        assert!(
            cells.iter().all(|cell| cell.status == Status::Ok),
            "{cells:?}"
        );
        let noted = cells.into_iter().map(|cell| {
            assert_eq!(
                cell.value("ageing_1").is_some(),
                cell.chose.is_none() && !cell.structure.contains('@'),
                "{} {motion}",
                cell.structure
            );
            (cell.structure, cell.chose)
        });
        let noted = noted.filter_map(|(label, chose)| Some((label, chose?)));
        noted.collect::<Vec<_>>()
    };
    let all = "built again in 12 of 12 frames, which it cannot refit".to_owned();
    let scalar = ("linear-scalar".to_owned(), all.clone());
    assert_eq!(
        noted("drift:share=0.2,frames=12"),
        std::slice::from_ref(&scalar)
    );
    // Lanes reserved for absent items take them when they return.
    let spawn = noted("spawn:share=0.2,frames=12");
    assert_eq!(spawn, [("bvh".to_owned(), all), scalar]);
}

/// Boxes where f32 has steps of 0.5, and a motion that repeats them.
#[test]
fn recorded_frames_are_judged_by_the_boxes_as_written() {
    let folder = tempfile::tempdir().unwrap();
    let header = "min_x,min_y,min_z,max_x,max_y,max_z\n";
    let (mut boxes, mut moves) = (header.to_owned(), format!("time_s,id,{header}"));
    let far = |n: u32| 8e6 + f64::from(n) * 0.37 % 12.0;
    for n in 0..200_u32 {
        let [x, y, z] = [far(n), far(7 * n), far(31 * n)];
        let row = match n {
            // No origin suits all of them.
            0 => "-8e6,-8e6,-8e6,-8e6,-8e6,-8e6".to_owned(),
            _ => format!("{x},{y},{z},{},{},{}", x + 0.2, y + 0.1, z + 0.05),
        };
        boxes += &format!("{row}\n");
        moves += &format!("0,{n},{row}\n");
    }
    let file = |name: &str, text: &str| {
        let path = folder.path().join(name);
        std::fs::write(&path, text).unwrap();
        path.to_str().unwrap().to_owned()
    };
    let [boxes, moves] = [("b.csv", boxes), ("m.csv", moves)].map(|(name, text)| file(name, &text));
    let eye = "eye_x,eye_y,eye_z,look_x,look_y,look_z,near,far\n\
               7999992,8000001,7999999,8e6,8e6,8000004,0.5,40\n";
    let scene = scene::load(&boxes, &Default::default()).unwrap();
    let way = path::load(&file("c.csv", eye), &scene, &Default::default()).unwrap();
    let mut culling = Culling::default();
    culling.planes.epsilon = 0.0;
    let still = Workload::new(&scene, &way, &culling).unwrap();
    let motion = Motion::load(&moves, &scene).unwrap();
    let moving = Workload::moving(&scene, &way, &culling, Some(motion), 1).unwrap();
    let motion = moving.motion.as_ref().unwrap();
    let frames = Frames::new(&moving, motion, None, &|_, _| ());
    let wanted = crate::measure::count::judge(&still, 10_000);
    let found = frames.judged.unwrap();
    assert_eq!(found.errors, wanted.errors);
    assert!(wanted.errors.by_storage > 0, "{wanted:?}");
}
