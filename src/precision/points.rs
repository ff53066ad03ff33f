//! Measuring the points of the diagram for one scene and path: every structure
//! with every culling, checked, judged against the exact truth, and timed side
//! by side.

use serde::{Deserialize, Serialize};

use super::judged::{Judged, Truths};
use super::point::{Point, mark_dominated};
use super::quantised::{Code, GridScope, Quantised};
use super::stability::{StableAfter, by_camera, stability};
use crate::camera::{Camera, PLANE_METHODS, PlaneMethod, PlaneOptions};
use crate::culling::{ARITHMETICS, Arithmetic, Culling, CullingTest, TESTS};
use crate::index::{BuildError, By, DynIndex, Input, RegionIndex, StructureSpec};
use crate::kernel::Kernel;
use crate::measure::{
    OverProcesses, ProcessTimes, Protocol, Schedule, Status, TimedTask, Verdict, input_of, timed,
};
use crate::path::CameraPath;
use crate::scene::Scene;
use crate::statistics::Estimate;
use crate::verify::{Trial, Truth};

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
    /// How the order by time settles with more cameras.
    pub stability: Vec<StableAfter>,
}

/// Every test with every arithmetic, with and without epsilon; every
/// derivation of the planes for the six-plane test.
fn cullings() -> Vec<Culling> {
    let with = |epsilon: f64, method: PlaneMethod| PlaneOptions { method, epsilon };
    let standard = PlaneOptions::default();
    let mut all = Vec::new();
    for (test, ..) in TESTS {
        for (arithmetic, ..) in ARITHMETICS {
            let epsilons: &[f64] = match arithmetic {
                Arithmetic::F64 => &[0.0],
                _ => &[0.0, standard.epsilon],
            };
            for &epsilon in epsilons {
                let planes = with(epsilon, standard.method);
                all.push(Culling {
                    test,
                    arithmetic,
                    planes,
                });
            }
        }
    }
    for (method, ..) in PLANE_METHODS {
        if method != standard.method {
            all.push(Culling {
                planes: with(0.0, method),
                ..Culling::default()
            });
        }
    }
    all.retain(|culling| culling.check().is_ok());
    all
}

/// A structure over the boxes and over the cubes of the sphere test.
struct Indexes {
    boxes: Box<dyn DynIndex>,
    cubes: Box<dyn DynIndex>,
}

impl Indexes {
    fn new(spec: &StructureSpec, scene: &Scene) -> Result<Indexes, BuildError> {
        let over = |test: CullingTest| {
            let items = test.items(&scene.items);
            spec.build(input_of(scene, &items))
        };
        Ok(Indexes {
            boxes: over(CullingTest::SixPlane)?,
            cubes: over(CullingTest::Sphere)?,
        })
    }

    fn of(&self, test: CullingTest) -> &dyn DynIndex {
        match test {
            CullingTest::Sphere => self.cubes.as_ref(),
            _ => self.boxes.as_ref(),
        }
    }
}

/// The experiment with items in few bits: an index, or none if the scene does
/// not fit.
struct Stored {
    label: String,
    index: Option<Box<dyn DynIndex>>,
    judged: Vec<Judged>,
}

/// u8 and u16 codes, on one grid or on one for each block, with the default
/// view and with the exact test.
fn quantised(kernel: Kernel, scene: &Scene, cameras: &[Camera], truths: Truths) -> Vec<Stored> {
    let scopes = [(GridScope::World, "world"), (GridScope::Block, "block")];
    let bytes = scopes.map(|scope| stored::<u8>(scope, kernel, scene, cameras, truths));
    let words = scopes.map(|scope| stored::<u16>(scope, kernel, scene, cameras, truths));
    bytes.into_iter().chain(words).collect()
}

