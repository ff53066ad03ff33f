//! Does the road of a measurement notice when it is broken itself? A wrong
//! reference, a swallowed panic, a stale digest: each on its own, beside the
//! same road unbroken.

use std::ops::ControlFlow;
use std::sync::atomic::{AtomicU32, Ordering};

use cullbench::culling::{Culling, CullingTest};
use cullbench::geometry::Aabb;
use cullbench::index::{
    BuildError, Info, Input, Kind, MemoryUsage, Origin, RegionIndex, Registry, indexable,
};
use cullbench::measure::{
    Group, GroupPlan, Part, Protocol, ReferenceResults, SceneInfo, Status, Subject, Workload,
    measure,
};
use cullbench::path;
use cullbench::query::{Context, ItemId, QueryVolume, Recorder};
use cullbench::scene::{self, Scene};

const CAMERAS: u32 = 16;

/// A scan that misbehaves from its so-many-th query on.
struct Faulty<const FAULT: u8> {
    ids: Vec<ItemId>,
    boxes: Vec<Aabb>,
    queries: AtomicU32,
}

const SOUND: u8 = 0;
/// Panics in the timed pass.
const PANICS_LATER: u8 = 1;
/// Panics there, catches it itself and returns what it has.
const SWALLOWS_ITS_PANIC: u8 = 2;
/// Answers less where nothing is counted, which is what is timed.
const RIGHT_WHEN_COUNTED: u8 = 3;

const NAMES: [&str; 4] = [
    "sound",
    "panics-later",
    "swallows-its-panic",
    "right-when-counted",
];

impl<const FAULT: u8> RegionIndex for Faulty<FAULT> {
    const INFO: Info = Info::new(
        NAMES[FAULT as usize],
        "a scan, broken on request",
        Kind::Scan,
        Origin::Ours,
    );
    type Params = ();

    fn build(input: &Input<'_>, (): &()) -> Result<Self, BuildError> {
        let items = input.items;
        let ids = indexable(items)?;
        Ok(Faulty {
            boxes: ids.iter().map(|&id| items[id as usize]).collect(),
            ids,
            queries: AtomicU32::new(0),
        })
    }

    fn memory(&self) -> MemoryUsage {
        MemoryUsage {
            node_bytes: 0,
            item_bytes: size_of_val(&self.boxes[..]) + size_of_val(&self.ids[..]),
        }
    }

    fn query<Q: QueryVolume, C: Context>(&self, volume: &Q, cx: &mut C) -> ControlFlow<()> {
        let query = match Q::IS_POINT {
            true => 0,
            false => self.queries.fetch_add(1, Ordering::Relaxed),
        };
        // The count pass asks every camera twice.
        let is_timed = query >= 2 * CAMERAS;
        let work = || -> usize {
            let panics = FAULT == PANICS_LATER || FAULT == SWALLOWS_ITS_PANIC;
            assert!(!panics || !is_timed, "deep in the structure");
            self.ids.len()
        };
        let is_counted = size_of::<C::Recorder>() > 0;
        let last = match FAULT {
            RIGHT_WHEN_COUNTED if !is_counted && !Q::IS_POINT => self.ids.len() / 2,
            SWALLOWS_ITS_PANIC => std::panic::catch_unwind(work).unwrap_or(self.ids.len() / 2),
            _ => work(),
        };
        cx.recorder().items_tested(self.ids.len() as u32);
        for i in 0..last {
            if volume.admits(&self.boxes[i], volume.mask(), cx.recorder()) {
                cx.accept(&self.ids[i..=i])?;
            }
        }
        ControlFlow::Continue(())
    }
}

fn scene() -> Scene {
    scene::load("city:n=400", &Default::default()).expect("a scene")
}

fn workload(scene: &Scene) -> Workload<'_> {
    let source = format!("orbit:frames={CAMERAS}");
    let way = path::load(&source, scene, &Default::default()).expect("a path");
    Workload::new(scene, &way, &Culling::default()).expect("a workload")
}

