//! Measuring the points of the diagram for one scene and path: every structure
//! with every culling, checked, judged against the exact truth, and timed side
//! by side.

use serde::{Deserialize, Serialize};

use super::judged::Judged;
use super::point::{Point, mark_dominated};
use super::stability::{StableAfter, by_camera, stability};
use crate::camera::{Camera, PLANE_METHODS, PlaneMethod, PlaneOptions};
use crate::culling::{ARITHMETICS, Arithmetic, CameraView, Culling, CullingTest, TESTS};
use crate::geometry::Aabb;
use crate::index::{
    BuildError, By, DynIndex, GridScope, Quantised, QuantisedParams, RegionIndex, StructureSpec,
};
use crate::kernel::Kernel;
use crate::measure::{
    Competitor, OverProcesses, ProcessTimes, Protocol, Schedule, Status, Verdict, timed,
};
use crate::path::CameraPath;
use crate::scene::Scene;
use crate::statistics::Estimate;
use crate::verify::{Trial, Truth};

/// The diagram of a scene and path.
#[derive(Clone, Debug, Serialize)]
pub struct Precision {
    pub scene: String,
    pub path: String,
    pub items: usize,
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

/// A culling with its views, up to the first camera that has none.
pub(super) struct Views {
    pub culling: Culling,
    pub views: Vec<CameraView>,
    pub refused: Option<String>,
}

impl Views {
    fn new(scene: &Scene, cameras: &[Camera], culling: Culling) -> Views {
        let around = scene.surroundings();
        let mut views = Vec::with_capacity(cameras.len());
        for camera in cameras {
            match culling.view(camera, &around) {
                Ok(view) => views.push(view),
                Err(error) => {
                    return Views {
                        culling,
                        views,
                        refused: Some(error.to_string()),
                    };
                }
            }
        }
        Views {
            culling,
            views,
            refused: None,
        }
    }
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
            spec.build_with(&items, scene.own_tree.as_ref())
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
    index: Result<By<Quantised>, BuildError>,
}

/// u8 and u16 codes, on one grid or on one for each block.
fn quantised(kernel: Kernel, scene: &Scene) -> Vec<Stored> {
    let mut all = Vec::new();
    for bits in [8, 16] {
        for grid in [GridScope::World, GridScope::Block] {
            let scope = match grid {
                GridScope::World => "world",
                GridScope::Block => "block",
            };
            let params = QuantisedParams { bits, grid };
            let index = Quantised::build(&scene.items, None, &params);
            all.push(Stored {
                label: format!("{}:bits={bits},grid={scope}", Quantised::INFO.name),
                index: index.map(|index| By { index, kernel }),
            });
        }
    }
    all
}

/// Everything that points are made of, the same in every process.
struct Built<'a> {
    cameras: Vec<Camera>,
    views: Vec<Views>,
    structures: Vec<(&'a str, Indexes)>,
    stored: Vec<Stored>,
}

/// One way to answer: a structure with a culling.
struct Way<'b> {
    structure: &'b str,
    views: &'b Views,
    /// What is indexed, if it can be.
    index: Result<&'b dyn DynIndex, &'b BuildError>,
    /// What its answers are to be.
    of: Answers,
}

/// The plain loop over the scene's items by so manieth culling, or over those of
/// a quantised index.
#[derive(Clone, Copy, PartialEq)]
enum Answers {
    Scene(usize),
    Stored(usize),
}

impl<'a> Built<'a> {
    fn new(
        scene: &Scene,
        path: &CameraPath,
        structures: &'a [StructureSpec],
        most_cameras: usize,
    ) -> Result<Built<'a>, BuildError> {
        let cameras = cameras_of(path, most_cameras);
        let views = cullings().into_iter();
        let specs = structures.first().map(|spec| spec.execution);
        let indexed = structures
            .iter()
            .map(|spec| Ok((spec.label.as_str(), Indexes::new(spec, scene)?)));
        Ok(Built {
            views: views.map(|c| Views::new(scene, &cameras, c)).collect(),
            structures: indexed.collect::<Result<_, BuildError>>()?,
            stored: quantised(specs.unwrap_or_default().kernel, scene),
            cameras,
        })
    }

    /// All points in their order, with the default view and with the exact test
    /// for items in few bits.
    fn ways(&self) -> Vec<Way<'_>> {
        let mut ways = Vec::new();
        for (structure, indexes) in &self.structures {
            for (i, views) in self.views.iter().enumerate() {
                ways.push(Way {
                    structure,
                    views,
                    index: Ok(indexes.of(views.culling.test)),
                    of: Answers::Scene(i),
                });
            }
        }
        for (i, stored) in self.stored.iter().enumerate() {
            for test in [CullingTest::SixPlane, CullingTest::Exact] {
                let culling = Culling {
                    test,
                    ..Culling::default()
                };
                let views = self.views.iter().filter(|views| views.culling == culling);
                ways.extend(views.map(|views| Way {
                    structure: &stored.label,
                    views,
                    index: stored.index.as_ref().map(|index| index as &dyn DynIndex),
                    of: Answers::Stored(i),
                }));
            }
        }
        ways
    }
}

