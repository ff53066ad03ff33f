//! Measuring the points of the diagram for one scene and path: every structure
//! with every culling, checked, judged against the exact truth, and timed side
//! by side; and region search likewise.

use serde::{Deserialize, Serialize};

use super::judged::{CullingErrors, Judged, Shots, Truths};
use super::point::{self, Point};
use super::region_search::{
    POINTS_PER_CAMERA, RegionErrors, RegionJudged, RegionNumbers, RegionQueries,
};
use super::stability::{StableAfter, by_camera, stability};
use crate::camera::{PLANE_METHODS, PlaneOptions};
use crate::culling::{ARITHMETICS, Arithmetic, Culling, CullingTest, TESTS};
use crate::index::{BuildError, DynIndex, StructureSpec};
use crate::measure::{
    OverProcesses, ProcessTimes, Protocol, Schedule, Status, TimedTask, Verdict, input_of, timed,
};
use crate::path::CameraPath;
use crate::query::ItemId;
use crate::scene::Scene;
use crate::statistics::Estimate;
use crate::verify::Trial;

/// The diagram of a scene and path.
#[derive(Clone, Debug, Serialize)]
pub struct Precision {
    /// Name of the scene.
    pub scene: String,
    /// Name of the path.
    pub path: String,
    /// Number of items.
    pub items: usize,
    /// Cameras that were judged and timed.
    pub cameras: usize,
    /// Processes that were timed; an interval needs three or more.
    pub processes: usize,
    /// In each process.
    pub rounds: usize,
    /// Time of the first structure with the default culling, entered a second
    /// time, / time of itself: a check whose interval is to hold 1.
    pub twin: Option<Estimate>,
    /// Fastest first; what could not be measured comes last.
    pub points: Vec<Point<CullingErrors>>,
    /// Indices of the points that nothing dominates, fastest first.
    pub front: Vec<usize>,
    /// The other diagram: where is the camera. Fastest first.
    pub region_points: Vec<Point<RegionErrors>>,
    /// How the order by time settles with more cameras.
    pub stability: Vec<StableAfter>,
}

/// What all processes time: the plan is the same for each.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct PointPlan {
    tasks: Vec<PlannedTask>,
    schedule: Schedule,
}

/// One way to answer, timed.
#[derive(Clone, Debug, Serialize, Deserialize)]
struct PlannedTask {
    key: Key,
    /// Whether the same is timed a second time, as a check.
    is_twin: bool,
    /// Ids of every query.
    expected: Vec<u64>,
}

/// Index of a point, as all of them were before any was timed.
#[derive(Clone, Copy, PartialEq, Debug, Serialize, Deserialize)]
enum Key {
    Culling(usize),
    Region(usize),
}

/// All points, checked and judged, but not timed.
pub struct Prepared {
    /// What the other processes are to measure.
    pub plan: PointPlan,
    precision: Precision,
}

/// What a diagram is drawn of.
#[derive(Clone, Copy)]
pub struct PrecisionInput<'a> {
    /// Items to be culled.
    pub scene: &'a Scene,
    /// Cameras to be culled for.
    pub path: &'a CameraPath,
    /// Structures to be measured with every test.
    pub structures: &'a [StructureSpec],
    /// Of the path, evenly spread.
    pub most_cameras: usize,
    /// Rounds and times of a process.
    pub protocol: &'a Protocol,
}

/// Every test with every arithmetic, with and without epsilon; every
/// derivation of the planes for the six-plane test.
fn cullings() -> Vec<Culling> {
    let standard = PlaneOptions::default();
    let bare = PlaneOptions {
        epsilon: 0.0,
        ..standard
    };
    let mut all = Vec::new();
    for (test, ..) in TESTS {
        for (arithmetic, ..) in ARITHMETICS {
            let options = [bare, standard].into_iter();
            // f64 has no epsilon.
            let options = options.take(if arithmetic == Arithmetic::F64 { 1 } else { 2 });
            all.extend(options.map(|planes| Culling {
                test,
                arithmetic,
                planes,
            }));
        }
    }
    let others = PLANE_METHODS.into_iter().map(|(method, ..)| method);
    let others = others.filter(|method| *method != standard.method);
    all.extend(others.map(|method| Culling {
        planes: PlaneOptions { method, ..bare },
        ..Culling::default()
    }));
    all.retain(|culling| culling.check().is_ok());
    all
}