fn subjects(names: &str, scene: &Scene) -> Vec<Subject> {
    let registry = Registry::builtin()
        .with::<Faulty<SOUND>>()
        .with::<Faulty<PANICS_LATER>>()
        .with::<Faulty<SWALLOWS_ITS_PANIC>>()
        .with::<Faulty<RIGHT_WHEN_COUNTED>>();
    let specs = registry.structures(names).expect("structures");
    let build = |spec| Subject::build(spec, false, scene, CullingTest::SixPlane);
    specs.into_iter().map(build).collect()
}

fn protocol() -> Protocol {
    Protocol {
        rounds: [2, 2],
        task_ns: 1e5,
        cameras: CAMERAS as usize,
        cold: false,
        seed: 1,
        cache_bytes: 1 << 20,
    }
}

fn statuses(workload: &Workload, subjects: &[Subject]) -> Vec<Status> {
    let info = SceneInfo::of(workload.scene);
    let plan = GroupPlan::new(workload, &info, protocol());
    let cells = Group::of(&[measure(workload, subjects, plan).0]).cells;
    for cell in &cells {
        let is_ok = cell.status == Status::Ok;
        assert_eq!(cell.rank.is_some(), is_ok, "{cell:?}");
        assert_eq!(cell.metrics.contains_key("query_ns"), is_ok, "{cell:?}");
    }
    cells.iter().map(|cell| cell.status).collect()
}

/// Result of one process.
fn part(process: u32, known: Option<&ReferenceResults>) -> Part {
    let scene = scene();
    let (workload, subjects) = (workload(&scene), subjects("linear,bvh,octree", &scene));
    let info = SceneInfo::of(&scene);
    let plan = GroupPlan {
        process,
        known,
        ..GroupPlan::new(&workload, &info, protocol())
    };
    measure(&workload, &subjects, plan).0
}

fn of_parts(parts: &[Part]) -> Vec<Status> {
    let cells = Group::of(parts).cells;
    cells.iter().map(|cell| cell.status).collect()
}

#[test]
fn the_unbroken_road_is_ok() {
    let scene = scene();
    let found = statuses(&workload(&scene), &subjects("linear,sound", &scene));
    assert_eq!(found, [Status::Ok; 2]);
}

#[test]
fn a_panic_in_the_timed_pass_is_told_and_one_that_is_swallowed_is_wrong() {
    let scene = scene();
    let names = "linear,panics-later,swallows-its-panic";
    let found = statuses(&workload(&scene), &subjects(names, &scene));
    assert_eq!(found, [Status::Ok, Status::Panicked, Status::Wrong]);
}

#[test]
fn what_is_timed_is_what_is_checked() {
    let scene = scene();
    let names = "linear,right-when-counted";
    let found = statuses(&workload(&scene), &subjects(names, &scene));
    assert_eq!(found, [Status::Ok, Status::Unsafe]);
}

/// A reference that agrees with all structures although all are wrong.
///
/// They are queried with views of cameras that look elsewhere; only the truth computed
/// from the cameras differs.
#[test]
fn a_reference_that_is_wrong_together_with_all_structures_is_unsafe() {
    let scene = scene();
    let subjects = subjects("linear,bvh", &scene);
    let mut wrong = workload(&scene);
    wrong.views.rotate_left(CAMERAS as usize / 2);
    assert_eq!(statuses(&wrong, &subjects), [Status::Unsafe; 2]);
}

/// The reference scans other boxes than the structures were built over.
#[test]
fn a_reference_over_other_items_disagrees_with_every_structure() {
    let scene = scene();
    let subjects = subjects("linear,bvh", &scene);
    let mut wrong = workload(&scene);
    wrong.items.to_mut().rotate_left(1);
    let found = statuses(&wrong, &subjects);
    assert!(!found.contains(&Status::Ok), "{found:?}");
}

#[test]
fn a_stale_digest_is_wrong() {
    let first = part(0, None);
    let mut known = first.known.clone().expect("a plan");
    assert_eq!(
        of_parts(&[first.clone(), part(1, Some(&known))]),
        [Status::Ok; 3]
    );
    // As many ids as before, and others.
    known.visible[CAMERAS as usize - 1].digest ^= 1;
    let found = of_parts(&[first, part(1, Some(&known))]);
    assert_eq!(found, [Status::Wrong; 3]);
}
