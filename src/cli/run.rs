//! `cullbench run`, the main job: plan, measure scene by scene, keep every
//! finished cell on disk, show a ranked table per scene.

use std::collections::BTreeSet;
use std::fs;
use std::io::{self, Write};
use std::path::{Path, PathBuf};
use std::time::{Instant, SystemTime, UNIX_EPOCH};

use anyhow::{Context, bail};
use comfy_table::Table;
use indicatif::{ProgressBar, ProgressStyle};

use super::args::{RunArgs, test_named};
use super::{Ending, interrupt, text, unread_is_fine};
use cullbench::camera::PlaneOptions;
use cullbench::index::{StructureSpec, structures};
use cullbench::measure::{
    Contender, Machine, PathInfo, Protocol, SceneInfo, Source, Toolchain, Workload,
    harness_overhead_ns, measure_group,
};
use cullbench::path::{self, LensDefaults};
use cullbench::report::{Noise, Report, ReportCell, RunFolder, RunInfo, SCHEMA_VERSION};
use cullbench::scene::{self, GENERATOR_NAME, LoadOptions, Scene};
use cullbench::spec::SpecError;
use cullbench::suite::{DEFAULT_PATH, SUITES, Suite};

/// What is to be done, checked as far as possible before anything runs.
struct Plan {
    suite: &'static Suite,
    /// Whether scenes and paths are the suite's own.
    from_suite: bool,
    scenes: Vec<(String, Vec<String>)>,
    structures: Vec<StructureSpec>,
    test: &'static str,
    lens: LensDefaults,
    planes: PlaneOptions,
    load: LoadOptions,
    caches: Vec<bool>,
}

impl Plan {
    fn new(args: &RunArgs) -> anyhow::Result<Plan> {
        let suite = Suite::named(&args.suite).ok_or_else(|| {
            SpecError::unknown("suite", &args.suite, SUITES.iter().map(|s| s.name))
        })?;
        let mut tests = args
            .test
            .iter()
            .map(|t| test_named(t))
            .collect::<Result<Vec<_>, _>>()?;
        tests.dedup();
        let plan = Plan {
            suite,
            from_suite: args.scene.is_empty() && args.path.is_empty(),
            scenes: scenes(args, suite),
            structures: structures(&args.structure.join(","))?,
            test: tests.first().copied().unwrap_or("six-plane"),
            lens: args.lens.defaults()?,
            planes: args.lens.plane_options()?,
            load: LoadOptions {
                skip_bad_items: args.scene_args.skip_bad_items,
            },
            caches: if args.cold {
                vec![false, true]
            } else {
                vec![false]
            },
        };
        plan.check_names()?;
        // A suite as it comes is known to be sound.
        let as_it_comes =
            plan.lens == LensDefaults::default() && plan.planes == PlaneOptions::default();
        if !(plan.from_suite && as_it_comes) {
            plan.check_inputs()?;
        }
        Ok(plan)
    }

    /// A cell is found by its names: each may come once.
    fn check_names(&self) -> anyhow::Result<()> {
        for (i, (scene, paths)) in self.scenes.iter().enumerate() {
            if self.scenes[..i].iter().any(|other| other.0 == *scene) {
                bail!("scene '{scene}' is named twice");
            }
            for (k, path) in paths.iter().enumerate() {
                if paths[..k].contains(path) {
                    bail!("path '{path}' is named twice");
                }
            }
        }
        Ok(())
    }

    /// A mistake in the last file should not show after an hour.
    fn check_inputs(&self) -> anyhow::Result<()> {
        for (source, paths) in &self.scenes {
            let scene = scene::load(source, &self.load)?;
            for source in paths {
                let path = path::load(source, &scene, &self.lens)?;
                Workload::new(&scene, &path, &self.planes)?;
            }
        }
        Ok(())
    }

    fn groups(&self) -> usize {
        self.scenes
            .iter()
            .map(|(_, paths)| paths.len())
            .sum::<usize>()
            * self.caches.len()
    }
}

fn scenes(args: &RunArgs, suite: &Suite) -> Vec<(String, Vec<String>)> {
    let chosen = |paths: &[&str]| -> Vec<String> {
        match args.path.is_empty() {
            true => paths.iter().map(|&p| p.to_owned()).collect(),
            false => args.path.clone(),
        }
    };
    if args.scene.is_empty() {
        let plan = suite.plan.iter();
        return plan
            .map(|(scene, paths)| ((*scene).to_owned(), chosen(paths)))
            .collect();
    }
    args.scene
        .iter()
        .map(|scene| (scene.clone(), chosen(&[DEFAULT_PATH])))
        .collect()
}

