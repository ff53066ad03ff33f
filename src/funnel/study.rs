//! The study: every stage with every back end on the views of a path, held against
//! the truth, then timed side by side in one or more processes.

use std::cell::RefCell;

use super::back_ends::left_out_of;
use super::bounds::{Bound, bounds};
use super::chain::Chain;
use super::conclusions::conclusions;
use super::error::FunnelError;
use super::faces::Faces;
use super::fragment_rows;
use super::fragments::Fragments;
use super::judged::{Errors, Judged};
use super::left_out::LeftOutRow;
use super::mirror::mirrored;
use super::orders::Orders;
use super::pass::{Pass, Walked};
use super::picks::Picks;
use super::plan::{FunnelPlan, task};
use super::plan_view::{PlanView, fate};
use super::report::{CutOutRow, FunnelReport, Gain, LevelRow, Side, StageRow};
use super::seen::seen;
use super::stage::{BackEnd, NONE, StageKind};
use super::times::Times;
use super::triangle_rows;
use super::truth::Truth;
use super::walks::Walks;
use super::world::{FunnelInput, World};
use crate::measure::{Ask, OverProcesses, ProcessTimes, TimedTask, Verdict};
use crate::scene::available_bytes;
use crate::visibility::{Level, SampleGrid};

/// Bytes that a study takes for each sample of a view: rays and depths of two images, and
/// what ties at them. Of a mesh 230 were measured, of boxes 290 to 350, with a mirror 440;
/// where nothing is culled 660.
const BYTES_PER_SAMPLE: u64 = 450;
/// Images of fewer samples are drawn without asking.
const ANYWHERE: u64 = 1_000_000;

/// Refuses images that need more memory than is available; what is not known is no reason.
fn fits(grid: SampleGrid, available: Option<u64>) -> Result<(), FunnelError> {
    let samples = u64::from(grid.width) * u64::from(grid.height);
    let needed = samples * BYTES_PER_SAMPLE;
    match available.filter(|available| samples > ANYWHERE && needed > *available) {
        Some(available) => Err(FunnelError::TooManySamples {
            grid,
            needed,
            available,
        }),
        None => Ok(()),
    }
}

/// Everything judged, and nothing timed.
pub struct Prepared {
    /// What the other processes are to measure.
    pub plan: FunnelPlan,
    report: FunnelReport,
    /// By row: its task.
    tasks: Vec<Option<usize>>,
    gains: Vec<Sides>,
}

/// The chain with a stage and without it.
struct Sides {
    stage: StageKind,
    back_end: String,
    unit: &'static str,
    sides: [Side; 2],
}

