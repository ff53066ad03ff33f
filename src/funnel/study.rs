//! The study: every stage with every back end on the views of a path, held against
//! the truth, then timed side by side in one or more processes.

use std::cell::RefCell;

use serde::{Deserialize, Serialize};

use super::chain::Chain;
use super::conclusions::conclusions;
use super::judged::Errors;
use super::orders::{self, Orders};
use super::pass::{Pass, Walked};
use super::plan_view::{PlanView, fate};
use super::report::{FunnelReport, Gain, LevelRow, Side, StageRow, Times};
use super::stage::{NONE, StageKind};
use super::world::{FunnelError, FunnelInput, Truth, World};
use crate::measure::{Ask, OverProcesses, ProcessTimes, Schedule, TimedTask, Verdict, timed};
use crate::visibility::Level;

/// What all processes time: the plan is the same for each.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct FunnelPlan {
    schedule: Schedule,
    /// By task and view: how much is handed on.
    expected: Vec<Vec<u64>>,
}

/// Everything judged, and nothing timed.
pub struct Prepared {
    /// What the other processes are to measure.
    pub plan: FunnelPlan,
    report: FunnelReport,
    /// By row: its task.
    tasks: Vec<Option<usize>>,
    gains: Vec<(StageKind, String, [Side; 2])>,
}

/// Goes through all chains, judges them, and plans how they are timed; `None` if
/// stopped.
///
/// # Errors
/// A camera, a structure or a back end that cannot be had.
pub fn prepare(
    input: &FunnelInput,
    stop: &dyn Fn() -> bool,
) -> Result<Option<Prepared>, FunnelError> {
    let world = World::new(input)?;
    let Some(truth) = world.truth(input, stop) else {
        return Ok(None);
    };
    let mut pass = Pass::new(&world);
    let Some(walks) = Walks::of(&mut pass, &world, input.chain, stop) else {
        return Ok(None);
    };
    let mut rows = Vec::new();
    for (stage, name, step) in &walks.rows {
        if stop() {
            return Ok(None);
        }
        let given = walks.chosen.sets[*stage as usize];
        let judged: Vec<_> = (0..world.views())
            .map(|view| {
                let output = step.map_or(given, |step| pass.steps()[step].output);
                let sets = [given, output].map(|set| pass.items(set, view));
                world.judge(*stage, name, view, sets, &truth)
            })
            .collect();
        rows.push(StageRow {
            back_end: world.back_end(*stage, name),
            structure: (*stage == StageKind::Object && step.is_some()).then(|| name.clone()),
            is_chosen: input.chain.of(*stage) == name,
            unit: stage.unit(),
            errors: Errors::of(&judged),
            times: Times::default(),
            ns_per_removed: None,
            ns_per_decided: None,
        });
    }
    let side = |walked: &Walked| Side {
        tasks: world.timed_steps(walked, pass.steps()),
        count: pass.mean_count(walked.sets[StageKind::Triangle as usize]),
    };
    let gains = walks.without.iter().map(|(stage, without)| {
        let name = input.chain.of(*stage).to_owned();
        (*stage, name, [side(&walks.chosen), side(without)])
    });
    let gains = gains.collect();
    let orders = Orders::of(&world, &pass, walks.left());
    let Some(drawn) = orders.drawn(input.samples, stop) else {
        return Ok(None);
    };
    let tasks = timed_tasks(&pass, &world, &orders, None);
    let schedule = Schedule::new(world.views(), &tasks, input.protocol);
    let level = Level::of(&input.scene.name, input.scene)?;
    Ok(Some(Prepared {
        plan: FunnelPlan {
            expected: tasks.iter().map(|task| task.expected.clone()).collect(),
            schedule,
        },
        tasks: walks.rows.iter().map(|(_, _, step)| *step).collect(),
        gains,
        report: FunnelReport {
            scene: input.scene.name.clone(),
            path: input.path.name.clone(),
            items: input.scene.items.len(),
            views: world.views(),
            samples: [input.samples.width, input.samples.height],
            processes: 0,
            level: LevelRow::of(&level),
            chain: input.chain.clone(),
            stages: rows,
            orders: drawn,
            gains: Vec::new(),
            conclusions: Vec::new(),
            plan_view: plan_view(&world, &pass, &walks.chosen, &truth),
        },
    }))
}

/// One process's share of the times; `None` if stopped.
///
/// # Errors
/// As [`prepare`].
pub fn time(
    input: &FunnelInput,
    plan: &FunnelPlan,
    stop: &dyn Fn() -> bool,
) -> Result<Option<ProcessTimes>, FunnelError> {
    let world = World::new(input)?;
    let mut pass = Pass::new(&world);
    let Some(walks) = Walks::of(&mut pass, &world, input.chain, stop) else {
        return Ok(None);
    };
    let orders = Orders::of(&world, &pass, walks.left());
    let tasks = timed_tasks(&pass, &world, &orders, Some(&plan.expected));
    let timed = timed(&tasks, &plan.schedule, input.protocol, &|_| stop());
    Ok(timed.map(|timed| ProcessTimes::of(&timed)))
}