pub fn run(args: &RunArgs) -> anyhow::Result<Ending> {
    let plan = Plan::new(args)?;
    let machine = Machine::capture();
    interrupt::from_now_on_finish();
    let (mut folder, mut report) = open(args, &plan, &machine)?;
    let started = Instant::now();
    let bar = progress(plan.groups() as u64);
    let sweep = machine.cache_sweep_bytes();
    let mut interrupted = false;
    for (source, paths) in &plan.scenes {
        let done: BTreeSet<(String, bool)> = finished(&report, source);
        let mut shown = 0;
        if paths.iter().any(|p| {
            plan.caches
                .iter()
                .any(|&cold| !done.contains(&(p.clone(), cold)))
        }) {
            bar.set_message(format!("{source}: building"));
            let scene = scene::load(source, &plan.load)?;
            let info = SceneInfo::of(&scene);
            same_scene(&report, &info)?;
            let contenders = contenders(&plan, &scene);
            for (path, cold) in paths
                .iter()
                .flat_map(|p| plan.caches.iter().map(move |&c| (p, c)))
            {
                if done.contains(&(path.clone(), cold)) {
                    bar.inc(1);
                    continue;
                }
                bar.set_message(format!("{source}, {path}"));
                let protocol = Protocol {
                    min_rounds: plan.suite.min_rounds,
                    max_rounds: plan.suite.max_rounds,
                    budget: plan.suite.budget,
                    pass: plan.suite.pass,
                    cold,
                    seed: args.seed,
                    overhead_ns: report.noise.harness_overhead_ns,
                    cache_bytes: sweep,
                };
                let measured = measure(&plan, &scene, path, &contenders, &protocol)?;
                let Some((path, group)) = measured else {
                    interrupted = true;
                    break;
                };
                keep(&mut folder, &mut report, &plan, &info, &path, group)?;
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
    unread_is_fine(close(&report, &folder, started, interrupted))?;
    let failed = report.cells.iter().any(|c| c.status.is_failure());
    Ok(match (interrupted, failed) {
        (true, _) => Ending::Interrupted,
        (false, true) => Ending::WrongAnswer,
        (false, false) => Ending::Ok,
    })
}

/// A new folder with an empty report, or the one to go on with.
fn open(args: &RunArgs, plan: &Plan, machine: &Machine) -> anyhow::Result<(RunFolder, Report)> {
    if args.resume {
        let path = match &args.out {
            Some(path) => path.clone(),
            None => newest_unfinished(Path::new("results"))?,
        };
        let (folder, report) = RunFolder::resume(&path)?;
        same_experiment(&report, plan, args).with_context(|| path.display().to_string())?;
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
    };
    let folder = RunFolder::create(&path)?;
    folder.save(&report)?;
    Ok((folder, report))
}

/// RFC 3339 in UTC, to the second.
fn utc_now() -> String {
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
        if cell.path.planes != plan.planes.method.name() || cell.path.epsilon != plan.planes.epsilon
        {
            bail!("holds cells with other planes or epsilon; expected those asked for now");
        }
    }
    if report.run.seed != args.seed {
        bail!(
            "was begun with --seed {}; expected the same now",
            report.run.seed
        );
    }
    let now = Toolchain::capture();
    if report.toolchain != now || report.source.commit != Source::capture().commit {
        bail!("was begun by another build of cullbench; expected the same one");
    }
    Ok(())
}

/// A file may have changed since its first cells were measured.
fn same_scene(report: &Report, now: &SceneInfo) -> anyhow::Result<()> {
    let of_scene = |c: &&ReportCell| c.scene.name == now.name;
    match report.cells.iter().find(of_scene) {
        Some(cell) if cell.scene.digest != now.digest => bail!(
            "scene '{}' has changed: its digest is {}; expected {} as in the cells measured before",
            now.name,
            now.digest,
            cell.scene.digest
        ),
        _ => Ok(()),
    }
}

/// Paths of a scene that the report has already, with their cache state.
fn finished(report: &Report, scene: &str) -> BTreeSet<(String, bool)> {
    let cells = report.cells.iter().filter(|c| c.scene.name == scene);
    cells
        .map(|c| (c.path.name.clone(), c.path.cache == "cold"))
        .collect()
}

/// All structures, and the first proper one a second time: the twin whose
/// ratio to itself is the noise floor.
fn contenders(plan: &Plan, scene: &Scene) -> Vec<Contender> {
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
        .map(|(spec, is_twin)| Contender::build(spec.clone(), is_twin, scene))
        .collect()
}

type Measured = (PathInfo, cullbench::measure::Group);

/// `None` if interrupted.
fn measure(
    plan: &Plan,
    scene: &Scene,
    source: &str,
    contenders: &[Contender],
    protocol: &Protocol,
) -> anyhow::Result<Option<Measured>> {
    let path = path::load(source, scene, &plan.lens)?;
    let workload = Workload::new(scene, &path, &plan.planes)?;
    let info = PathInfo {
        name: source.to_owned(),
        camera_count: workload.volumes.len(),
        cache: if protocol.cold { "cold" } else { "warm" }.to_owned(),
        planes: plan.planes.method.name().to_owned(),
        epsilon: plan.planes.epsilon,
    };
    let group = measure_group(&workload, contenders, "linear", protocol, &interrupt::asked);
    Ok(group.map(|group| (info, group)))
}

/// Puts a finished group on disk.
fn keep(
    folder: &mut RunFolder,
    report: &mut Report,
    plan: &Plan,
    scene: &SceneInfo,
    path: &PathInfo,
    group: cullbench::measure::Group,
) -> anyhow::Result<()> {
    let mut append = |label: &str| {
        let own = group.samples.iter().filter(|(l, _, _)| l == label);
        let samples: Vec<_> = own.map(|(_, task, sample)| (*task, *sample)).collect();
        folder.append(
            [&scene.name, &path.name, &path.cache, label],
            samples.iter(),
        )
    };
    if let Some(twin) = &group.twin {
        append(&format!("{}#twin", twin.structure))?;
        report.noise.add(&scene.name, path, twin);
    }
    for cell in group.cells {
        let samples = append(&cell.structure)?;
        let samples = (samples.rows > 0).then_some(samples);
        report
            .cells
            .push(ReportCell::new(scene, path, plan.test, cell, samples));
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

fn show_scene(report: &Report, scene: &str) -> io::Result<()> {
    let cells: Vec<&ReportCell> = report
        .cells
        .iter()
        .filter(|c| c.scene.name == scene)
        .collect();
    let Some(first) = cells.first() else {
        return Ok(());
    };
    let mut table = text::table(
        &[
            "path / structure",
            "cull rate",
            "query median",
            "p95",
            "times linear [95 % interval]",
            "build",
            "B/item",
            "locate",
            "status",
        ],
        &[1, 2, 3, 4, 5, 6, 7],
    );
    let mut groups: Vec<&PathOf> = Vec::new();
    let keys: Vec<PathOf> = cells.iter().map(|c| path_of(c)).collect();
    for key in &keys {
        if !groups.contains(&key) {
            groups.push(key);
        }
    }
    for group in groups {
        let of_path = cells
            .iter()
            .filter(|c| path_of(c) == *group)
            .copied()
            .collect();
        add_path(&mut table, of_path, report.noise.aa_floor.unwrap_or(0.0));
    }
    let mut out = io::stdout().lock();
    writeln!(
        out,
        "\n{scene}: {} items, {} regions{}",
        text::count(first.scene.total_count),
        text::count(first.scene.region_count),
        match first.scene.skipped_items {
            0 => String::new(),
            bad => format!(", {} bad items left out", text::count(bad)),
        }
    )?;
    writeln!(out, "{table}")?;
    for cell in cells.iter().filter(|c| c.reason.is_some()) {
        let reason = cell.reason.as_deref().unwrap_or_default();
        writeln!(
            out,
            "{} on {}: {}: {reason}",
            cell.structure,
            cell.path.name,
            cell.status.name()
        )?;
    }
    out.flush()
}

type PathOf = (String, String);

fn path_of(cell: &ReportCell) -> PathOf {
    (cell.path.name.clone(), cell.path.cache.clone())
}

/// The rows of one path, fastest first; what failed comes last, unranked.
fn add_path(table: &mut Table, mut cells: Vec<&ReportCell>, floor: f64) {
    let key = |c: &ReportCell| match c.status {
        cullbench::measure::Status::Ok => c.value("query_ns").unwrap_or(f64::MAX),
        _ => f64::INFINITY,
    };
    cells.sort_by(|a, b| key(a).total_cmp(&key(b)));
    let Some(first) = cells.first() else { return };
    let head = match first.path.cache.as_str() {
        "warm" => first.path.name.clone(),
        cache => format!("{} ({cache})", first.path.name),
    };
    let culled = cells.iter().find_map(|c| c.value("cull_rate"));
    table.add_row([head, culled.map(text::percent).unwrap_or_default()]);
    let (mut rank, mut leader) = (0, 0.0);
    for (place, cell) in cells.iter().enumerate() {
        let value =
            |name: &str, show: fn(f64) -> String| cell.value(name).map(show).unwrap_or_default();
        // Within the noise floor of the leader of its rank: a tie.
        if rank == 0 || key(cell) > leader * (1.0 + floor) {
            (rank, leader) = (place + 1, key(cell));
        }
        let number = if key(cell).is_finite() {
            rank.to_string()
        } else {
            "-".to_owned()
        };
        let ratio = cell.metrics.get("ratio_to_linear").map(|m| {
            let interval = m.lower.zip(m.upper).map(|(lower, upper)| {
                format!(
                    " [{}, {}]",
                    text::significant(lower),
                    text::significant(upper)
                )
            });
            format!(
                "{}{}",
                text::significant(m.value),
                interval.unwrap_or_default()
            )
        });
        table.add_row([
            format!("  {number} {}", cell.structure),
            String::new(),
            value("query_ns", text::time),
            value("query_ns_p95", text::time),
            ratio.unwrap_or_default(),
            value("build_ms", |ms| text::time(ms * 1e6)),
            value("memory_bytes_per_item", |b| format!("{b:.1}")),
            value("locate_ns", text::time),
            cell.status.name().to_owned(),
        ]);
    }
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
