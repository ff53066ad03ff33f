//! `cullbench precision --stage`: error against run time of one stage of the
//! funnel.

use std::io::{self, Write};

use anyhow::bail;

use super::args::PrecisionArgs;
use super::funnel::plain_input;
use super::processes::{Job, Timing};
use super::study::{Setting, Study};
use super::table::Table;
use super::{Ending, funnel_table, print, text};
use crate::funnel::{self, Chain, FunnelPlan, NONE, StageKind, StageSweep, SweepPoint};
use crate::index::Registry;
use crate::measure::ProcessTimes;
use crate::scene::LoadOptions;
use crate::suite::DEFAULT_PATH;
use crate::visibility::{Guarantee, SampleGrid};

/// Rounds of a point, if one process has them all.
const ROUNDS: [usize; 2] = [3, 9];
/// The samples of a view, beside its random rays.
const SAMPLES: SampleGrid = SampleGrid::new(320, 180);
/// The default path: stages behind the frustum have work there.
const STREET: &str = "street:frames=32";

/// The inputs of the command itself, or of a worker.
fn setting(
    registry: &Registry,
    args: &PrecisionArgs,
    timing: Option<&Timing>,
) -> anyhow::Result<(Setting, Chain)> {
    let held = |_| LoadOptions {
        per_triangle: funnel::BYTES_PER_TRIANGLE,
        ..args.study.scene_args.options(3)
    };
    let path = match args.study.path.as_str() {
        DEFAULT_PATH => STREET,
        typed => typed,
    };
    let mut setting = Setting::load(registry, &args.study, path, ROUNDS, timing, held)?;
    setting.structures.truncate(1);
    let object = setting.structures.first().map_or(NONE, |spec| &spec.label);
    let chain = Chain::for_scene(&setting.scene, false).with(StageKind::Object, object);
    Ok((setting, chain))
}

pub fn sweep(
    registry: &Registry,
    args: &PrecisionArgs,
    stage: StageKind,
) -> anyhow::Result<Ending> {
    if args.svg.is_some() || args.html.is_some() {
        bail!("--svg and --html draw the frustum's diagram; expected them or --stage, not both");
    }
    let (setting, chain) = setting(registry, args, None)?;
    let scene = &setting.scene;
    if funnel::back_ends(stage, scene, false)
        .iter()
        .all(|row| row.name == NONE)
    {
        // Every scene has something for the others.
        let (name, stage) = (&scene.name, stage.name());
        let why = funnel::left_out_of(scene);
        let why = why.map_or(String::new(), |row| format!(": {}", row.reason));
        bail!(
            "scene '{name}' has nothing for the {stage} stage{why}; expected a scene with rooms or \
             sectors"
        );
    }
    let about = format!("{}, {} stage: ", args.study.scene, stage.name());
    let study = Study::new(about, 0, &args.study.spread)?;
    study.begin("every point, judged");
    let input = plain_input(&setting, &chain, args.frames, SAMPLES, &args.study)?;
    let prepared = funnel::prepare_sweep(&input, stage)?;
    let items = text::counted(scene.items.len(), "item");
    study.announce(&items, "less than a minute");
    let job = |timing| Job::Sweep(prepared.plan.clone(), timing);
    let lens_scale = setting.path.lens_scale;
    let times = study.times("every point, timed", lens_scale, job)?;
    let sweep = prepared.conclude(&times);
    print(args.format, &sweep, || show(&sweep, &mut text::terminal()))?;
    let is_broken = |point: &SweepPoint| {
        point.back_end.guarantee != Guarantee::Unproven && point.errors.false_negative_count > 0.0
    };
    Ok(Ending::of(!sweep.points.iter().any(is_broken)))
}

/// Times all points in one process.
pub fn time(
    registry: &Registry,
    args: &PrecisionArgs,
    plan: &FunnelPlan,
    timing: &Timing,
) -> anyhow::Result<ProcessTimes> {
    let Some(stage) = args.stage else {
        bail!("a sweep without a stage");
    };
    let (setting, chain) = setting(registry, args, Some(timing))?;
    let input = plain_input(&setting, &chain, args.frames, SAMPLES, &args.study)?;
    Ok(funnel::time_sweep(&input, stage, plan)?)
}

fn show(sweep: &StageSweep, out: &mut impl Write) -> io::Result<()> {
    let width = text::width();
    let mut say = |line: &str| writeln!(out, "{}", text::wrapped(line, width));
    say(&format!(
        "{}, {}: {} stage, error against run time\n{} with {} random rays each beside {} x {} \
         samples; {}.\n",
        sweep.scene,
        sweep.path,
        sweep.stage.name(),
        text::counted(sweep.views, "view"),
        sweep.rays_per_view,
        SAMPLES.width,
        SAMPLES.height,
        funnel_table::spread(sweep.processes)
    ))?;
    let mut table = Table::of(
        "by | >buffer | >out | >FP / visible | >FN / visible | >FN / view | >time / view \
         | >front",
    );
    table.rows.extend(sweep.points.iter().map(|point| {
        let errors = &point.errors;
        vec![
            format!(
                "{}{}",
                point.back_end.name,
                funnel_table::doubt(point.back_end.guarantee)
            ),
            point
                .buffer
                .map(|[w, h]| format!("{w}x{h}"))
                .unwrap_or_default(),
            text::significant(errors.output_count),
            text::rate(errors.excess, 1.0),
            text::rate(errors.missing, 1.0),
            text::significant(errors.false_negative_count),
            text::time_plus_minus(point.time),
            if point.on_front { "*" } else { "" }.to_owned(),
        ]
    }));
    say(&table.fitted(width))?;
    let safe = sweep
        .points
        .iter()
        .filter(|p| p.back_end.guarantee != Guarantee::Unproven);
    let lossy = sweep
        .points
        .iter()
        .filter(|p| p.errors.false_negative_count > 0.0)
        .count();
    say(&format!(
        "{lossy} of {} points dropped visible items; {} of these have a guarantee. * On the \
         Pareto front: no other point is significantly better in time or an error and as good in \
         the rest.",
        sweep.points.len(),
        safe.filter(|point| point.errors.false_negative_count > 0.0)
            .count()
    ))
}