impl Way<'_> {
    fn is_default(&self) -> bool {
        self.views.culling == Culling::default()
    }

    /// Ready to be timed.
    fn competitor(&self, expected: &[u64]) -> Competitor<'_> {
        let views = &self.views.views;
        Competitor {
            ask: match self.index {
                Ok(index) => Box::new(move |n, out| index.see(views[n].as_any(), out)),
                Err(_) => Box::new(|_, _| ()),
            },
            ask_many: None,
            expected: expected.to_vec(),
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
    pub plan: PointPlan,
    /// Place of the twin's original among those that are timed.
    twin: Option<usize>,
    precision: Precision,
}

/// What a diagram is drawn of.
#[derive(Clone, Copy)]
pub struct PrecisionInput<'a> {
    pub scene: &'a Scene,
    pub path: &'a CameraPath,
    pub structures: &'a [StructureSpec],
    /// Of the path, evenly spread.
    pub most_cameras: usize,
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
    let built = Built::new(scene, input.path, input.structures, input.most_cameras)?;
    let cameras = built.cameras.iter();
    // A frame always makes a pose.
    let truths: Vec<Truth> = cameras.filter_map(|c| Truth::of_scene(c, scene)).collect();
    let mut judge = Judge {
        scene,
        truths,
        judged: Vec::new(),
    };
    let ways = built.ways();
    let (mut points, mut timed, mut competitors) = (Vec::new(), Vec::new(), Vec::new());
    let mut twin = None;
    for way in &ways {
        if stop() {
            return Ok(None);
        }
        let judged = judge.judged(&built, way);
        let mut point = Point::new(way.structure, judged);
        if let Ok(index) = way.index {
            point.memory(index.memory(), scene.items.len());
            if judged.refused.is_none() {
                match checked(index, &way.views.views, judged, scene.items.len()) {
                    Ok(()) => {
                        if twin.is_none() && way.is_default() {
                            twin = Some(timed.len());
                        }
                        timed.push(points.len());
                        competitors.push(way.competitor(&judged.counts()));
                    }
                    Err(wrong) => (point.status, point.reason) = (wrong.status, wrong.reason),
                }
            }
        }
        points.push(point);
    }
    if let Some(original) = twin {
        let expected = competitors[original].expected.clone();
        competitors.push(ways[timed[original]].competitor(&expected));
        timed.push(timed[original]);
    }
    let cameras = built.cameras.len();
    let schedule = Schedule::new(cameras, &competitors, input.protocol);
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
            expected: competitors.into_iter().map(|c| c.expected).collect(),
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
    let built = Built::new(
        input.scene,
        input.path,
        input.structures,
        input.most_cameras,
    )?;
    let ways = built.ways();
    let planned = plan.timed.iter().zip(&plan.expected);
    let competitors: Vec<Competitor> = planned
        .map(|(&point, expected)| ways[point].competitor(expected))
        .collect();
    let timed = timed(&competitors, &plan.schedule, input.protocol, stop);
    Ok(timed.map(|timed| {
        let by_camera = timed.iter().map(|timed| match timed {
            Ok(timed) => by_camera(timed, built.cameras.len()),
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

/// What is right, found once for all structures.
struct Judge<'a> {
    scene: &'a Scene,
    truths: Vec<Truth>,
    judged: Vec<((Answers, CullingTest), Judged)>,
}

impl Judge<'_> {
    fn judged(&mut self, built: &Built, way: &Way) -> &Judged {
        let key = (way.of, way.views.culling.test);
        let known = self.judged.iter().position(|(known, _)| *known == key);
        let place = known.unwrap_or_else(|| {
            let judged = match (way.of, way.index) {
                (_, Err(error)) => Judged::refused(way.views.culling, error),
                (Answers::Scene(_), _) => {
                    self.judge(&way.views.culling.test.items(&self.scene.items), way)
                }
                (Answers::Stored(i), _) => {
                    let index = built.stored[i].index.as_ref().ok();
                    let items = index.map(|by| by.index.decoded(self.scene.items.len()));
                    self.judge(&items.unwrap_or_default(), way)
                }
            };
            self.judged.push((key, judged));
            self.judged.len() - 1
        });
        &self.judged[place].1
    }

    fn judge(&self, items: &[Aabb], way: &Way) -> Judged {
        Judged::new(self.scene, items, way.views, &self.truths)
    }
}

/// Asks every query once; what was wrong, if anything.
fn checked(
    index: &dyn DynIndex,
    views: &[CameraView],
    judged: &Judged,
    items: usize,
) -> Result<(), Verdict> {
    let mut trial = Trial::new(items);
    for (view, answer) in views.iter().zip(&judged.answers) {
        trial.expect(answer.iter().copied());
        trial
            .ask(|out| index.see(view.as_any(), out))
            .map_err(|fault| Verdict::new(Status::of(&fault), fault.explained(|_| None)))?;
    }
    Ok(())
}
