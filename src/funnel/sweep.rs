//! Error against run time of one stage.
//!
//! A point has the false negatives, false positives and time of a back end; the occlusion
//! stage has a point for each of several sizes of its buffer.
//! The truth has rays between the samples too, so that no size of a buffer judges itself.

use anyhow::Result;
use serde::Serialize;

use super::item_stages::ItemStages;
use super::stage::{BackEnd, Chain, NONE, StageKind};
use super::triangle_stage::TriangleStage;
use super::truth::{Errors, Truth, ViewCounts, count_items, visible};
use super::world::{FunnelInput, World};
use crate::measure::{Ask, ProcessTimes, Setting, StudyPlan};
use crate::statistics::{Estimate, dominance, flat};
use crate::visibility::SampleGrid;

/// Columns of the buffers; there are 9 rows for 16 of them.
pub const WIDTHS: [u32; 7] = [40, 80, 160, 320, 640, 1280, 1920];
/// Random rays of a view, beside the samples.
const RAYS: usize = 100_000;

/// One back end, with one size of its buffer.
#[derive(Clone, Debug, Serialize)]
pub struct SweepPoint {
    /// The back end.
    #[serde(flatten)]
    pub back_end: BackEnd,
    /// Columns and rows of its buffer; null where it has none.
    pub buffer: Option<[u32; 2]>,
    /// Errors against the truth.
    #[serde(flatten)]
    pub errors: Errors,
    /// Thread CPU time of a view.
    #[serde(flatten, serialize_with = "flat::stage_ns")]
    pub time: Option<Estimate>,
    /// `true` for a point of the Pareto front of time and both errors.
    ///
    /// No other point has fewer errors in these views, or is shown to be faster, and is as
    /// good in the rest.
    pub on_front: bool,
}

impl SweepPoint {
    /// Time, false negatives, false positives.
    fn figures(&self) -> Option<[f64; 3]> {
        let errors = &self.errors;
        let ns = self.time?.value;
        Some([ns, errors.false_negative_count, errors.false_positive_count])
    }
}

/// The points of a stage.
#[derive(Clone, Debug, Serialize)]
pub struct StageSweep {
    /// Scene as typed.
    pub scene: String,
    /// Path as typed.
    pub path: String,
    /// The stage.
    pub stage: StageKind,
    /// Number of views.
    pub views: usize,
    /// Random rays of each view that are the truth together with its samples.
    pub rays_per_view: usize,
    /// Number of timed processes.
    pub processes: usize,
    /// In the order of the table of back ends, small buffers first.
    pub points: Vec<SweepPoint>,
    /// Warnings about the cameras in the scene.
    pub warnings: Vec<String>,
}

/// Tasks of the points, by their indices.
pub type SweepPlan = StudyPlan<usize>;

/// A compared sweep before its times.
pub struct PreparedSweep {
    /// Tasks and schedule for all processes.
    pub plan: SweepPlan,
    sweep: StageSweep,
}

/// A stage on the items that it gets in each view.
struct Swept<'w> {
    stage: StageKind,
    /// Items that the frustum meets.
    items: ItemStages<'w>,
    /// Triangles of the items that occlusion leaves, of the triangle stage.
    triangles: Option<TriangleStage>,
}