/// A structure over the boxes, over the cubes of the sphere test, and over the
/// regions where those are other boxes.
struct Indexes<'a> {
    structure: &'a str,
    boxes: Box<dyn DynIndex>,
    cubes: Box<dyn DynIndex>,
    regions: Option<Box<dyn DynIndex>>,
}

impl<'a> Indexes<'a> {
    fn new(spec: &'a StructureSpec, scene: &Scene) -> Result<Indexes<'a>, BuildError> {
        let over = |test: CullingTest| {
            let items = test.items(&scene.items);
            spec.build(input_of(scene, &items))
        };
        let regions = scene.regions.boxes(&scene.items);
        let others = !std::ptr::eq(regions, &scene.items[..]);
        let others = others.then(|| spec.build(input_of(scene, regions)));
        Ok(Indexes {
            structure: &spec.label,
            boxes: over(CullingTest::SixPlane)?,
            cubes: over(CullingTest::Sphere)?,
            regions: others.transpose()?,
        })
    }

    fn of(&self, test: CullingTest) -> &dyn DynIndex {
        match test {
            CullingTest::Sphere => self.cubes.as_ref(),
            _ => self.boxes.as_ref(),
        }
    }

    fn regions(&self) -> &dyn DynIndex {
        self.regions.as_deref().unwrap_or(self.boxes.as_ref())
    }
}

/// Everything that points are made of, the same in every process.
struct Built<'a> {
    judged: Vec<Judged>,
    structures: Vec<Indexes<'a>>,
    queries: RegionQueries<'a>,
}

/// One way to answer: a structure with a culling.
#[derive(Clone, Copy)]
struct Way<'b> {
    structure: &'b str,
    index: &'b dyn DynIndex,
    judged: &'b Judged,
}

impl Way<'_> {
    fn ask(&self, n: usize, out: &mut Vec<ItemId>) {
        self.index.query(self.judged.views[n].as_any(), out);
    }

    /// Asks every query once; what was wrong, if anything.
    fn checked(&self, items: usize) -> Result<(), Verdict> {
        let mut trial = Trial::new(items);
        for (n, answer) in self.judged.answers.iter().enumerate() {
            trial.expect(answer.iter().copied());
            trial
                .ask(|out| self.ask(n, out))
                .map_err(|fault| Verdict::new(Status::of(&fault), fault.explained(|_| None)))?;
        }
        Ok(())
    }
}

/// One way to search for a region: a structure, or a loop over all regions.
#[derive(Clone, Copy)]
struct RegionWay<'b> {
    structure: &'b str,
    index: Option<&'b dyn DynIndex>,
    numbers: RegionNumbers,
}

