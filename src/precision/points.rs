//! Measuring the points of the diagram for one scene and path: every structure
//! with every culling, checked, judged against the exact truth, and timed side
//! by side.

use serde::Serialize;

use super::judged::Judged;
use super::point::{Point, mark_dominated, noise_floor};
use super::stability::{StableAfter, stability};
use crate::camera::{Camera, PLANE_METHODS, PlaneMethod, PlaneOptions};
use crate::culling::{ARITHMETICS, Arithmetic, Culling, CullingTest, TESTS};
use crate::index::{
    BuildError, By, DynIndex, GridScope, Quantised, QuantisedParams, RegionIndex, StructureSpec,
};
use crate::kernel::Kernel;
use crate::measure::{Competitor, Protocol, Status, Verdict, timed_rounds};
use crate::path::CameraPath;
use crate::scene::Scene;
use crate::verify::{Trial, Truth};

/// The diagram of a scene and path.
#[derive(Clone, Debug, Serialize)]
pub struct Precision {
    pub scene: String,
    pub path: String,
    pub items: usize,
    pub cameras: usize,
    pub rounds: usize,
    /// Largest |ratio - 1| of a structure entered twice with the default
    /// culling: smaller differences of time are ties.
    pub noise_floor: f64,
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
    index: Option<Box<dyn DynIndex>>,
    judged: Vec<Judged>,
}

