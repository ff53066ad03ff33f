//! `cullbench precision`: error against run time of a scene and path, and the
//! sweeps over item size and ill-conditioned cameras behind it. How it is shown is
//! in `precision_tables` and `precision_conclusions`.

use anyhow::{Result, bail};

use super::args::PrecisionArgs;
use super::document::{Block, show};
use super::figure::picture;
use super::funnel::nothing_for_it;
use super::page::to_page;
use super::precision_conclusions::is_wrong;
use super::processes::Timing;
use super::study::{ROUNDS, Study, load};
use super::table::{Column, Table};
use super::text::{self, significant, some, time_plus_minus};
use super::{
    Ending, expect_places, funnel_table, precision_conclusions, precision_tables, print, write_if,
};
use crate::funnel::{self, Chain, FunnelInput, NONE, StageKind, StageSweep, SweepPoint};
use crate::index::Registry;
use crate::measure::{ProcessTimes, Setting};
use crate::precision::{self, Precision, SWEEPS, size_sweep, sweep};
use crate::visibility::{Guarantee, SampleGrid};

/// Cubes for each camera of the other sweeps, and the most cameras of each value.
const CUBES_PER_CAMERA: usize = 10_000;
const SWEEP_CAMERAS: usize = 200;
/// Fewer cameras give no interval that holds, as items of one share its planes.
const LEAST_CAMERAS: usize = 32;

pub fn precision(registry: &Registry, args: &PrecisionArgs) -> Result<Ending> {
    let outputs = [("--svg", &args.svg), ("--html", &args.html)];
    expect_places(&outputs, &[&args.study.scene, &args.study.path])?;
    if let Some(stage) = args.stage {
        return sweep_stage(registry, args, stage);
    }
    let setting = setting(registry, args, None)?;
    let spread = &args.study.spread;
    let about = format!("{}, {}: ", args.study.scene, args.study.path);
    let study = Study::new(about, 0, spread)?;
    study.begin("every point, checked");
    let prepared = precision::prepare(&setting, args.frames as usize)?;
    let items = text::counted(setting.scene.items.len(), "item");
    study.announce(&items, "about a minute");
    let (mut sizes, mut sweeps) = (Vec::new(), Vec::new());
    if args.cubes > 0 {
        study.begin("the sweep over sizes");
        sizes = size_sweep(args.cubes, spread.seed)?;
        let cameras = args.cubes.div_ceil(CUBES_PER_CAMERA);
        let cameras = cameras.clamp(LEAST_CAMERAS, SWEEP_CAMERAS);
        for (which, name, _) in SWEEPS {
            study.begin(&format!("the sweep over {name}"));
            sweeps.extend(sweep(which, cameras, spread.seed));
        }
    }
    let lens_scale = setting.path.lens_scale;
    let times = study.times("every point, timed", lens_scale, &prepared.plan)?;
    let outcome = Precision {
        seed: spread.seed,
        size_sweep: sizes,
        sweeps,
        ..prepared.conclude(&times)
    };
    let wrong = outcome.points.iter().any(is_wrong) || outcome.region_points.iter().any(is_wrong);
    let shown = print(args.format, &outcome, || {
        let room = if args.all { usize::MAX } else { text::width() };
        show(&blocks(&outcome, args.all, room))
    });
    let figures = precision_conclusions::figures(&outcome);
    write_if(&args.svg, || picture(&figures, 1))?;
    write_if(&args.html, || {
        let title = format!("precision {}, {}", args.study.scene, args.study.path);
        let told = precision_conclusions::conclusions(&outcome).into_iter();
        let tables = precision_tables::blocks(&outcome, true, usize::MAX);
        to_page(&title, told.map(Block::Line), figures, tables)
    })?;
    shown?;
    Ok(Ending::of(!wrong))
}

/// Tables, then the conclusions.
fn blocks(outcome: &Precision, all: bool, room: usize) -> Vec<Block> {
    let mut blocks = precision_tables::blocks(outcome, all, room);
    blocks.push(Block::heading("Conclusions:"));
    let told = precision_conclusions::conclusions(outcome).into_iter();
    blocks.extend(told.map(|sentence| Block::Line(format!("- {sentence}"))));
    let more = "every point, region search and sweeps: --all";
    blocks.extend(Block::more(all, more));
    blocks
}

/// The inputs of the command itself, or of a worker.
fn setting(registry: &Registry, args: &PrecisionArgs, timing: Option<&Timing>) -> Result<Setting> {
    let held = |structures| [2 * structures as u64, 0];
    load(registry, &args.study, ROUNDS, timing, held)
}

/// Times all points in one process.
pub fn time(registry: &Registry, args: &PrecisionArgs, timing: &Timing) -> Result<ProcessTimes> {
    if let Some(stage) = args.stage {
        let setting = stage_setting(registry, args, Some(timing))?;
        return funnel::time_sweep(&stage_input(args, &setting)?, stage, &timing.plan()?);
    }
    let setting = setting(registry, args, Some(timing))?;
    let frames = args.frames as usize;
    Ok(precision::time(&setting, frames, &timing.plan()?)?)
}