/// Every step, and then every order, as a task; what it must hand on is what it has, or
/// what another process says.
fn timed_tasks<'p>(
    pass: &'p Pass<'p>,
    world: &'p World<'p>,
    orders: &'p Orders,
    expected: Option<&[Vec<u64>]>,
) -> Vec<TimedTask<'p>> {
    let steps = pass.steps().iter().map(|step| {
        let run = world.run(step.stage, &step.back_end);
        let ask: Ask = Box::new(move |view, out| run(view, pass.items(step.input, view), out));
        ask
    });
    let sorts = (0..orders::COUNT).map(|order| {
        let pieces = RefCell::new(Vec::new());
        let ask: Ask = Box::new(move |view, out| {
            let pieces = &mut *pieces.borrow_mut();
            orders.sort(order, view, pieces);
            out.extend(pieces.iter().map(|piece| piece.item));
        });
        ask
    });
    let task = |(place, ask): (usize, Ask<'p>)| TimedTask {
        expected: match expected {
            Some(expected) => expected[place].clone(),
            None => counts(&ask, world.views()),
        },
        ask,
        ask_many: None,
        least_ns: None,
    };
    steps.chain(sorts).enumerate().map(task).collect()
}

/// How much is handed on in each view.
fn counts(ask: &Ask, views: usize) -> Vec<u64> {
    let mut out = Vec::new();
    let counts = (0..views).map(|view| {
        out.clear();
        ask(view, &mut out);
        out.len() as u64
    });
    counts.collect()
}

/// The chains that are gone through: the chosen one, every back end in its place in
/// it, and the chain without each of its stages.
struct Walks {
    chosen: Walked,
    rows: Vec<(StageKind, String, Option<usize>)>,
    without: Vec<(StageKind, Walked)>,
}

impl Walks {
    /// The set that the chosen chain leaves to be drawn.
    fn left(&self) -> usize {
        self.chosen.sets[StageKind::Triangle as usize]
    }

    fn of(pass: &mut Pass, world: &World, chain: &Chain, stop: &dyn Fn() -> bool) -> Option<Walks> {
        let chosen = pass.walk(chain, stop)?;
        let (mut rows, mut without) = (Vec::new(), Vec::new());
        for stage in StageKind::ALL {
            for name in world.names(stage, chain) {
                let step = match name.as_str() {
                    NONE => None,
                    _ => Some(pass.step(stage, &name, chosen.sets[stage as usize], stop)?),
                };
                rows.push((stage, name, step));
            }
            if stage.hands_on_items() && stage != StageKind::Fragment && chain.of(stage) != NONE {
                without.push((stage, pass.walk_items(&chain.without(stage), stop)?));
            }
        }
        Some(Walks {
            chosen,
            rows,
            without,
        })
    }
}

/// The first view from above, after the stages that decide what is drawn.
fn plan_view(world: &World, pass: &Pass, walked: &Walked, truth: &Truth) -> PlanView {
    let stages = &StageKind::ALL[..StageKind::Triangle as usize];
    let handed_on = stages.iter().zip(&walked.sets[1..]);
    let sets: Vec<_> = handed_on
        .map(|(&stage, &set)| (stage, pass.items(set, 0)))
        .collect();
    world.plan_view(0, |item| fate(item, &sets, truth.sees(0, item)))
}

impl Prepared {
    /// The funnel from the times of all processes.
    pub fn conclude(self, processes: &[ProcessTimes]) -> FunnelReport {
        let times = OverProcesses::of(processes);
        let mut report = self.report;
        report.processes = processes.len();
        for (row, task) in report.stages.iter_mut().zip(&self.tasks) {
            let Some(found) = task.and_then(|task| times.ns(task)) else {
                continue;
            };
            if row.back_end.stage == StageKind::Fragment {
                continue;
            }
            row.times = Times::of(Some(found));
            let per = |count: f64| (count > 0.0).then(|| found.value / count);
            row.ns_per_removed = per(row.errors.input_count - row.errors.output_count);
            row.ns_per_decided = per(row.errors.input_count);
        }
        let gains = self
            .gains
            .iter()
            .map(|(stage, name, [with, without])| Gain::of(*stage, name, [with, without], &times));
        report.gains = gains.collect();
        report.conclusions = conclusions(&report);
        report
    }
}

/// Why a task has no time, if one failed: the first of them.
pub fn failure(processes: &[ProcessTimes]) -> Option<&Verdict> {
    let results = processes.iter().flat_map(|process| &process.ln_ns);
    results.filter_map(|result| result.as_ref().err()).next()
}
