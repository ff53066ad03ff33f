//! Points of the diagrams of one scene and path: every structure with every
//! culling, checked, judged against the exact truth, and timed side by side; and region
//! search likewise.

use serde::Serialize;

use super::judged::{CullingErrors, Judged, Shots, Truths};
use super::point::{Point, sort_and_mark};
use super::region_search::{POINTS_PER_CAMERA, RegionErrors, RegionNumbers, RegionQueries};
use super::size_sweep::SizeRow;
use super::sweeps::SweepRow;
use crate::camera::{PLANE_METHODS, PlaneOptions};
use crate::culling::{ARITHMETICS, Arithmetic, Culling, CullingTest, TESTS};
use crate::index::{BuildError, DynIndex, StructureSpec};
use crate::measure::{
    OverProcesses, ProcessTimes, Setting, Status, StudyPlan, TimedTask, Verdict, input_for,
    input_of,
};
use crate::query::ItemId;
use crate::scene::Scene;
use crate::statistics::Estimate;
use crate::verify::Trial;

/// The diagram of a scene and path.
#[derive(Clone, Default, Debug, Serialize)]
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
    /// Items left out on request (`--skip-bad-items`).
    pub skipped_items: usize,
    /// Warnings about the cameras in the scene.
    pub warnings: Vec<String>,
    /// Seed of the sweeps and of the order of the tasks.
    pub seed: u64,
    /// False positives by the size of items; empty unless requested.
    pub size_sweep: Vec<SizeRow>,
    /// Missed items of ill-conditioned cameras; empty unless requested.
    pub sweeps: Vec<SweepRow>,
}

/// The timed tasks, the same in every process.
///
/// Their indices among all ways, those of the first diagram and then those of the other;
/// true if the same is timed a second time, as a check.
pub type PointPlan = StudyPlan<(usize, bool)>;

/// All points, checked and judged, but not timed.
pub struct Prepared {
    /// Tasks of the other processes.
    pub plan: PointPlan,
    precision: Precision,
}

/// Every test with every arithmetic, with and without epsilon; every
/// derivation of the planes for the six-plane test.
fn cullings() -> Vec<Culling> {
    let standard = PlaneOptions::default();
    let bare = standard.without_epsilon();
    let mut all = Vec::new();
    for (test, ..) in TESTS {
        for (arithmetic, ..) in ARITHMETICS {
            let options = [bare, standard].into_iter();
            // f64 has no epsilon.
            let options = options.take(if arithmetic == Arithmetic::F64 { 1 } else { 2 });
            all.extend(options.map(|planes| Culling::new(test, arithmetic, planes)));
        }
    }
    let others = PLANE_METHODS.into_iter().map(|(method, ..)| method);
    let others = others.filter(|method| *method != standard.method);
    let others = others.map(|method| PlaneOptions { method, ..bare });
    all.extend(others.map(|planes| Culling::new(CullingTest::SixPlane, Arithmetic::F32, planes)));
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
            spec.build(input_for(test, scene, &items))
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
    /// Structures that refuse the items, and are left out.
    refused: Vec<&'a str>,
    queries: RegionQueries<'a>,
}

/// One way to answer the queries of a diagram.
#[derive(Clone, Copy)]
enum Way<'b> {
    /// A structure with a culling.
    Culling(&'b Indexes<'b>, &'b Judged),
    /// Region search by a structure, or by a loop over all regions.
    Region(Option<&'b Indexes<'b>>, RegionNumbers),
}

impl<'a> Built<'a> {
    fn new(
        setting: &'a Setting,
        shots: &Shots,
        truths: Option<&Truths>,
    ) -> Result<Built<'a>, BuildError> {
        let (scene, structures) = (&setting.scene, &setting.structures);
        let judge = |culling| Judged::new(scene, shots, truths, culling);
        let (mut built, mut refused) = (Vec::new(), Vec::new());
        for spec in structures {
            match Indexes::new(spec, scene) {
                // The same in every process; where memory lacks, a plan would not hold.
                Err(BuildError::Refused { .. }) if refused.len() + 1 < structures.len() => {
                    refused.push(spec.label.as_str());
                }
                indexes => built.push(indexes?),
            }
        }
        Ok(Built {
            judged: cullings().into_iter().map(judge).collect(),
            structures: built,
            refused,
            queries: RegionQueries::new(scene, shots),
        })
    }

    /// All ways to cull, then all ways to search for a region: f32 by every structure,
    /// the other numbers by a loop, where the regions are their boxes.
    fn ways(&self) -> Vec<Way<'_>> {
        use RegionNumbers::{Checked, Exact, F32, F64};
        let structures = self.structures.iter();
        let culled = structures.clone().flat_map(|indexes| {
            let judged = self.judged.iter();
            judged.map(move |judged| Way::Culling(indexes, judged))
        });
        let searched = structures.map(Some);
        let searched = searched.flat_map(|own| [F32, Checked].map(|n| Way::Region(own, n)));
        let scans = [F64, Exact].map(|numbers| Way::Region(None, numbers));
        let is_fair = |way: &Way| !matches!(way, Way::Region(_, n) if !self.queries.compares(*n));
        let searched = searched.chain(scans).filter(is_fair);
        culled.chain(searched).collect()
    }

    /// Appends the answer to the query of a camera.
    fn answer(&self, way: Way, camera: usize, out: &mut Vec<ItemId>) {
        match way {
            Way::Culling(indexes, judged) => {
                let index = indexes.of(judged.culling.test);
                index.query(judged.views[camera].as_any(), out);
            }
            Way::Region(indexes, numbers) => {
                let index = indexes.map(Indexes::regions);
                self.queries.answer((numbers, index), camera, out);
            }
        }
    }

    /// Compares the answers of a way to cull with those of the plain loop.
    fn check(&self, way: Way, judged: &Judged, items: usize) -> Result<(), Verdict> {
        let mut trial = Trial::new(items);
        for (n, answer) in judged.answers.iter().enumerate() {
            trial.expect(answer.iter().copied());
            if let Err(fault) = trial.ask(|out| self.answer(way, n, out)) {
                let place = "not the scan of its own planes: ";
                let mut verdict = Verdict::of(&fault, place, |_| None);
                if verdict.status == Status::Unsafe {
                    // Not a point that misses items by its numbers: the structure is at fault.
                    verdict.status = Status::Wrong;
                }
                return Err(verdict);
            }
        }
        Ok(())
    }
}