/// u8 and u16 codes, on one grid or on one for each block, with the default
/// view and with the exact test.
fn quantised(kernel: Kernel, scene: &Scene, cameras: &[Camera], truths: &[Truth]) -> Vec<Stored> {
    let cullings = [CullingTest::SixPlane, CullingTest::Exact].map(|test| Culling {
        test,
        ..Culling::default()
    });
    let mut all = Vec::new();
    for bits in [8, 16] {
        for grid in [GridScope::World, GridScope::Block] {
            let scope = match grid {
                GridScope::World => "world",
                GridScope::Block => "block",
            };
            let label = format!("{}:bits={bits},grid={scope}", Quantised::INFO.name);
            let params = QuantisedParams { bits, grid };
            let stored = match Quantised::build(&scene.items, None, &params) {
                Ok(index) => {
                    let items = index.decoded(scene.items.len());
                    let judged = cullings
                        .map(|culling| Judged::new(scene, &items, cameras, truths, culling));
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
            };
            all.push(stored);
        }
    }
    all
}

/// The cameras that are looked at: at most `most`, evenly spread.
fn cameras_of(path: &CameraPath, most: usize) -> Vec<Camera> {
    let count = path.cameras.len();
    let wanted = most.max(1).min(count);
    let chosen = (0..wanted).map(|i| path.cameras[i * count / wanted]);
    chosen.collect()
}

/// Measures all points; `None` if stopped.
///
/// Every answer is compared with the plain loop before it is timed, and the
/// plain loop with the exact truth: O(cameras * items) verdicts of some 50 ns
/// and as many plain tests for each culling.
///
/// # Errors
/// A structure that refuses the scene.
pub fn measure_points(
    scene: &Scene,
    path: &CameraPath,
    structures: &[StructureSpec],
    most_cameras: usize,
    protocol: &Protocol,
    stop: &dyn Fn() -> bool,
) -> Result<Option<Precision>, BuildError> {
    let cameras = cameras_of(path, most_cameras);
    let truths = cameras.iter().filter_map(|camera| {
        // A frame always makes a pose.
        Truth::of_scene(camera, scene)
    });
    let truths: Vec<Truth> = truths.collect();
    let mut judged = Vec::new();
    for culling in cullings() {
        if stop() {
            return Ok(None);
        }
        let items = culling.test.items(&scene.items);
        judged.push(Judged::new(scene, &items, &cameras, &truths, culling));
    }
    let specs = structures.first().map(|spec| spec.execution);
    let kernel = specs.unwrap_or_default().kernel;
    let quantised = quantised(kernel, scene, &cameras, &truths);
    drop(truths);
    let mut indexes = Vec::with_capacity(structures.len());
    for spec in structures {
        indexes.push(Indexes::new(spec, scene)?);
    }
    let mut points = Vec::new();
    // Which of the points are timed, in the order of the competitors.
    let mut timed_points = Vec::new();
    let mut competitors = Vec::new();
    for (spec, indexes) in structures.iter().zip(&indexes) {
        for judged in &judged {
            let index = indexes.of(judged.culling.test);
            let mut point = Point::new(&spec.label, judged);
            point.memory(index.memory(), scene.items.len());
            if judged.refused.is_none() {
                match checked(index, judged, scene.items.len()) {
                    Ok(()) => {
                        timed_points.push(points.len());
                        competitors.push(competitor(index, judged));
                    }
                    Err(wrong) => (point.status, point.reason) = (wrong.status, wrong.reason),
                }
            }
            points.push(point);
        }
    }
    for Stored {
        label,
        index,
        judged,
    } in &quantised
    {
        for judged in judged {
            let mut point = Point::new(label, judged);
            if let Some(index) = index {
                point.memory(index.memory(), scene.items.len());
                match checked(index.as_ref(), judged, scene.items.len()) {
                    Ok(()) => {
                        timed_points.push(points.len());
                        competitors.push(competitor(index.as_ref(), judged));
                    }
                    Err(wrong) => (point.status, point.reason) = (wrong.status, wrong.reason),
                }
            }
            points.push(point);
        }
    }
    // The default culling of every structure once more: what equal work looks
    // like in this run.
    let mut twins = Vec::new();
    for indexes in &indexes {
        let standard = judged.iter().find(|j| j.culling == Culling::default());
        if let Some(judged) = standard.filter(|j| j.refused.is_none()) {
            let index = indexes.of(judged.culling.test);
            twins.push(competitors.len());
            competitors.push(competitor(index, judged));
        }
    }
    let Some(mut timed) = timed_rounds(cameras.len(), &competitors, protocol, stop) else {
        return Ok(None);
    };
    let competitor_count = competitors.len();
    drop(competitors);
    let twins = timed.split_off(competitor_count - twins.len());
    let mut rounds = 0;
    let mut series = Vec::new();
    for (&place, timed) in timed_points.iter().zip(&timed) {
        match timed {
            Ok(timed) => {
                rounds = rounds.max(timed.rounds);
                points[place].time(timed, scene.items.len());
                series.push(timed);
            }
            Err(wrong) => {
                points[place].status = wrong.status;
                points[place].reason = wrong.reason.clone();
            }
        }
    }
    let stability = stability(&series, cameras.len());
    let noise_floor = noise_floor(&points, &twins);
    points.sort_by(|a, b| {
        let key = |p: &Point| p.query_ns.unwrap_or(f64::INFINITY);
        key(a).total_cmp(&key(b))
    });
    mark_dominated(&mut points, noise_floor);
    Ok(Some(Precision {
        scene: scene.name.clone(),
        path: path.name.clone(),
        items: scene.items.len(),
        cameras: cameras.len(),
        rounds,
        noise_floor,
        front: (0..points.len()).filter(|&i| points[i].on_front).collect(),
        points,
        stability,
    }))
}

fn competitor<'a>(index: &'a dyn DynIndex, judged: &'a Judged) -> Competitor<'a> {
    Competitor {
        ask: Box::new(move |n, out| index.see(judged.views[n].as_any(), out)),
        ask_many: None,
        expected: judged.answers.iter().map(|a| a.len() as u64).collect(),
        least_ns: None,
    }
}

/// Asks every query once; what was wrong, if anything.
fn checked(index: &dyn DynIndex, judged: &Judged, items: usize) -> Result<(), Verdict> {
    let mut trial = Trial::new(items);
    for (view, answer) in judged.views.iter().zip(&judged.answers) {
        trial.expect(answer.iter().copied());
        trial
            .ask(|out| index.see(view.as_any(), out))
            .map_err(|fault| Verdict::new(Status::of(&fault), fault.explained(|_| None)))?;
    }
    Ok(())
}
