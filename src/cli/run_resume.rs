//! Where a run is kept: a new folder, or an unfinished one to go on with, if it
//! holds the very experiment that is asked for now.

use std::collections::BTreeSet;
use std::fs;
use std::path::{Path, PathBuf};
use std::time::{SystemTime, UNIX_EPOCH};

use anyhow::{Context, bail};

use super::args::RunArgs;
use super::run_plan::{Plan, Question};
use cullbench::culling::Culling;
use cullbench::kernel::Kernel;
use cullbench::measure::{Machine, Source, Status, Toolchain, harness_overhead_ns};
use cullbench::path;
use cullbench::report::{Noise, Report, ReportCell, RunFolder, RunInfo, SCHEMA_VERSION};
use cullbench::scene::{self, GENERATOR_NAME};

/// A new folder with an empty report, or the one to go on with.
pub fn open(args: &RunArgs, plan: &Plan, machine: &Machine) -> anyhow::Result<(RunFolder, Report)> {
    if args.resume {
        let path = match &args.out {
            Some(path) => path.clone(),
            None => newest_unfinished(Path::new("results"))?,
        };
        let (folder, report) = RunFolder::resume(&path)?;
        same_experiment(&report, plan, args)
            .and_then(|()| same_inputs(&report, plan))
            .with_context(|| path.display().to_string())?;
        return Ok((folder, report));
    }
    let now = utc_now();
    let nanos = SystemTime::now().duration_since(UNIX_EPOCH)?.subsec_nanos();
    let id = format!("{:04x}", (nanos ^ std::process::id()) & 0xFFFF);
    let stamp: String = now.chars().filter(|c| !matches!(c, '-' | ':')).collect();
    let path = match &args.out {
        Some(path) => path.clone(),
        None => PathBuf::from(format!("results/{stamp}-{}-{id}", machine.slug())),
    };
    let report = Report {
        schema_version: SCHEMA_VERSION,
        run: RunInfo {
            id: format!("{stamp}-{id}"),
            started_at: now,
            finished_at: None,
            command: std::env::args_os()
                .skip(1)
                .fold("cullbench".to_owned(), |all, arg| {
                    all + " " + &arg.to_string_lossy()
                }),
            seed: args.seed,
            suite: plan.from_suite.then(|| plan.suite.name.to_owned()),
            generator: GENERATOR_NAME.to_owned(),
        },
        machine: machine.clone(),
        toolchain: Toolchain::capture(),
        source: Source::capture(),
        noise: Noise {
            harness_overhead_ns: harness_overhead_ns(),
            ..Noise::default()
        },
        cells: Vec::new(),
        bounds: Vec::new(),
    };
    let folder = RunFolder::create(&path)?;
    folder.save(&report)?;
    Ok((folder, report))
}

/// RFC 3339 in UTC, to the second.
pub fn utc_now() -> String {
    humantime::format_rfc3339_seconds(SystemTime::now()).to_string()
}

fn newest_unfinished(results: &Path) -> anyhow::Result<PathBuf> {
    let listing = fs::read_dir(results).with_context(|| results.display().to_string())?;
    let mut folders: Vec<PathBuf> = listing
        .filter_map(|entry| Some(entry.ok()?.path()))
        .collect();
    folders.sort();
    let unfinished = folders
        .into_iter()
        .rev()
        .find(|path| RunFolder::read(path).is_ok_and(|report| report.run.finished_at.is_none()));
    unfinished.with_context(|| {
        format!(
            "no unfinished run in {}; expected one to resume",
            results.display()
        )
    })
}

/// Cells of two different experiments do not belong into one report.
fn same_experiment(report: &Report, plan: &Plan, args: &RunArgs) -> anyhow::Result<()> {
    let labels = |all: BTreeSet<&str>| all.into_iter().collect::<Vec<_>>().join(", ");
    let wanted: BTreeSet<&str> = plan.structures.iter().map(|s| s.label.as_str()).collect();
    for cell in &report.cells {
        let found: BTreeSet<&str> = report
            .cells
            .iter()
            .filter(|c| c.scene.name == cell.scene.name && c.path.name == cell.path.name)
            .map(|c| c.structure.as_str())
            .collect();
        if found != wanted {
            bail!(
                "holds cells of {}; expected {} as asked for now",
                labels(found),
                labels(wanted)
            );
        }
        let same = |c: &Culling| {
            cell.path.planes == c.planes.method.name()
                && cell.path.epsilon == c.planes.epsilon
                && cell.path.arithmetic == c.arithmetic.name()
        };
        if !plan.cullings.iter().any(same) {
            bail!(
                "holds cells with other planes, epsilon or arithmetic; expected those asked for now"
            );
        }
    }
    let answered = report.cells.iter().any(|c| c.status == Status::Ok);
    match (report.bounds.is_empty(), args.no_bounds) {
        (false, true) => bail!("holds bounds; expected them to be asked for now as well"),
        (true, false) if answered => bail!("was begun with --no-bounds; expected the same now"),
        _ => {}
    }
    if report.run.seed != args.seed {
        bail!(
            "was begun with --seed {}; expected the same now",
            report.run.seed
        );
    }
    let kernel = Kernel::chosen().name();
    if report.machine.instruction_set != kernel {
        bail!(
            "was begun with --kernel {}; expected the same now, not {kernel}",
            report.machine.instruction_set
        );
    }
    let now = Toolchain::capture();
    if report.toolchain != now || report.source.commit != Source::capture().commit {
        bail!("was begun by another build of cullbench; expected the same one");
    }
    Ok(())
}

/// A file may have changed since its first cells were measured, and the lens
/// of cameras that bring none: what the report has of the scenes and paths that
/// are asked for now must be of the very same items and cameras.
fn same_inputs(report: &Report, plan: &Plan) -> anyhow::Result<()> {
    for planned in &plan.scenes {
        let of_scene = |c: &&ReportCell| c.scene.name == planned.source;
        let Some(before) = report.cells.iter().find(of_scene) else {
            continue;
        };
        let scene = scene::load(&planned.source, &plan.load)?;
        let (was, is) = (&before.scene.digest, scene.digest());
        if *was != is {
            bail!(
                "scene '{}' has changed: its digest is {is}; expected {was} as in the cells \
                 measured before",
                planned.source
            );
        }
        for source in &planned.paths {
            let cells = report.cells.iter().filter(of_scene);
            let mut of_path = cells.filter(|c| c.path.name == *source);
            // Older reports do not tell.
            let Some(was) = of_path.find_map(|c| c.path.digest.as_ref()) else {
                continue;
            };
            let is = path::digest(&path::load(source, &scene, &plan.lens)?.cameras);
            if *was != is {
                bail!(
                    "path '{source}' has other cameras: their digest is {is}; expected {was} as \
                     in the cells measured before"
                );
            }
        }
    }
    Ok(())
}

/// What the report has already of a scene.
pub fn finished(report: &Report, scene: &str) -> BTreeSet<Question> {
    let cells = report.cells.iter().filter(|c| c.scene.name == scene);
    cells
        .map(|c| (c.path.name.clone(), c.path.cache == "cold", c.test.clone()))
        .collect()
}