/// Checks and judges all points, and plans how they are timed.
/// [`time`] and [`Prepared::conclude`] follow.
///
/// Every answer is compared with the plain loop before it is timed, and the
/// plain loop with the exact truth: O(cameras * items) verdicts of some 50 ns
/// and as many plain tests for each culling, twice for what changes from frame to
/// frame. Of the path at most `most` cameras are looked at, evenly spread.
///
/// # Errors
/// A structure that refuses the scene.
pub fn prepare(setting: &Setting, most: usize) -> Result<Prepared, BuildError> {
    let Setting { scene, path, .. } = setting;
    let items = scene.items.len();
    let shots = Shots::of(path, most);
    let cameras = shots.cameras.len();
    let built = Built::new(setting, &shots, Some(&shots.truths(scene)))?;
    let region_judged = built.queries.judged();
    let (mut points, mut region_points) = (Vec::new(), Vec::new());
    let (mut tasks, mut twin) = (Vec::new(), None);
    for (index, way) in built.ways().into_iter().enumerate() {
        let (is_sound, answers) = match way {
            Way::Culling(indexes, judged) => {
                let test = judged.culling.test;
                let memory = indexes.of(test).memory().total() as f64 / items as f64;
                let mut point = judged.point(indexes.structure, memory);
                let is_made = judged.refused.is_none();
                let is_sound =
                    is_made && point.accepts(built.check(way, judged, items).err().as_ref());
                points.push(point);
                (is_sound, &judged.answers)
            }
            Way::Region(indexes, numbers) => {
                let judged = &region_judged[numbers as usize];
                let mut point = judged.point(indexes.map_or("scan", |own| own.structure));
                let agrees = built.queries.agree(judged, indexes.map(Indexes::regions));
                let other = || Verdict::new(Status::Wrong, "other regions");
                let is_sound = point.accepts((!agrees).then(other).as_ref());
                region_points.push(point);
                (is_sound, &judged.answers)
            }
        };
        if !is_sound {
            continue;
        }
        let built = &built;
        let task = |is_twin| {
            let expected = answers.iter().map(|ids| ids.len() as u64).collect();
            let ask = move |n: usize, out: &mut Vec<ItemId>| built.answer(way, n, out);
            ((index, is_twin), TimedTask::new(expected, ask))
        };
        tasks.push(task(false));
        if let Way::Culling(_, judged) = way
            && judged.culling == Culling::default()
        {
            twin.get_or_insert_with(|| task(true));
        }
    }
    tasks.extend(twin);
    let plan = StudyPlan::new(tasks, cameras, &setting.protocol);
    let mut warnings = path.warnings(scene);
    let left_out = |name| format!("left out: {name} refuses these items");
    warnings.extend(built.refused.iter().map(left_out));
    Ok(Prepared {
        precision: Precision {
            scene: scene.name.clone(),
            path: path.name.clone(),
            items,
            cameras,
            rounds: plan.schedule.rounds as usize,
            points,
            region_points,
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
    let shots = Shots::of(&setting.path, most);
    let built = Built::new(setting, &shots, None)?;
    let (built, ways) = (&built, built.ways());
    let timed = plan.timed(&setting.protocol, |&(way, _)| {
        let way = ways[way];
        Box::new(move |n, out| built.answer(way, n, out))
    });
    Ok(ProcessTimes::of(&timed))
}

impl Prepared {
    /// The diagram from the times of all processes.
    pub fn conclude(self, processes: &[ProcessTimes]) -> Precision {
        let (mut precision, plan) = (self.precision, self.plan);
        let times = OverProcesses::of(processes);
        // The twin comes last: the first task of its way is the original.
        let original = |way| plan.tasks.iter().position(|(own, _)| own.0 == way);
        let keys = plan.tasks.iter().map(|(key, _)| *key);
        for (task, (way, is_twin)) in keys.enumerate() {
            if is_twin {
                precision.twin = original(way).and_then(|own| times.ratio(task, own));
            } else if let Some(point) = precision.points.get_mut(way) {
                point.time(&times, task, 1.0);
                let ns = point.query_ns();
                point.errors.ns_per_item = ns.map(|ns| ns / precision.items as f64);
            } else {
                let point = &mut precision.region_points[way - precision.points.len()];
                point.time(&times, task, POINTS_PER_CAMERA as f64);
            }
        }
        let is_faster = |a: usize, b: usize| times.is_faster(a, b);
        let points = &mut precision.points;
        sort_and_mark(points, &is_faster);
        precision.front = (0..points.len()).filter(|&i| points[i].on_front).collect();
        sort_and_mark(&mut precision.region_points, &is_faster);
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