impl<'w> Swept<'w> {
    fn new(world: &'w World<'w>, chain: &Chain, stage: StageKind) -> Swept<'w> {
        let steps = match stage {
            StageKind::Region => Vec::new(),
            StageKind::Triangle => chain.steps(),
            _ => Chain::empty().steps_with(StageKind::Object, chain.of(StageKind::Object)),
        };
        let items = ItemStages::of(world, &steps);
        let is_of_triangles = stage == StageKind::Triangle;
        Swept {
            triangles: is_of_triangles.then(|| TriangleStage::new(&items)),
            stage,
            items,
        }
    }

    /// Every back end with every size of its buffer, and its question.
    fn points(&self) -> Vec<(BackEnd, Option<[u32; 2]>, Ask<'_>)> {
        let sized = WIDTHS.map(|width| Some([width, (width * 9).div_ceil(16)]));
        let sizes = match self.stage {
            StageKind::Occlusion => &sized[..],
            _ => &[None],
        };
        let rows = self.items.world.rows(self.stage).into_iter();
        let rows = rows.map(|(row, _)| row).filter(|row| row.name != NONE);
        let points = rows.flat_map(|row| sizes.iter().map(move |size| (row, *size)));
        let points = points.map(|(row, size)| (row, size, self.ask(row.name, size)));
        points.collect()
    }

    fn ask(&self, name: &'static str, buffer: Option<[u32; 2]>) -> Ask<'_> {
        if let Some(triangles) = &self.triangles {
            return triangles.ask(name);
        }
        let sized = |[width, height]: [u32; 2]| SampleGrid::new(width, height);
        let buffer = buffer.map_or(self.items.world.samples, sized);
        let run = self.items.world.run(self.stage, name, buffer);
        Box::new(move |view, out| run(view, self.items.remaining(view), out))
    }

    fn counts(&self, back_end: &BackEnd, ask: &Ask, truth: &Truth) -> Vec<ViewCounts> {
        if let Some(triangles) = &self.triangles {
            return triangles.counts(back_end.name);
        }
        let count = |view: usize| {
            let mut out = Vec::new();
            ask(view, &mut out);
            out.sort_unstable();
            let given = self.items.remaining(view);
            count_items(given, self.items.world.items(), &out, &truth[view])
        };
        self.items.world.views().map(count).collect()
    }
}

/// Compares all points of a stage with the truth.
///
/// # Errors
/// The errors of [`prepare`](super::prepare).
pub fn prepare_sweep(input: &FunnelInput, stage: StageKind) -> Result<PreparedSweep> {
    let Setting { scene, path, .. } = input.setting;
    let world = World::new(input, &|_| ())?;
    let swept = Swept::new(&world, &input.chain, stage);
    // The side of a triangle needs no rays.
    let (rays, truth) = match stage {
        StageKind::Triangle => (0, Truth::new()),
        _ => (RAYS, visible(&world, RAYS, input.execution.threads)?),
    };
    let (mut points, mut tasks) = (Vec::new(), Vec::new());
    for (back_end, buffer, ask) in swept.points() {
        points.push(SweepPoint {
            back_end,
            buffer,
            errors: Errors::of(&swept.counts(&back_end, &ask, &truth)),
            time: None,
            on_front: false,
        });
        tasks.push((tasks.len(), ask));
    }
    Ok(PreparedSweep {
        plan: SweepPlan::of(tasks, world.views.len(), input),
        sweep: StageSweep {
            scene: scene.name.clone(),
            path: path.name.clone(),
            stage,
            views: world.views.len(),
            rays_per_view: rays,
            processes: 0,
            points,
            warnings: path.warnings(scene),
        },
    })
}

/// Times of one process.
///
/// # Errors
/// The errors of [`prepare_sweep`].
pub fn time_sweep(input: &FunnelInput, stage: StageKind, plan: &SweepPlan) -> Result<ProcessTimes> {
    let world = World::new(input, &|_| ())?;
    let swept = Swept::new(&world, &input.chain, stage);
    let asks = swept.points().into_iter().map(|(.., ask)| ask);
    Ok(plan.time(asks.enumerate().collect(), input))
}

impl PreparedSweep {
    /// The points with the times of all processes.
    pub fn conclude(self, processes: &[ProcessTimes]) -> StageSweep {
        let times = self.plan.times(processes);
        let mut sweep = self.sweep;
        sweep.processes = processes.len();
        for (key, point) in sweep.points.iter_mut().enumerate() {
            point.time = times.ns(key);
        }
        let all = sweep.points.iter().enumerate();
        let (timed, values): (Vec<usize>, Vec<[f64; 3]>) =
            all.filter_map(|(i, p)| Some((i, p.figures()?))).unzip();
        let is_less = |a: usize, b: usize, k: usize| k > 0 || times.is_faster(timed[a], timed[b]);
        for (&i, found) in timed.iter().zip(dominance(&values, &is_less)) {
            sweep.points[i].on_front = found.dominated_by.is_none();
        }
        sweep
    }
}
