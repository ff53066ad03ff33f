//! Points of the diagram of one scene and path.
//!
//! Combines every structure with every culling, compares the answers with the exact truth, and
//! times them side by side.

use serde::Serialize;

use super::culling_result::CullingResult;
use super::point::{Point, sort_and_mark};
use super::sweeps::SweepRow;
use crate::camera::{Camera, PLANE_METHODS, PlaneOptions};
use crate::culling::{Arithmetic, Culling, CullingTest};
use crate::index::{BuildError, DynIndex, StructureSpec};
use crate::measure::{ProcessTimes, Setting, Status, StudyPlan, TimedTask, Verdict, input_for};
use crate::query::ItemId;
use crate::scene::Scene;
use crate::statistics::Estimate;
use crate::verify::{Trial, Truth};

/// The diagram of a scene and path.
#[derive(Clone, Default, Debug, Serialize)]
pub struct Precision {
    /// Name of the scene.
    pub scene: String,
    /// Name of the path.
    pub path: String,
    /// Number of items.
    pub items: usize,
    /// Number of cameras that were evaluated and timed.
    pub cameras: usize,
    /// Number of timed processes; an interval needs three or more.
    pub processes: usize,
    /// Rounds in each process.
    pub rounds: usize,
    /// A/A check: time of a second copy of the first task / time of the first.
    ///
    /// The task is the first structure with the default culling; the interval should contain 1.
    pub twin: Option<Estimate>,
    /// Points, fastest first; those that could not be measured come last.
    pub points: Vec<Point>,
    /// Indices of the undominated points, fastest first.
    pub front: Vec<usize>,
    /// Number of items left out on request (`--skip-bad-items`).
    pub skipped_items: usize,
    /// Warnings about the cameras in the scene.
    pub warnings: Vec<String>,
    /// Seed of the sweeps and of the task order.
    pub seed: u64,
    /// Errors by item size and of ill-conditioned cameras, if requested.
    pub sweeps: Vec<SweepRow>,
}

/// Plan of the timed tasks, the same in every process.
///
/// A key is the index among all points; true marks the second copy of a task, as a check.
pub type PointPlan = StudyPlan<(usize, bool)>;

/// All points, checked and evaluated, but not timed.
pub struct UntimedDiagram {
    /// Tasks for the other processes.
    pub plan: PointPlan,
    precision: Precision,
}

/// All cullings: every test with every arithmetic, with and without epsilon.
///
/// Also every derivation of the planes, for the six-plane test.
fn cullings() -> Vec<Culling> {
    let standard = PlaneOptions::default();
    let bare = standard.without_epsilon();
    let all = Culling::all(standard).flat_map(|culling| {
        // f64 has no epsilon.
        let moved = (culling.arithmetic != Arithmetic::F64).then_some(standard);
        let options = [Some(bare), moved].into_iter().flatten();
        options.map(move |planes| Culling { planes, ..culling })
    });
    let others = PLANE_METHODS.into_iter().map(|(method, ..)| method);
    let others = others.filter(|method| *method != standard.method);
    let others = others.map(|method| PlaneOptions { method, ..bare });
    let others = others.map(|planes| Culling::new(CullingTest::SixPlane, Arithmetic::F32, planes));
    all.chain(others).collect()
}

/// A structure over the boxes, and over the cubes of the sphere test.
struct Indexes<'a> {
    structure: &'a str,
    boxes: Box<dyn DynIndex>,
    cubes: Box<dyn DynIndex>,
}

