//! Error against run time of one stage: what each back end loses and lets through
//! beside what it takes, the occlusion stage over the sizes of its buffer. Truth are
//! rays between the samples too, so that no size of a buffer is its own judge.

use serde::Serialize;

use super::error::FunnelError;
use super::faces::Faces;
use super::hiding::{HIDING, HidingRow};
use super::judged::{Errors, Judged, judge_items};
use super::pass::{ALL, Pass};
use super::plan::{FunnelPlan, task};
use super::seen::seen;
use super::stage::{BackEnd, NONE, StageKind};
use super::times::Times;
use super::triangle_rows;
use super::truth::Truth;
use super::world::{FunnelInput, World};
use crate::measure::{Ask, OverProcesses, ProcessTimes};
use crate::statistics::dominance;
use crate::visibility::SampleGrid;

/// Columns of the buffers that are looked at; rows are 9 for 16 of them.
pub const WIDTHS: [u32; 7] = [40, 80, 160, 320, 640, 1280, 1920];
/// Random rays of a view, beside the samples.
const RAYS: usize = 100_000;

/// One back end, at one size of its buffer.
#[derive(Clone, Debug, Serialize)]
#[non_exhaustive]
pub struct SweepPoint {
    /// What does the stage.
    #[serde(flatten)]
    pub back_end: BackEnd,
    /// Columns and rows of its buffer; null where it has none.
    pub buffer: Option<[u32; 2]>,
    /// What it let through and what it lost.
    #[serde(flatten)]
    pub errors: Errors,
    /// Thread CPU time of a view.
    #[serde(flatten)]
    pub times: Times,
    /// Whether no other point is at least as good in time and both errors, and shown
    /// to be better in one.
    pub on_front: bool,
}

/// The points of a stage.
#[derive(Clone, Debug, Serialize)]
#[non_exhaustive]
pub struct StageSweep {
    /// As it was asked for.
    pub scene: String,
    /// As it was asked for.
    pub path: String,
    /// The stage.
    pub stage: StageKind,
    /// Views that were looked at.
    pub views: usize,
    /// Random rays of each view that are the truth together with its samples.
    pub rays_per_view: usize,
    /// Processes that the times are of.
    pub processes: usize,
    /// In the order of the table of back ends, small buffers first.
    pub points: Vec<SweepPoint>,
}

/// Everything judged, and nothing timed.
pub struct PreparedSweep {
    /// What the other processes are to measure.
    pub plan: FunnelPlan,
    sweep: StageSweep,
}

/// A point, and how it is asked.
struct Entry<'w> {
    back_end: BackEnd,
    buffer: Option<SampleGrid>,
    ask: Ask<'w>,
    /// Of the triangle stage: its place among the back ends.
    faces: Option<usize>,
}

/// What the stage is given in each view, and the faces of what occlusion leaves.
struct Given<'w> {
    pass: Pass<'w>,
    set: usize,
    faces: Option<Faces>,
}

impl<'w> Given<'w> {
    fn of(
        world: &'w World<'w>,
        input: &FunnelInput,
        stage: StageKind,
        stop: &dyn Fn() -> bool,
    ) -> Option<Given<'w>> {
        let mut pass = Pass::new(world);
        let set = match (stage, input.chain.of(StageKind::Object)) {
            (StageKind::Region, _) | (_, NONE) => ALL,
            (_, name) => {
                let step = pass.step(StageKind::Object, name, ALL, stop)?;
                pass.steps()[step].output
            }
        };
        let faces = match stage {
            StageKind::Triangle => {
                let walked = pass.walk(input.chain, stop)?;
                Some(Faces::of(world, &pass, walked.left()))
            }
            _ => None,
        };
        Some(Given { pass, set, faces })
    }

    fn entries<'g>(&'g self, world: &'g World<'g>, stage: StageKind) -> Vec<Entry<'g>> {
        let given = move |view| self.pass.items(self.set, view);
        match stage {
            StageKind::Occlusion => {
                let sized = HIDING
                    .iter()
                    .flat_map(|row| WIDTHS.map(|width| (row, width)));
                let entry = |(row, width): (&'g HidingRow, u32)| {
                    let grid = SampleGrid::new(width, (width * 9).div_ceil(16));
                    let run = world.run_hiding(row, grid);
                    Entry {
                        back_end: row.back_end,
                        buffer: Some(grid),
                        ask: Box::new(move |view, out| run(view, given(view), out)),
                        faces: None,
                    }
                };
                sized.map(entry).collect()
            }
            StageKind::Triangle => {
                let rows = triangle_rows::back_ends().zip(0..);
                let entry = |(back_end, place): (BackEnd, usize)| Entry {
                    back_end,
                    buffer: None,
                    ask: Box::new(move |view, out| {
                        if let Some(faces) = &self.faces {
                            faces.cull(place, view, out);
                        }
                    }),
                    faces: Some(place),
                };
                rows.map(entry).collect()
            }
            _ => {
                let rows = world.names(stage).into_iter();
                let rows = rows.map(|name| world.back_end(stage, &name));
                let entry = |back_end: BackEnd| {
                    let run = world.run(stage, back_end.name);
                    Entry {
                        back_end,
                        buffer: None,
                        ask: Box::new(move |view, out| run(view, given(view), out)),
                        faces: None,
                    }
                };
                rows.filter(|row| row.name != NONE).map(entry).collect()
            }
        }
    }
}