impl<'a> Built<'a> {
    fn new(
        input: &PrecisionInput<'a>,
        shots: &Shots,
        truths: Option<&Truths>,
    ) -> Result<Built<'a>, BuildError> {
        let scene = input.scene;
        let judge = |culling| Judged::new(scene, shots, truths, culling);
        let structures = input.structures.iter();
        let structures = structures.map(|spec| Indexes::new(spec, scene));
        Ok(Built {
            judged: cullings().into_iter().map(judge).collect(),
            structures: structures.collect::<Result<_, BuildError>>()?,
            queries: RegionQueries::new(scene, shots),
        })
    }

    /// All points in their order.
    fn ways(&self) -> Vec<Way<'_>> {
        let structures = self.structures.iter();
        let each = structures.flat_map(|indexes| self.judged.iter().map(move |own| (indexes, own)));
        let ways = each.map(|(indexes, judged)| Way {
            structure: indexes.structure,
            index: indexes.of(judged.culling.test),
            judged,
        });
        ways.collect()
    }

    /// All ways to search for a region: f32 by every structure, the others by a
    /// loop over all regions.
    fn region_ways(&self) -> Vec<RegionWay<'_>> {
        let by_index = self.structures.iter().flat_map(|indexes| {
            [RegionNumbers::F32, RegionNumbers::Checked].map(|numbers| RegionWay {
                structure: indexes.structure,
                index: Some(indexes.regions()),
                numbers,
            })
        });
        let by_loop = [RegionNumbers::F64, RegionNumbers::Exact].map(|numbers| RegionWay {
            structure: "scan",
            index: None,
            numbers,
        });
        by_index.chain(by_loop).collect()
    }

    fn task<'b>(&'b self, planned: &PlannedTask) -> TimedTask<'b> {
        let expected = planned.expected.clone();
        match planned.key {
            Key::Culling(place) => {
                let way = self.ways()[place];
                TimedTask::new(expected, move |n, out| way.ask(n, out))
            }
            Key::Region(place) => {
                let RegionWay { index, numbers, .. } = self.region_ways()[place];
                let queries = &self.queries;
                TimedTask::new(expected, move |n, out| queries.ask(numbers, index, n, out))
            }
        }
    }

    fn tasks(&self, planned: &[PlannedTask]) -> Vec<TimedTask<'_>> {
        planned.iter().map(|planned| self.task(planned)).collect()
    }
}

/// Measures all points in this process alone: times without intervals. `None` if
/// stopped. With more processes: [`prepare`], [`time`] in each of them,
/// [`Prepared::conclude`].
///
/// # Errors
/// A structure that refuses the scene.
pub fn measure_points(
    input: &PrecisionInput,
    stop: &dyn Fn() -> bool,
) -> Result<Option<Precision>, BuildError> {
    let Some(prepared) = prepare(input, stop)? else {
        return Ok(None);
    };
    let times = time(input, &prepared.plan, stop)?;
    Ok(times.map(|times| prepared.conclude(&[times])))
}

/// Checks and judges all points, and plans how they are timed; `None` if stopped.
///
/// Every answer is compared with the plain loop before it is timed, and the
/// plain loop with the exact truth: O(cameras * items) verdicts of some 50 ns
/// and as many plain tests for each culling, twice for what changes from frame to
/// frame.
///
/// # Errors
/// A structure that refuses the scene.
pub fn prepare(
    input: &PrecisionInput,
    stop: &dyn Fn() -> bool,
) -> Result<Option<Prepared>, BuildError> {
    let scene = input.scene;
    let items = scene.items.len();
    let shots = Shots::of(input.path, input.most_cameras);
    let cameras = shots.cameras.len();
    let built = Built::new(input, &shots, Some(&shots.truths(scene)))?;
    let planned = |key, expected| PlannedTask {
        key,
        is_twin: false,
        expected,
    };
    let (mut points, mut tasks, mut twin) = (Vec::new(), Vec::new(), None);
    for (place, way) in built.ways().into_iter().enumerate() {
        if stop() {
            return Ok(None);
        }
        let judged = way.judged;
        let memory = way.index.memory().total() as f64 / items as f64;
        let mut point = judged.point(way.structure, memory);
        if judged.refused.is_none() {
            match way.checked(items) {
                Ok(()) => {
                    let task = planned(Key::Culling(place), judged.counts());
                    if judged.culling == Culling::default() && twin.is_none() {
                        twin = Some(PlannedTask {
                            is_twin: true,
                            ..task.clone()
                        });
                    }
                    tasks.push(task);
                }
                Err(wrong) => (point.status, point.reason) = (wrong.status, wrong.reason),
            }
        }
        points.push(point);
    }
    let region_judged = built.queries.judged();
    let mut region_points = Vec::new();
    for (place, way) in built.region_ways().into_iter().enumerate() {
        let own = &region_judged[way.numbers as usize];
        let mut point = own.point(way.structure);
        if region_is_right(&built.queries, &way, own, cameras) {
            tasks.push(planned(Key::Region(place), own.counts()));
        } else {
            (point.status, point.reason) = (Status::Wrong, Some("other regions".to_owned()));
        }
        region_points.push(point);
    }
    tasks.extend(twin);
    let schedule = Schedule::new(cameras, &built.tasks(&tasks), input.protocol);
    Ok(Some(Prepared {
        precision: Precision {
            scene: scene.name.clone(),
            path: input.path.name.clone(),
            items,
            cameras,
            processes: 0,
            rounds: schedule.rounds as usize,
            twin: None,
            points,
            front: Vec::new(),
            region_points,
            stability: Vec::new(),
        },
        plan: PointPlan { tasks, schedule },
    }))
}