impl<'a> Indexes<'a> {
    fn new(spec: &'a StructureSpec, scene: &Scene) -> Result<Indexes<'a>, BuildError> {
        let over = |test: CullingTest| {
            let items = test.items(&scene.items);
            spec.build(input_for(test, scene, &items))
        };
        Ok(Indexes {
            structure: &spec.label,
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

/// Input of all points, the same in every process.
struct Inputs<'a> {
    results: Vec<CullingResult>,
    structures: Vec<Indexes<'a>>,
    /// Structures that refuse the items and are left out.
    refused: Vec<&'a str>,
}

/// A structure with a culling.
#[derive(Clone, Copy)]
struct Subject<'b> {
    indexes: &'b Indexes<'b>,
    result: &'b CullingResult,
}

impl<'a> Inputs<'a> {
    fn new(
        setting: &'a Setting,
        cameras: &[Camera],
        truths: &[Truth],
    ) -> Result<Inputs<'a>, BuildError> {
        let (scene, structures) = (&setting.scene, &setting.structures);
        let evaluate = |culling| CullingResult::new(scene, cameras, truths, culling);
        let (mut built, mut refused) = (Vec::new(), Vec::new());
        for spec in structures {
            match Indexes::new(spec, scene) {
                // Refusals are the same in every process; a lack of memory is not, so no plan could
                // rely on it.
                Err(BuildError::Refused { .. }) if refused.len() + 1 < structures.len() => {
                    refused.push(spec.label.as_str());
                }
                indexes => built.push(indexes?),
            }
        }
        Ok(Inputs {
            results: cullings().into_iter().map(evaluate).collect(),
            structures: built,
            refused,
        })
    }

    /// Every structure with every culling.
    fn subjects(&self) -> Vec<Subject<'_>> {
        let subjects = self.structures.iter().flat_map(|indexes| {
            let results = self.results.iter();
            results.map(move |result| Subject { indexes, result })
        });
        subjects.collect()
    }
}

impl Subject<'_> {
    /// Appends the answer to the query of a camera.
    fn answer(self, camera: usize, out: &mut Vec<ItemId>) {
        let index = self.indexes.of(self.result.culling.test);
        index.query(self.result.views[camera].as_any(), out);
    }

    /// Compares the answers with those of the linear scan.
    fn check(self, items: usize) -> Result<(), Verdict> {
        let mut trial = Trial::new(items);
        for (n, answer) in self.result.answers.iter().enumerate() {
            trial.set_expected(answer.iter().copied());
            if let Err(fault) = trial.run(|out| self.answer(n, out)) {
                let place = "not the scan of its own planes: ";
                let mut verdict = Verdict::of(&fault, place, |_| None);
                if verdict.status == Status::Unsafe {
                    // The numbers are not the reason for the missing items: the structure is at
                    // fault.
                    verdict.status = Status::Wrong;
                }
                return Err(verdict);
            }
        }
        Ok(())
    }
}

/// Checks and evaluates all points, and plans their timing.
///
/// [`time`] and [`UntimedDiagram::conclude`] follow. Every answer is compared with the linear scan
/// before it is timed, and the scan with the exact truth: O(cameras * items) verdicts of some 50 ns
/// and as many plain tests for each culling. At most `most` cameras of the path are used, evenly
/// spread.
///
/// # Errors
/// A structure that refuses the scene.
pub fn prepare(setting: &Setting, most: usize) -> Result<UntimedDiagram, BuildError> {
    let Setting { scene, path, .. } = setting;
    let items = scene.items.len();
    let cameras = path.clone().at_most(most.max(1)).cameras;
    // A frame always makes a pose.
    let truths = cameras.iter().filter_map(|c| Truth::of_scene(c, scene));
    let truths: Vec<Truth> = truths.collect();
    let inputs = Inputs::new(setting, &cameras, &truths)?;
    let cameras = cameras.len();
    let (mut points, mut tasks, mut twin) = (Vec::new(), Vec::new(), None);
    for (index, subject) in inputs.subjects().into_iter().enumerate() {
        let Subject { indexes, result } = subject;
        let memory = indexes.of(result.culling.test).memory().total() as f64 / items as f64;
        let mut point = Point::of(result, indexes.structure, memory);
        let is_made = result.refused.is_none();
        let is_sound = is_made && point.accepts(subject.check(items).err().as_ref());
        points.push(point);
        if !is_sound {
            continue;
        }
        let task = |is_twin| {
            let expected = result.answers.iter().map(|ids| ids.len() as u64).collect();
            let ask = move |n: usize, out: &mut Vec<ItemId>| subject.answer(n, out);
            ((index, is_twin), TimedTask::new(expected, ask))
        };
        tasks.push(task(false));
        if result.culling == Culling::default() {
            twin.get_or_insert_with(|| task(true));
        }
    }
    tasks.extend(twin);
    let plan = StudyPlan::new(tasks, cameras, &setting.protocol);
    let mut warnings = crate::path::warnings(scene, &path.name, &path.cameras);
    let left_out = |name| format!("left out: {name} refuses these items");
    warnings.extend(inputs.refused.iter().map(left_out));
    Ok(UntimedDiagram {
        precision: Precision {
            scene: scene.name.clone(),
            path: path.name.clone(),
            items,
            cameras,
            rounds: plan.schedule.rounds as usize,
            points,
            skipped_items: scene.skipped_items,
            warnings,
            ..Precision::default()
        },
        plan,
    })
}

