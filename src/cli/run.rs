//! `cullbench run`, the main job: plan, measure scene by scene, keep every
//! finished cell on disk, show a ranked table per scene.

use std::collections::BTreeSet;
use std::io::{self, Write};
use std::time::Instant;

use indicatif::{ProgressBar, ProgressStyle};

use super::args::RunArgs;
use super::run_plan::{Plan, Question};
use super::run_resume::{finished, open, utc_now};
use super::run_table::show_scene;
use super::{Ending, interrupt, surface_tables, text, unread_is_fine};
use cullbench::culling::CullingTest;
use cullbench::measure::{
    BOUNDS, Contender, Group, Machine, PathInfo, Protocol, SceneInfo, Workload, measure_group,
};
use cullbench::path;
use cullbench::report::{Report, ReportCell, RunFolder};
use cullbench::scene::{self, Scene};

pub fn run(args: &RunArgs) -> anyhow::Result<Ending> {
    args.kernel.choose()?;
    let plan = Plan::new(args)?;
    let machine = Machine::capture();
    interrupt::from_now_on_finish();
    let (mut folder, mut report) = open(args, &plan, &machine)?;
    let started = Instant::now();
    let bar = progress(plan.groups());
    let sweep = machine.cache_sweep_bytes();
    let mut interrupted = false;
    let bounds = if args.no_bounds { &[] } else { BOUNDS };
    for planned in &plan.scenes {
        let source = &planned.source;
        let done: BTreeSet<Question> = finished(&report, source);
        let mut shown = 0;
        let questions = plan.questions(planned);
        if questions.iter().any(|question| !done.contains(question)) {
            bar.set_message(format!("{source}: building"));
            let scene = scene::load(source, &plan.load)?;
            let info = SceneInfo::of(&scene);
            let mut entered: Option<(bool, Vec<Contender>)> = None;
            for question in questions {
                if done.contains(&question) {
                    bar.inc(1);
                    continue;
                }
                let (path, cold, test) = &question;
                let culling = plan.culling(test);
                bar.set_message(format!("{source}, {path}, {test}"));
                // Built once for all tests over boxes, and anew for spheres.
                let of_spheres = culling.test == CullingTest::Sphere;
                if entered.as_ref().is_none_or(|(kind, _)| *kind != of_spheres) {
                    // The old ones go first: memory for one set is enough.
                    drop(entered.take());
                    entered = Some((of_spheres, contenders(&plan, &scene, culling.test)));
                }
                let Some((_, contenders)) = &entered else {
                    continue;
                };
                let protocol = Protocol {
                    min_rounds: plan.suite.min_rounds,
                    max_rounds: plan.suite.max_rounds,
                    budget: plan.suite.budget,
                    pass: plan.suite.pass,
                    cold: *cold,
                    seed: args.seed,
                    overhead_ns: report.noise.harness_overhead_ns,
                    cache_bytes: sweep,
                };
                let way = path::load(path, &scene, &plan.lens)?;
                let workload = Workload::new(&scene, &way, &culling)?;
                let asked = interrupt::asked;
                let group =
                    measure_group(&workload, contenders, bounds, "linear", &protocol, &asked);
                let Some(group) = group else {
                    interrupted = true;
                    break;
                };
                let path = PathInfo::of(path, &workload, *cold);
                keep(&mut folder, &mut report, test, &info, &path, group)?;
                shown += 1;
                bar.inc(1);
            }
        }
        if shown > 0 || !done.is_empty() {
            bar.suspend(|| unread_is_fine(show_scene(&report, source)))?;
        }
        if interrupted {
            break;
        }
    }
    bar.finish_and_clear();
    if !interrupted && report.run.finished_at.is_none() {
        report.run.finished_at = Some(utc_now());
        folder.save(&report)?;
    }
    unread_is_fine(surface_tables::show(&report))?;
    unread_is_fine(close(&report, &folder, started, interrupted))?;
    let failed = report.cells.iter().any(|c| c.status.is_failure());
    Ok(match (interrupted, failed) {
        (true, _) => Ending::Interrupted,
        (false, true) => Ending::WrongAnswer,
        (false, false) => Ending::Ok,
    })
}

/// All structures, and the first proper one a second time: the twin whose
/// ratio to itself is the noise floor.
fn contenders(plan: &Plan, scene: &Scene, test: CullingTest) -> Vec<Contender> {
    let proper = plan
        .structures
        .iter()
        .find(|s| !s.backend.name.starts_with("linear"));
    let twin = proper.or(plan.structures.first());
    let entered = plan
        .structures
        .iter()
        .map(|s| (s, false))
        .chain(twin.map(|s| (s, true)));
    entered
        .map(|(spec, is_twin)| Contender::build(spec.clone(), is_twin, scene, test))
        .collect()
}

/// Puts a finished group on disk.
fn keep(
    folder: &mut RunFolder,
    report: &mut Report,
    test: &str,
    scene: &SceneInfo,
    path: &PathInfo,
    group: Group,
) -> anyhow::Result<()> {
    let mut append = |label: &str| {
        let own = group.samples.iter().filter(|(l, _, _)| l == label);
        let samples: Vec<_> = own.map(|(_, task, sample)| (*task, *sample)).collect();
        folder.append(
            [&scene.name, &path.name, &path.cache, label, test],
            samples.iter(),
        )
    };
    if let Some(twin) = &group.twin {
        append(&format!("{}#twin", twin.structure))?;
        report.noise.add(&scene.name, path, test, twin);
    }
    for cell in group.cells {
        let samples = append(&cell.structure)?;
        let samples = (samples.rows > 0).then_some(samples);
        report
            .cells
            .push(ReportCell::new(scene, path, test, cell, samples));
    }
    for bound in group.bounds {
        let samples = append(&bound.structure)?;
        let samples = (samples.rows > 0).then_some(samples);
        report
            .bounds
            .push(ReportCell::new(scene, path, test, bound, samples));
    }
    // A finished run that was asked for more goes on.
    report.run.finished_at = None;
    folder.save(report)?;
    Ok(())
}

fn progress(groups: u64) -> ProgressBar {
    // Drawn on stderr, and only if that is a terminal.
    let style = ProgressStyle::with_template("{bar:24} {pos}/{len}  {elapsed}  {msg}");
    let bar = ProgressBar::new(groups);
    bar.set_style(style.unwrap_or_else(|_| ProgressStyle::default_bar()));
    bar
}

fn close(
    report: &Report,
    folder: &RunFolder,
    started: Instant,
    interrupted: bool,
) -> io::Result<()> {
    let failed = report
        .cells
        .iter()
        .filter(|c| c.status.is_failure())
        .count();
    let mut out = io::stdout().lock();
    let noise = match (report.noise.aa_floor, report.noise.aa_ratio) {
        (Some(floor), Some(ratio)) => format!(
            "noise floor {} (the same structure entered twice, mean ratio {ratio:.3}); smaller differences are ties",
            text::percent(floor)
        ),
        _ => "noise floor unknown: no structure was measured twice".to_owned(),
    };
    writeln!(
        out,
        "\n{} cells in {:.1} s, {failed} wrong; {noise}",
        report.cells.len(),
        started.elapsed().as_secs_f64()
    )?;
    writeln!(
        out,
        "{}/{{report.json, summary.csv, samples.csv}}",
        folder.path().display()
    )?;
    if interrupted {
        writeln!(
            out,
            "interrupted: finished cells are kept; --resume goes on"
        )?;
    }
    out.flush()
}