/// Goes through all chains, judges them, and plans how they are timed; `None` if
/// stopped. `begin` gets the name of each step before it starts.
///
/// # Errors
/// A camera, a structure, a back end or an image that cannot be had.
pub fn prepare(
    input: &FunnelInput,
    begin: &dyn Fn(&str),
    stop: &dyn Fn() -> bool,
) -> Result<Option<Prepared>, FunnelError> {
    fits(input.samples, available_bytes())?;
    begin("structures, regions, occluders");
    let world = World::new(input)?;
    let threads = input.execution.threads;
    begin("the truth");
    let Some(truth) = seen(&world, input.samples, 0, threads, stop)? else {
        return Ok(None);
    };
    begin("every stage, held against the truth");
    let mut pass = Pass::new(&world);
    let Some(walks) = Walks::of(&mut pass, &world, input.chain, stop) else {
        return Ok(None);
    };
    let left = Left::of(&world, &pass, &walks.chosen, input.chain);
    let mut rows = Vec::new();
    for (stage, name, step) in &walks.rows {
        if stop() {
            return Ok(None);
        }
        let sets = walks.sets(&pass, *stage, *step);
        let judged: Vec<_> = (0..world.views())
            .map(|view| world.judge(view, sets.map(|set| pass.items(set, view)), &truth))
            .collect();
        let back_end = world.back_end(*stage, name);
        rows.push((back_end, name.clone(), judged, *step));
    }
    let culls = world.back_ends(StageKind::Triangle).into_iter();
    let culls = culls.zip(std::iter::once(None).chain((0..).map(Some)));
    for (back_end, place) in culls {
        if stop() {
            return Ok(None);
        }
        let task = place.map(|place: usize| pass.steps().len() + place);
        let judged = left.faces.judged(place);
        rows.push((back_end, back_end.name.to_owned(), judged, task));
    }
    let last = walks.chosen.left();
    let Some(tested) = left.fragments.tested(&pass, last, &truth, stop) else {
        return Ok(None);
    };
    let covered = tested
        .iter()
        .find(|tested| tested.back_end.name == fragment_rows::Z);
    let covered = covered
        .map(|tested| tested.covered.clone())
        .unwrap_or_default();
    let mut mirror = None;
    let mut left_out = left_out_of(input.scene);
    let too_much = left.fragments.too_much.iter().cloned();
    left_out.extend(too_much.map(|reason| LeftOutRow::of("stages", "fragment", reason)));
    left_out.extend_from_slice(&left.orders.left_out);
    if let (Some(solids), Some(item)) = (&world.solids, input.mirror) {
        match mirrored(item, &world, solids, &pass, last, stop) {
            Ok(None) => return Ok(None),
            Ok(row) => mirror = row,
            Err(reason) => left_out.push(LeftOutRow::of("mirror", "all", reason)),
        }
    }
    begin("every order, drawn");
    let drawn = match left.orders.drawn(input.samples, stop) {
        Ok(None) => return Ok(None),
        Ok(Some(drawn)) => drawn,
        Err(reason) => {
            left_out.push(LeftOutRow::of("orders", "all", reason));
            Vec::new()
        }
    };
    begin("what is under a cursor");
    let picked = left.picks.judged();
    left_out.extend_from_slice(&left.picks.left_out);
    // Behind the steps come the back ends of the triangle stage, then the tests of fragments.
    let first_test = pass.steps().len() + triangle_rows::back_ends().count();
    let tests = std::iter::once(None).chain((first_test..).map(Some));
    let tasks = rows.iter().map(|(_, _, _, task)| *task);
    let tasks: Vec<Option<usize>> = tasks.chain(tests.take(tested.len())).collect();
    let row = |back_end: BackEnd, name: &str, judged: &[Judged]| StageRow {
        back_end,
        structure: None,
        is_chosen: input.chain.of(back_end.stage) == name,
        unit: back_end.stage.unit(),
        errors: Errors::of(judged),
        times: Times::default(),
        ns_per_removed: None,
        ns_per_decided: None,
        fragments: None,
    };
    let rows = rows.into_iter().map(|(back_end, name, judged, task)| {
        let is_built = back_end.stage == StageKind::Object && task.is_some();
        StageRow {
            structure: is_built.then(|| name.clone()),
            ..row(back_end, &name, &judged)
        }
    });
    let tested = tested.into_iter().map(|tested| StageRow {
        fragments: tested.counts,
        ..row(tested.back_end, tested.back_end.name, &tested.judged)
    });
    let rows: Vec<StageRow> = rows.chain(tested).collect();
    let side = |walked: &Walked| Side {
        tasks: pass.timed_steps(walked),
        count: pass.mean_count(walked.left()),
    };
    let of_items = walks.without.iter().map(|(stage, without)| Sides {
        stage: *stage,
        back_end: input.chain.of(*stage).to_owned(),
        unit: stage.unit(),
        sides: [side(&walks.chosen), side(without)],
    });
    let steps = pass.timed_steps(&walks.chosen);
    let behind = rows.iter().zip(&tasks).filter_map(|(row, task)| {
        sides_behind(row, *task, &steps, world.cut_outs.is_some(), &rows)
    });
    let gains = of_items.chain(behind).collect();
    let bounds = bounds(&world, &left.faces, &covered);
    let bound_rows = bounds.iter().map(Bound::row).collect();
    let timed = timed_tasks(&pass, &world, &left, bounds, None);
    let level = Level::of(&input.scene.name, input.scene)?;
    Ok(Some(Prepared {
        plan: FunnelPlan::of(&timed, world.views(), input),
        tasks,
        gains,
        report: FunnelReport {
            scene: input.scene.name.clone(),
            path: input.path.name.clone(),
            items: input.scene.items.len(),
            views: world.views(),
            samples: [input.samples.width, input.samples.height],
            processes: 0,
            level: LevelRow::of(&level),
            cut_outs: input
                .cut_outs
                .zip(world.cut_outs.as_ref())
                .map(|(typed, made)| CutOutRow::of(typed, made)),
            occluders: input.occluders.to_string(),
            chain: input.chain.clone(),
            stages: rows,
            inner_boxes: world.hiders.inner_row().cloned(),
            ground: world.hiders.ground().map(|ground| ground.row.clone()),
            solid_blocks: world.hiders.blocks_row().cloned(),
            mirror,
            orders: drawn,
            picks: picked,
            left_out,
            bounds: bound_rows,
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
    let left = Left::of(&world, &pass, &walks.chosen, input.chain);
    // The last bound hands on what is covered.
    let covered = plan.expected.last().map_or(&[][..], |counts| counts);
    let bounds = bounds(&world, &left.faces, covered);
    let tasks = timed_tasks(&pass, &world, &left, bounds, Some(&plan.expected));
    Ok(plan.time(&tasks, input, stop))
}

/// The chain with and without a stage behind those of whole items, if this is the chain's
/// row of one: of triangles what is left of them, of fragments those that are shaded.
fn sides_behind(
    row: &StageRow,
    task: Option<usize>,
    steps: &[usize],
    cut_outs: bool,
    rows: &[StageRow],
) -> Option<Sides> {
    let stage = row.back_end.stage;
    if !row.is_chosen || row.back_end.name == NONE || StageKind::OF_ITEMS.contains(&stage) {
        return None;
    }
    // Without a test every fragment of what is left is shaded.
    let every = rows
        .iter()
        .find(|row| row.back_end.name == fragment_rows::default(cut_outs));
    let every = every.and_then(|row| row.fragments);
    let (unit, counts) = match row.fragments.zip(every) {
        Some((own, every)) => ("fragments", [own.shaded_count, every.fragment_count]),
        None => (row.unit, [row.errors.output_count, row.errors.input_count]),
    };
    let [with, without] = [[steps, &[task?]].concat(), steps.to_vec()];
    let sides = [(with, counts[0]), (without, counts[1])];
    Some(Sides {
        stage,
        back_end: row.back_end.name.to_owned(),
        unit,
        sides: sides.map(|(tasks, count)| Side { tasks, count }),
    })
}

/// What the chosen chain leaves of every view, ready for the stages behind it.
struct Left<'w> {
    faces: Faces,
    fragments: Fragments<'w>,
    picks: Picks<'w>,
    orders: Orders,
}

impl<'w> Left<'w> {
    fn of(world: &'w World<'w>, pass: &Pass, chosen: &Walked, chain: &Chain) -> Left<'w> {
        let set = chosen.left();
        let faces = Faces::of(world, pass, set);
        let triangle = chain.of(StageKind::Triangle);
        let fragments = Fragments::of(world, pass, set, &faces, triangle);
        Left {
            orders: Orders::of(world, pass, set, fragments.too_much.as_ref()),
            fragments,
            faces,
            picks: Picks::of(world),
        }
    }
}

/// Every step, every back end of the triangle stage, every test of fragments, every order,
/// every back end of picking and every bound as a task; what it must hand on is what it has,
/// or what another process says.
fn timed_tasks<'p>(
    pass: &'p Pass<'p>,
    world: &'p World<'p>,
    left: &'p Left<'p>,
    bounds: Vec<Bound<'p>>,
    expected: Option<&[Vec<u64>]>,
) -> Vec<TimedTask<'p>> {
    let steps = pass.steps().iter().map(|step| {
        let run = world.run(step.stage, &step.back_end);
        let ask: Ask = Box::new(move |view, out| run(view, pass.items(step.input, view), out));
        ask
    });
    let culls = (0..triangle_rows::back_ends().count()).map(|place| {
        let ask: Ask = Box::new(move |view, out| left.faces.cull(place, view, out));
        ask
    });
    let tests = (0..left.fragments.count()).map(|test| {
        let ask: Ask = Box::new(move |view, out| {
            left.fragments.draw(test, view, out);
        });
        ask
    });
    let sorts = (0..left.orders.count()).map(|order| {
        let pieces = RefCell::new(Vec::new());
        let ask: Ask = Box::new(move |view, out| {
            let pieces = &mut *pieces.borrow_mut();
            left.orders.sort(order, view, pieces);
            out.extend(pieces.iter().map(|piece| piece.item));
        });
        ask
    });
    let picks = (0..left.picks.count()).map(|back_end| {
        let ask: Ask = Box::new(move |view, out| left.picks.ask(back_end, view, out));
        ask
    });
    let task = |(place, ask): (usize, Ask<'p>)| {
        let expected = match expected {
            Some(expected) => expected[place].clone(),
            None => counts(&ask, world.views()),
        };
        task(ask, expected)
    };
    let bounds = bounds.into_iter().map(|bound| bound.ask);
    steps
        .chain(culls)
        .chain(tests)
        .chain(sorts)
        .chain(picks)
        .chain(bounds)
        .enumerate()
        .map(task)
        .collect()
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

/// The first view from above, after the stages that decide what is drawn.
fn plan_view(world: &World, pass: &Pass, walked: &Walked, truth: &Truth) -> PlanView {
    let handed_on = StageKind::OF_ITEMS.into_iter().zip(&walked.sets[1..]);
    let sets: Vec<_> = handed_on
        .map(|(stage, &set)| (stage, pass.items(set, 0)))
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
            row.times = Times::of(Some(found));
            let per = |count: f64| (count > 0.0).then(|| found.value / count);
            row.ns_per_removed = per(row.errors.input_count - row.errors.output_count);
            row.ns_per_decided = per(row.errors.input_count);
        }
        // Behind the stages come the orders, then picking, and last of all the bounds.
        let bounds = self.plan.expected.len() - report.bounds.len();
        for (bound, own) in report.bounds.iter_mut().zip(bounds..) {
            let of = |row: &StageRow| {
                row.back_end.stage == bound.stage && row.back_end.name == bound.back_end
            };
            let task = report
                .stages
                .iter()
                .position(of)
                .and_then(|row| self.tasks[row]);
            bound.set(times.ns(own), task.and_then(|task| times.ratio(task, own)));
        }
        let picks = bounds - report.picks.len();
        for (row, task) in report.picks.iter_mut().zip(picks..) {
            row.times = Times::of(times.ns(task));
            row.ns_per_ray = row.times.stage_ns.map(|ns| ns / Picks::RAYS_PER_VIEW);
        }
        for (row, task) in report.orders.iter_mut().rev().zip((0..picks).rev()) {
            row.times = Times::of(times.ns(task));
        }
        let gains = self.gains.iter().map(|sides| {
            let [with, without] = &sides.sides;
            let back_end = &sides.back_end;
            Gain::of(sides.stage, back_end, sides.unit, [with, without], &times)
        });
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn images_that_do_not_fit_are_refused_in_a_line() {
        let large = SampleGrid::new(16_384, 8_192);
        let refused = fits(large, Some(8_000_000_000)).unwrap_err().to_string();
        assert_eq!(
            refused,
            "--samples 16384x8192: images need about 60.4 GB, 8.0 GB are free; expected fewer samples"
        );
        assert!(fits(large, Some(61_000_000_000)).is_ok() && fits(large, None).is_ok());
        // Where little is free, small ones are tried all the same.
        assert!(fits(SampleGrid::new(320, 180), Some(1)).is_ok());
    }
}