/// Times the planned tasks in this process.
///
/// # Errors
/// A structure that refuses the scene.
///
/// # Panics
/// If the scene is not the one that was planned for.
pub fn time(setting: &Setting, most: usize, plan: &PointPlan) -> Result<ProcessTimes, BuildError> {
    let cameras = setting.path.clone().at_most(most.max(1)).cameras;
    let inputs = Inputs::new(setting, &cameras, &[])?;
    let subjects = inputs.subjects();
    Ok(plan.timed(&setting.protocol, |&(index, _)| {
        let subject = subjects[index];
        Box::new(move |n, out| subject.answer(n, out))
    }))
}

impl UntimedDiagram {
    /// Builds the diagram from the times of all processes.
    pub fn conclude(self, processes: &[ProcessTimes]) -> Precision {
        let (mut precision, times) = (self.precision, self.plan.times(processes));
        let twin = self.plan.tasks.iter().find(|(key, _)| key.1);
        precision.twin = twin.and_then(|&((n, _), _)| times.ratio((n, true), (n, false)));
        let points = &mut precision.points;
        for (index, point) in points.iter_mut().enumerate() {
            point.time(&times, index, precision.items);
        }
        sort_and_mark(points);
        precision.front = (0..points.len()).filter(|&i| points[i].on_front).collect();
        precision.processes = processes.len();
        precision
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::index::Row;
    use crate::measure::Protocol;

    fn linear_as(label: &str, change: impl FnOnce(&mut Row)) -> StructureSpec {
        let mut linear = StructureSpec::parse("linear").expect("linear");
        label.clone_into(&mut linear.label);
        change(&mut linear.row);
        linear
    }

    #[test]
    fn structures_that_lose_items_are_wrong_and_those_that_refuse_them_left_out() {
        let linear = StructureSpec::parse("linear").expect("linear");
        let blind = linear_as("blind", |row| {
            row.build = |_, _, _| {
                let linear = StructureSpec::parse("linear").expect("linear");
                linear.build(&[][..])
            };
        });
        let shy = linear_as("shy", |row| {
            row.build = |_, _, _| {
                let (structure, reason) = ("shy", "too many".to_owned());
                Err(BuildError::Refused { structure, reason })
            };
        });
        let scene = crate::scene::load("city:n=200", &Default::default()).expect("a city");
        let path = crate::path::load("orbit:frames=3", &scene, &Default::default());
        let mut setting = Setting {
            path: path.expect("a path"),
            scene,
            structures: vec![linear, blind, shy.clone()],
            protocol: Protocol {
                rounds: [1, 1],
                cameras: 3,
                seed: 1,
                ..Protocol::default()
            },
        };
        let precision = prepare(&setting, 3).expect("two structures").precision;
        let left_out = "left out: shy refuses these items".to_owned();
        assert!(precision.warnings.contains(&left_out));
        for point in precision.points {
            let reason = point.reason.unwrap_or_default();
            let is_wrong = point.status == Status::Wrong && reason.contains("own planes");
            assert_eq!(is_wrong, point.structure == "blind", "{:?}", point.status);
        }
        setting.structures = vec![shy];
        assert!(prepare(&setting, 3).is_err());
    }
}