fn stored<C: Code>(
    (scope, name): (GridScope, &str),
    kernel: Kernel,
    scene: &Scene,
    cameras: &[Camera],
    truths: Truths,
) -> Stored {
    let cullings = [CullingTest::SixPlane, CullingTest::Exact].map(|test| Culling {
        test,
        ..Culling::default()
    });
    let structure = Quantised::<C>::INFO.name;
    let label = format!("{structure}:bits={},grid={name}", 8 * size_of::<C>());
    match Quantised::<C>::build(&Input::new(&scene.items), &scope) {
        Ok(index) => {
            let items = index.decoded(scene.items.len());
            let judged =
                cullings.map(|culling| Judged::new(scene, &items, cameras, truths, culling));
            Stored {
                label,
                index: Some(Box::new(By { index, kernel })),
                judged: judged.into(),
            }
        }
        Err(error) => Stored {
            label,
            index: None,
            judged: cullings.map(|c| Judged::refused(c, &error)).into(),
        },
    }
}

/// Everything that points are made of, the same in every process.
struct Built<'a> {
    judged: Vec<Judged>,
    structures: Vec<(&'a str, Indexes)>,
    stored: Vec<Stored>,
}

/// One way to answer: a structure with a culling.
struct Way<'b> {
    structure: &'b str,
    index: Option<&'b dyn DynIndex>,
    judged: &'b Judged,
}

impl<'a> Built<'a> {
    fn new(
        input: &PrecisionInput<'a>,
        cameras: &[Camera],
        truths: Truths,
    ) -> Result<Built<'a>, BuildError> {
        let (scene, structures) = (input.scene, input.structures);
        let judged = cullings().into_iter().map(|culling| {
            let items = culling.test.items(&scene.items);
            Judged::new(scene, &items, cameras, truths, culling)
        });
        let execution = structures.first().map(|spec| spec.execution);
        let indexed = structures
            .iter()
            .map(|spec| Ok((spec.label.as_str(), Indexes::new(spec, scene)?)));
        Ok(Built {
            judged: judged.collect(),
            structures: indexed.collect::<Result<_, BuildError>>()?,
            stored: quantised(execution.unwrap_or_default().kernel, scene, cameras, truths),
        })
    }

    /// All points in their order.
    fn ways(&self) -> Vec<Way<'_>> {
        let of_structures = self.structures.iter().flat_map(|(structure, indexes)| {
            self.judged.iter().map(|judged| Way {
                structure,
                index: Some(indexes.of(judged.culling.test)),
                judged,
            })
        });
        let of_stored = self.stored.iter().flat_map(|stored| {
            stored.judged.iter().map(|judged| Way {
                structure: &stored.label,
                index: stored.index.as_deref(),
                judged,
            })
        });
        of_structures.chain(of_stored).collect()
    }
}

impl<'b> Way<'b> {
    fn task(&self, expected: Vec<u64>) -> TimedTask<'b> {
        let (index, views) = (self.index, &self.judged.views);
        TimedTask {
            ask: match index {
                Some(index) => Box::new(move |n, out| index.query(views[n].as_any(), out)),
                None => Box::new(|_, _| ()),
            },
            ask_many: None,
            expected,
            least_ns: None,
        }
    }
}

/// The cameras that are looked at: at most `most`, evenly spread.
fn cameras_of(path: &CameraPath, most: usize) -> Vec<Camera> {
    let count = path.cameras.len();
    let wanted = most.max(1).min(count);
    let chosen = (0..wanted).map(|i| path.cameras[i * count / wanted]);
    chosen.collect()
}

/// What all processes time: the plan is the same for each.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct PointPlan {
    /// Places of the points that are timed; the twin, where there is one, last.
    timed: Vec<usize>,
    schedule: Schedule,
    /// By timed point and camera: ids.
    expected: Vec<Vec<u64>>,
}

