//! `cullbench precision`: error against run time of a scene and path, and the
//! sweeps over item size and ill-conditioned cameras behind it. How it is shown is
//! in `precision_tables` and `precision_conclusions`.

use anyhow::Result;

use super::args::PrecisionArgs;
use super::document::{Block, show};
use super::figure::{Figure, picture};
use super::page::to_page;
use super::precision_conclusions::is_wrong;
use super::processes::Timing;
use super::study::{ROUNDS, Study, load};
use super::text;
use super::{Ending, expect_places, precision_conclusions, precision_tables, print, write_if};
use crate::index::Registry;
use crate::measure::{ProcessTimes, Setting};
use crate::precision::{self, Precision, SWEEPS, sweep};

pub fn precision(registry: &Registry, args: &PrecisionArgs) -> Result<Ending> {
    let outputs = [("--svg", &args.svg), ("--html", &args.html)];
    expect_places(&outputs, &[&args.study.scene, &args.study.path])?;
    let setting = setting(registry, args, None)?;
    let spread = &args.study.spread;
    let about = format!("{}, {}: ", args.study.scene, args.study.path);
    let study = Study::new(about, 0, spread)?;
    study.begin("every point, checked");
    let prepared = precision::prepare(&setting, args.frames as usize)?;
    let items = text::counted(setting.scene.items.len(), "item");
    study.announce(&items, "about a minute");
    let mut sweeps = Vec::new();
    if args.cubes > 0 {
        for (which, name, _) in SWEEPS {
            study.begin(&format!("the sweep over {name}"));
            sweeps.extend(sweep(which, which.cameras(args.cubes), spread.seed));
        }
    }
    let lens_scale = setting.path.lens_scale;
    let times = study.times("every point, timed", lens_scale, &prepared.plan)?;
    let outcome = Precision {
        seed: spread.seed,
        sweeps,
        ..prepared.conclude(&times)
    };
    let wrong = outcome.points.iter().any(is_wrong);
    let shown = print(args.format, &outcome, || {
        let room = if args.all { usize::MAX } else { text::width() };
        show(&blocks(&outcome, args.all, room))
    });
    let figures: Vec<Figure> = precision_conclusions::figure(&outcome)
        .into_iter()
        .collect();
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
    blocks.extend(Block::more(all, "errors of every culling, sweeps: --all"));
    blocks
}

/// The inputs of the command itself, or of a worker.
fn setting(registry: &Registry, args: &PrecisionArgs, timing: Option<&Timing>) -> Result<Setting> {
    let held = |structures| [2 * structures as u64, 0];
    load(registry, &args.study, ROUNDS, timing, held)
}

/// Times all points in one process.
pub fn time(registry: &Registry, args: &PrecisionArgs, timing: &Timing) -> Result<ProcessTimes> {
    let setting = setting(registry, args, Some(timing))?;
    let frames = args.frames as usize;
    Ok(precision::time(&setting, frames, &timing.plan()?)?)
}
