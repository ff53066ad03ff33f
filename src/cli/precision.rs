//! `cullbench precision`: error against run time of a scene and path, and the
//! sweeps over item size and ill-conditioned cameras behind it. How it is shown is
//! in `precision_tables` and `precision_conclusions`.

use std::io::Write;

use super::args::PrecisionArgs;
use super::document::{Block, to_page, to_terminal};
use super::figure::picture;
use super::processes::{Job, Timing};
use super::study::{Setting, Study};
use super::{
    Ending, expect_places, precision_conclusions, precision_tables, print, stage_sweep, text,
    write_text,
};
use crate::index::Registry;
use crate::measure::{ProcessTimes, Status};
use crate::precision::{self, PointPlan, PrecisionInput, SWEEPS, size_sweep, sweep};

/// Rounds of a point, if one process has them all.
const ROUNDS: [usize; 2] = [5, 15];
/// Cubes for each camera of the other sweeps, and the most cameras of each value.
const CUBES_PER_CAMERA: usize = 10_000;
const SWEEP_CAMERAS: usize = 200;

pub fn precision(registry: &Registry, args: &PrecisionArgs) -> anyhow::Result<Ending> {
    let inputs = [args.study.scene.as_ref(), args.study.path.as_ref()];
    let outputs = [
        ("--svg", args.svg.as_deref()),
        ("--html", args.html.as_deref()),
    ];
    expect_places(&outputs, &inputs)?;
    if let Some(stage) = args.stage {
        return stage_sweep::sweep(registry, args, stage);
    }
    let setting = setting(registry, args, None)?;
    let spread = &args.study.spread;
    let study = Study::new(
        format!("{}, {}: ", args.study.scene, args.study.path),
        0,
        spread,
    )?;
    study.begin("every point, checked");
    let prepared = precision::prepare(&input(args, &setting))?;
    let items = text::counted(setting.scene.items.len(), "item");
    study.announce(&items, "about a minute");
    let (mut sizes, mut sweeps) = (Vec::new(), Vec::new());
    if args.cubes > 0 {
        study.begin("the sweep over sizes");
        sizes = size_sweep(args.cubes, spread.seed)?;
        let cameras = args
            .cubes
            .div_ceil(CUBES_PER_CAMERA)
            .clamp(2, SWEEP_CAMERAS);
        for (which, name, _) in SWEEPS {
            study.begin(&format!("the sweep over {name}"));
            sweeps.extend(sweep(which, cameras, spread.seed));
        }
    }
    let points = |timing| Job::Points(prepared.plan.clone(), timing);
    let times = study.times("every point, timed", setting.path.lens_scale, points)?;
    let precision = prepared.conclude(&times);
    let wrong = precision
        .points
        .iter()
        .any(|p| matches!(p.status, Status::Wrong | Status::Panicked));
    let outcome = precision_tables::Outcome {
        precision,
        seed: spread.seed,
        warnings: setting.path.warnings(&setting.scene),
        size_sweep: sizes,
        sweeps,
    };
    let shown = print(args.format, &outcome, || {
        let width = text::width();
        let room = if args.all { usize::MAX } else { width };
        let shown = to_terminal(&blocks(&outcome, args.all, room), width);
        text::terminal().write_all(shown.as_bytes())
    });
    if let Some(file) = &args.svg {
        let figures = precision_conclusions::figures(&outcome.precision);
        write_text(file, &picture(&figures, 1))?;
    }
    if let Some(file) = &args.html {
        let figures = precision_conclusions::figures(&outcome.precision).into_iter();
        let title = format!("precision {}, {}", args.study.scene, args.study.path);
        let blocks = blocks(&outcome, true, usize::MAX);
        let figures = figures.map(Block::Figure);
        write_text(file, &to_page(&title, usize::MAX, figures, blocks))?;
    }
    shown?;
    Ok(Ending::of(!wrong))
}

/// Tables, then the conclusions.
fn blocks(outcome: &precision_tables::Outcome, all: bool, room: usize) -> Vec<Block> {
    let mut blocks = precision_tables::blocks(outcome, all, room);
    blocks.push(Block::Heading(2, "Conclusions:".to_owned()));
    let told = precision_conclusions::conclusions(outcome).into_iter();
    blocks.extend(told.map(|sentence| Block::Line(format!("- {sentence}"))));
    if !all {
        let more = "every point, region search and sweeps: --all";
        blocks.extend(["", more].map(|line| Block::Line(line.to_owned())));
    }
    blocks
}

/// The inputs of the command itself, or of a worker.
fn setting(
    registry: &Registry,
    args: &PrecisionArgs,
    timing: Option<&Timing>,
) -> anyhow::Result<Setting> {
    let held = |structures| args.study.scene_args.options(2 * structures);
    Setting::load(
        registry,
        &args.study,
        &args.study.path,
        ROUNDS,
        timing,
        held,
    )
}

fn input<'s>(args: &PrecisionArgs, setting: &'s Setting) -> PrecisionInput<'s> {
    PrecisionInput {
        scene: &setting.scene,
        path: &setting.path,
        structures: &setting.structures,
        most_cameras: args.frames as usize,
        protocol: &setting.protocol,
    }
}

/// Times all points in one process.
pub fn time(
    registry: &Registry,
    args: &PrecisionArgs,
    plan: &PointPlan,
    timing: &Timing,
) -> anyhow::Result<ProcessTimes> {
    let setting = setting(registry, args, Some(timing))?;
    Ok(precision::time(&input(args, &setting), plan)?)
}