/// All points, checked and judged, but not timed.
pub struct Prepared {
    /// What the other processes are to measure.
    pub plan: PointPlan,
    /// Place of the twin's original among those that are timed.
    twin: Option<usize>,
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
/// and as many plain tests for each culling.
///
/// # Errors
/// A structure that refuses the scene.
pub fn prepare(
    input: &PrecisionInput,
    stop: &dyn Fn() -> bool,
) -> Result<Option<Prepared>, BuildError> {
    let scene = input.scene;
    let cameras = cameras_of(input.path, input.most_cameras);
    let truths = cameras.iter();
    // A frame always makes a pose.
    let truths: Vec<Truth> = truths.filter_map(|c| Truth::of_scene(c, scene)).collect();
    let built = Built::new(input, &cameras, Some(&truths))?;
    drop(truths);
    let ways = built.ways();
    let (mut points, mut timed, mut tasks) = (Vec::new(), Vec::new(), Vec::new());
    let mut twin = None;
    for way in &ways {
        if stop() {
            return Ok(None);
        }
        let judged = way.judged;
        let mut point = Point::new(way.structure, judged);
        if let Some(index) = way.index {
            point.memory(index.memory(), scene.items.len());
            let has_views = judged.refused.is_none();
            match has_views.then(|| checked(index, judged, scene.items.len())) {
                None => {}
                Some(Ok(())) => {
                    if judged.culling == Culling::default() {
                        twin.get_or_insert(timed.len());
                    }
                    timed.push(points.len());
                    tasks.push(way.task(judged.counts()));
                }
                Some(Err(wrong)) => (point.status, point.reason) = (wrong.status, wrong.reason),
            }
        }
        points.push(point);
    }
    if let Some(original) = twin {
        let way = &ways[timed[original]];
        tasks.push(way.task(way.judged.counts()));
        timed.push(timed[original]);
    }
    let cameras = cameras.len();
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
            stability: Vec::new(),
        },
        plan: PointPlan {
            timed,
            schedule,
            expected: tasks.into_iter().map(|c| c.expected).collect(),
        },
        twin,
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
    let cameras = cameras_of(input.path, input.most_cameras);
    let built = Built::new(input, &cameras, None)?;
    let ways = built.ways();
    let planned = plan.timed.iter().zip(&plan.expected);
    let tasks: Vec<TimedTask> = planned
        .map(|(&point, expected)| ways[point].task(expected.clone()))
        .collect();
    let timed = timed(&tasks, &plan.schedule, input.protocol, &|_| stop());
    Ok(timed.map(|timed| {
        let by_camera = timed.iter().map(|timed| match timed {
            Ok(timed) => by_camera(timed, cameras.len()),
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
            mut plan,
            twin,
        } = self;
        let times = OverProcesses::of(processes);
        if let Some(original) = twin {
            plan.timed.pop();
            precision.twin = times.ratio(plan.timed.len(), original);
        }
        let points = &mut precision.points;
        for (task, &point) in plan.timed.iter().enumerate() {
            points[point].time(&times, task, precision.items);
        }
        let timed: Vec<usize> = (0..plan.timed.len())
            .filter(|&task| times.failure(task).is_none())
            .collect();
        precision.stability = stability(&timed, processes, precision.cameras, precision.rounds);
        points.sort_by(|a, b| {
            let key = |p: &Point| p.query_ns.unwrap_or(f64::INFINITY);
            key(a).total_cmp(&key(b))
        });
        mark_dominated(points, &|a, b| times.is_faster(a, b));
        precision.front = (0..points.len()).filter(|&i| points[i].on_front).collect();
        precision.processes = processes.len();
        precision
    }
}

/// Asks every query once; what was wrong, if anything.
fn checked(index: &dyn DynIndex, judged: &Judged, items: usize) -> Result<(), Verdict> {
    let mut trial = Trial::new(items);
    for (view, answer) in judged.views.iter().zip(&judged.answers) {
        trial.expect(answer.iter().copied());
        trial
            .ask(|out| index.query(view.as_any(), out))
            .map_err(|fault| Verdict::new(Status::of(&fault), fault.explained(|_| None)))?;
    }
    Ok(())
}
