//! Measuring the points of the diagram for one scene and path: every structure
//! with every culling, checked, judged against the exact truth, and timed side
//! by side; and region search likewise.

use serde::{Deserialize, Serialize};

use super::judged::Shots;
use super::plane_test::PlaneTest;
use super::point::{Point, Times, mark_dominated};
use super::region_search::{self, POINTS_PER_CAMERA, RegionJudged, RegionPoint};
use super::stability::{StableAfter, by_camera, stability};
use super::ways::{Asked, Built, RegionWay, Way};
use crate::culling::Culling;
use crate::index::{BuildError, StructureSpec};
use crate::measure::{
    OverProcesses, ProcessTimes, Protocol, Schedule, Status, TimedTask, Verdict, timed,
};
use crate::path::CameraPath;
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
    pub points: Vec<Point>,
    /// Indices of the points that nothing dominates, fastest first.
    pub front: Vec<usize>,
    /// The other diagram: where is the camera. Fastest first.
    pub region_points: Vec<RegionPoint>,
    /// How the order by time settles with more cameras.
    pub stability: Vec<StableAfter>,
}

/// What all processes time: the plan is the same for each.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct PointPlan {
    /// Places of the points that are timed, then of the region points; last of
    /// all comes the twin, which is one of the points.
    timed: Vec<usize>,
    timed_regions: Vec<usize>,
    twin: Option<usize>,
    schedule: Schedule,
    /// By task and camera: ids.
    expected: Vec<Vec<u64>>,
}

/// All points, checked and judged, but not timed.
pub struct Prepared {
    /// What the other processes are to measure.
    pub plan: PointPlan,
    region_judged: Vec<RegionJudged>,
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
    let shots = Shots::of(input.path, input.most_cameras);
    let built = Built::new(scene, input.structures, &shots, Some(&shots.truths(scene)))?;
    let ways = built.ways();
    let (mut points, mut timed, mut tasks) = (Vec::new(), Vec::new(), Vec::new());
    let mut twin = None;
    for way in &ways {
        if stop() {
            return Ok(None);
        }
        let mut point = Point::new(way.structure, way.judged);
        if let Some(memory) = way.memory {
            point.memory(memory, scene.items.len());
        }
        let is_asked = !matches!(way.asked, Asked::Nothing) && way.judged.refused.is_none();
        if is_asked && way.judged.test.is_timed() {
            match checked(way, scene.items.len()) {
                Ok(()) => {
                    if way.judged.test == PlaneTest::Culling(Culling::default()) {
                        twin.get_or_insert(points.len());
                    }
                    timed.push(points.len());
                    tasks.push(way.task(way.judged.counts()));
                }
                Err(wrong) => (point.status, point.reason) = (wrong.status, wrong.reason),
            }
        }
        points.push(point);
    }
    let region_judged = built.queries.judged(scene);
    let (mut region_points, mut timed_regions) = (Vec::new(), Vec::new());
    for way in built.region_ways() {
        let own = &region_judged[way.numbers as usize];
        let mut point = own.point(way.structure);
        if region_is_right(&built, &way, own, shots.cameras.len()) {
            timed_regions.push(region_points.len());
            tasks.push(built.region_task(&way, own.counts()));
        } else {
            (point.status, point.reason) = (Status::Wrong, Some("other regions".to_owned()));
        }
        region_points.push(point);
    }
    if let Some(way) = twin.map(|original: usize| &ways[original]) {
        tasks.push(way.task(way.judged.counts()));
    }
    let cameras = shots.cameras.len();
    let schedule = Schedule::new(cameras, &tasks, input.protocol);
    Ok(Some(Prepared {
        precision: Precision {
            scene: scene.name.clone(),
            path: input.path.name.clone(),
            items: scene.items.len(),
            cameras,
            processes: 0,
            rounds: schedule.rounds as usize,
            twin: None,
            points,
            front: Vec::new(),
            region_points,
            stability: Vec::new(),
        },
        plan: PointPlan {
            timed,
            timed_regions,
            twin,
            schedule,
            expected: tasks.into_iter().map(|c| c.expected).collect(),
        },
        region_judged,
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
    let built = Built::new(input.scene, input.structures, &shots, None)?;
    let (ways, region_ways) = (built.ways(), built.region_ways());
    let mut expected = plan.expected.iter().cloned();
    let mut next = || expected.next().unwrap_or_default();
    let points = plan.timed.iter().map(|&point| &ways[point]);
    let mut tasks: Vec<TimedTask> = points.map(|way| way.task(next())).collect();
    let regions = plan
        .timed_regions
        .iter()
        .map(|&region| &region_ways[region]);
    tasks.extend(regions.map(|way| built.region_task(way, next())));
    tasks.extend(plan.twin.map(|point| ways[point].task(next())));
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
            region_judged,
        } = self;
        let times = OverProcesses::of(processes);
        let (points, regions) = (plan.timed.len(), plan.timed_regions.len());
        let place = |twin| plan.timed.iter().position(|&point| point == twin);
        if let Some(original) = plan.twin.and_then(place) {
            precision.twin = times.ratio(points + regions, original);
        }
        for (task, &point) in plan.timed.iter().enumerate() {
            precision.points[point].time(&times, task, precision.items);
        }
        for (task, &region) in (points..).zip(&plan.timed_regions) {
            let point = &mut precision.region_points[region];
            if let Some(wrong) = times.failure(task) {
                (point.status, point.reason) = (wrong.status, wrong.reason.clone());
            }
            point.times = Times::of(&times, task, POINTS_PER_CAMERA as f64);
        }
        let timed: Vec<usize> = (0..points)
            .filter(|&task| times.failure(task).is_none())
            .collect();
        precision.stability = stability(&timed, processes, precision.cameras, precision.rounds);
        let points = &mut precision.points;
        points.sort_by(|a, b| a.times.order().total_cmp(&b.times.order()));
        mark_dominated(points, &times);
        precision.front = (0..points.len()).filter(|&i| points[i].on_front).collect();
        region_search::conclude(&mut precision.region_points, &region_judged, &times);
        precision.processes = processes.len();
        precision
    }
}

/// Asks every query once; what was wrong, if anything.
fn checked(way: &Way, items: usize) -> Result<(), Verdict> {
    let mut trial = Trial::new(items);
    for (n, answer) in way.judged.answers.iter().enumerate() {
        trial.expect(answer.iter().copied());
        trial
            .ask(|out| way.asked.see(way.judged, n, out))
            .map_err(|fault| Verdict::new(Status::of(&fault), fault.explained(|_| None)))?;
    }
    Ok(())
}

fn region_is_right(built: &Built, way: &RegionWay, own: &RegionJudged, cameras: usize) -> bool {
    let mut out = Vec::new();
    (0..cameras).all(|n| {
        out.clear();
        let (scene, queries) = (built.scene, &built.queries);
        queries.ask(scene, way.numbers, way.index, n, &mut out);
        own.is_right(n, &out)
    })
}