/// Rounds of a point, if one process has them all.
const STAGE_ROUNDS: [usize; 2] = [3, 9];
/// The samples of a view, beside its random rays.
const SAMPLES: SampleGrid = SampleGrid::new(320, 180);

/// The inputs of the command itself, or of a worker.
fn stage_setting(
    registry: &Registry,
    args: &PrecisionArgs,
    timing: Option<&Timing>,
) -> Result<Setting> {
    let held = |_| [3, funnel::BYTES_PER_TRIANGLE];
    let mut setting = load(registry, &args.study, STAGE_ROUNDS, timing, held)?;
    setting.structures.truncate(1);
    Ok(setting)
}

fn stage_input<'s>(args: &PrecisionArgs, setting: &'s Setting) -> Result<FunnelInput<'s>> {
    let chain = Chain::for_scene(&setting.scene, &setting.structures, false);
    let views = (args.frames as usize, SAMPLES);
    let execution = args.study.kernel.execution()?;
    Ok(FunnelInput::new(setting, chain, views, execution))
}

fn sweep_stage(registry: &Registry, args: &PrecisionArgs, stage: StageKind) -> Result<Ending> {
    let setting = stage_setting(registry, args, None)?;
    let scene = &setting.scene;
    let known = funnel::back_ends(stage, scene, false);
    if known.iter().all(|row| row.name == NONE) {
        // Every scene has something for the others.
        let (stage, nothing) = (stage.name(), nothing_for_it(scene));
        bail!("--stage is {stage}: {nothing}; expected a scene with rooms or sectors");
    }
    let about = format!("{}, {} stage: ", args.study.scene, stage.name());
    let study = Study::new(about, 0, &args.study.spread)?;
    study.begin("every point, judged");
    let input = stage_input(args, &setting)?;
    let prepared = funnel::prepare_sweep(&input, stage)?;
    let items = text::counted(scene.items.len(), "item");
    study.announce(&items, "less than a minute");
    let lens_scale = setting.path.lens_scale;
    let times = study.times("every point, timed", lens_scale, &prepared.plan)?;
    let sweep = prepared.conclude(&times);
    print(args.format, &sweep, || show(&stage_blocks(&sweep)))?;
    let is_broken =
        |point: &SweepPoint| is_guaranteed(point) && point.errors.false_negative_count > 0.0;
    Ok(Ending::of(!sweep.points.iter().any(is_broken)))
}

/// The points of a stage, and the number of those that dropped visible items.
fn stage_blocks(sweep: &StageSweep) -> Vec<Block> {
    let (scene, path, stage) = (&sweep.scene, &sweep.path, sweep.stage.name());
    let title = format!("{scene}, {path}: {stage} stage, error against run time");
    let (views, SampleGrid { width, height }) = (text::counted(sweep.views, "view"), SAMPLES);
    let by = match sweep.rays_per_view {
        0 => "the exact side of each triangle".to_owned(),
        rays => format!("{rays} random rays each and {width} x {height} samples"),
    };
    let over = text::over(sweep.processes, None);
    let basis = format!("{views} against {by}; {over}.");
    let columns: &[Column<&SweepPoint>] = &[
        ("by", |p| {
            let doubt = funnel_table::doubt(p.back_end.guarantee);
            format!("{}{doubt}", p.back_end.name)
        }),
        (">buffer", |p| some(p.buffer, |[w, h]| format!("{w}x{h}"))),
        (">out", |p| significant(p.errors.output_count)),
        (">FP / visible", |p| text::rate(p.errors.excess, 1.0)),
        (">FN / visible", |p| text::rate(p.errors.missing, 1.0)),
        (">FN / view", |p| significant(p.errors.false_negative_count)),
        (">time / view", |p| time_plus_minus(p.time)),
        (">front", |p| if p.on_front { "*" } else { "" }.to_owned()),
    ];
    let is_lossy = |point: &&SweepPoint| point.errors.false_negative_count > 0.0;
    let lossy = sweep.points.iter().filter(is_lossy);
    let told = format!(
        "{} of {} points dropped visible {}{}. * On the Pareto front: no other point has fewer \
         errors in these views, or is shown to be faster, and is as good in the rest.",
        lossy.clone().count(),
        sweep.points.len(),
        sweep.stage.unit(),
        match lossy.filter(|point| is_guaranteed(point)).count() {
            0 => String::new(),
            wrong => format!("; {wrong} of these with a guarantee"),
        }
    );
    vec![
        Block::Line(title),
        Block::Line(basis),
        Block::Table(Table::with(&sweep.points, columns).without_empty_columns()),
        Block::line(""),
        Block::Line(told),
    ]
}

fn is_guaranteed(point: &SweepPoint) -> bool {
    point.back_end.guarantee != Guarantee::Unproven
}