/// Times in this process what was planned; `None` if stopped.
///
/// # Errors
/// A structure that refuses the scene.
///
/// # Panics
/// If the scene is not the one that was planned for.
pub fn time(
    input: &PrecisionInput,
    plan: &PointPlan,
    stop: &dyn Fn() -> bool,
) -> Result<Option<ProcessTimes>, BuildError> {
    let shots = Shots::of(input.path, input.most_cameras);
    let cameras = shots.cameras.len();
    let built = Built::new(input, &shots, None)?;
    let tasks = built.tasks(&plan.tasks);
    let timed = timed(&tasks, &plan.schedule, input.protocol, &|_| stop());
    Ok(timed.map(|timed| {
        let by_camera = timed.iter().map(|timed| match timed {
            Ok(timed) => by_camera(timed, cameras),
            Err(_) => Vec::new(),
        });
        ProcessTimes {
            by_camera: by_camera.collect(),
            ..ProcessTimes::of(&timed)
        }
    }))
}

impl Prepared {
    /// The diagram from the times of all processes.
    pub fn conclude(self, processes: &[ProcessTimes]) -> Precision {
        let Prepared {
            mut precision,
            plan,
        } = self;
        let times = OverProcesses::of(processes);
        // The twin comes last: the first of its key is the original.
        let original = |key| plan.tasks.iter().position(|planned| planned.key == key);
        let mut culled = Vec::new();
        for (task, planned) in plan.tasks.iter().enumerate() {
            match planned.key {
                key if planned.is_twin => {
                    precision.twin = original(key).and_then(|own| times.ratio(task, own));
                }
                Key::Culling(place) => {
                    culled.push(task);
                    let point = &mut precision.points[place];
                    point.time(&times, task, 1.0);
                    let ns = point.times.query_ns;
                    point.errors.ns_per_item = ns.map(|ns| ns / precision.items as f64);
                }
                Key::Region(place) => {
                    precision.region_points[place].time(&times, task, POINTS_PER_CAMERA as f64);
                }
            }
        }
        culled.retain(|&task| times.failure(task).is_none());
        precision.stability = stability(&culled, processes, precision.cameras, precision.rounds);
        let points = &mut precision.points;
        point::conclude(points, &times);
        precision.front = (0..points.len()).filter(|&i| points[i].on_front).collect();
        point::conclude(&mut precision.region_points, &times);
        precision.processes = processes.len();
        precision
    }
}

fn region_is_right(
    queries: &RegionQueries,
    way: &RegionWay,
    own: &RegionJudged,
    cameras: usize,
) -> bool {
    let mut out = Vec::new();
    (0..cameras).all(|n| {
        out.clear();
        queries.ask(way.numbers, way.index, n, &mut out);
        own.is_right(n, &out)
    })
}