/// Judges all points of a stage and plans how they are timed; `None` if stopped.
///
/// # Errors
/// As [`prepare`](super::prepare).
pub fn prepare_sweep(
    input: &FunnelInput,
    stage: StageKind,
    stop: &dyn Fn() -> bool,
) -> Result<Option<PreparedSweep>, FunnelError> {
    let world = World::new(input)?;
    let Some(given) = Given::of(&world, input, stage, stop) else {
        return Ok(None);
    };
    let entries = given.entries(&world, stage);
    // What faces the eye is no question of rays.
    let (rays, truth) = match stage {
        StageKind::Triangle => (0, Some(Truth::empty(world.views()))),
        _ => {
            let threads = input.execution.threads;
            let truth = seen(&world, input.samples, RAYS, threads, stop)?;
            (RAYS, truth)
        }
    };
    let Some(truth) = truth else {
        return Ok(None);
    };
    let (mut points, mut tasks) = (Vec::new(), Vec::new());
    for Entry {
        back_end,
        buffer,
        ask,
        faces,
    } in entries
    {
        if stop() {
            return Ok(None);
        }
        let mut counts = Vec::new();
        let mut judged: Vec<Judged> = Vec::new();
        let mut out = Vec::new();
        for view in 0..world.views() {
            out.clear();
            ask(view, &mut out);
            counts.push(out.len() as u64);
            if faces.is_none() {
                out.sort_unstable();
                let input = given.pass.items(given.set, view);
                judged.push(judge_items(input, world.items(), &out, truth.of_view(view)));
            }
        }
        if let (Some(place), Some(of_views)) = (faces, &given.faces) {
            judged = of_views.judged(Some(place));
        }
        points.push(SweepPoint {
            back_end,
            buffer: buffer.map(|grid| [grid.width, grid.height]),
            errors: Errors::of(&judged),
            times: Times::default(),
            on_front: false,
        });
        tasks.push(task(ask, counts));
    }
    Ok(Some(PreparedSweep {
        plan: FunnelPlan::of(&tasks, world.views(), input),
        sweep: StageSweep {
            scene: input.scene.name.clone(),
            path: input.path.name.clone(),
            stage,
            views: world.views(),
            rays_per_view: rays,
            processes: 0,
            points,
        },
    }))
}

/// One process's share of the times; `None` if stopped.
///
/// # Errors
/// As [`prepare_sweep`].
pub fn time_sweep(
    input: &FunnelInput,
    stage: StageKind,
    plan: &FunnelPlan,
    stop: &dyn Fn() -> bool,
) -> Result<Option<ProcessTimes>, FunnelError> {
    let world = World::new(input)?;
    let Some(given) = Given::of(&world, input, stage, stop) else {
        return Ok(None);
    };
    let entries = given.entries(&world, stage).into_iter().zip(&plan.expected);
    let tasks = entries.map(|(entry, expected)| task(entry.ask, expected.clone()));
    Ok(plan.time(&tasks.collect::<Vec<_>>(), input, stop))
}

impl PreparedSweep {
    /// The points with the times of all processes.
    pub fn conclude(self, processes: &[ProcessTimes]) -> StageSweep {
        let times = OverProcesses::of(processes);
        let mut sweep = self.sweep;
        sweep.processes = processes.len();
        for (task, point) in sweep.points.iter_mut().enumerate() {
            point.times = Times::of(times.ns(task));
        }
        let all = sweep.points.iter().enumerate();
        let (timed, values): (Vec<usize>, Vec<[f64; 3]>) =
            all.filter_map(|(i, p)| Some((i, figures(p)?))).unzip();
        let is_less = |a: usize, b: usize, k: usize| k > 0 || times.is_faster(timed[a], timed[b]);
        for (&i, found) in timed.iter().zip(dominance(&values, &is_less)) {
            sweep.points[i].on_front = found.dominated_by.is_none();
        }
        sweep
    }
}

/// What a point is compared by: time, missing, handed on too much.
fn figures(point: &SweepPoint) -> Option<[f64; 3]> {
    let errors = &point.errors;
    let ns = point.times.stage_ns?;
    Some([ns, errors.false_negative_count, errors.false_positive_count])
}
