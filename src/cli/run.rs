//! `cullbench run`, the main job: plan, measure scene by scene, keep every
//! finished cell on disk, show a ranked table per scene.

use std::collections::BTreeSet;
use std::fs;
use std::io::{self, Write};
use std::path::{Path, PathBuf};
use std::time::{Instant, SystemTime, UNIX_EPOCH};

use anyhow::{Context, bail};
use indicatif::{ProgressBar, ProgressStyle};

use super::args::RunArgs;
use super::run_table::show_scene;
use super::{Ending, interrupt, text, unread_is_fine};
use cullbench::culling::{Culling, CullingTest};
use cullbench::index::{StructureSpec, structures};
use cullbench::kernel::Kernel;
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
    /// The culling tests with everything else as asked for.
    cullings: Vec<Culling>,
    lens: LensDefaults,
    load: LoadOptions,
    caches: Vec<bool>,
}

impl Plan {
    fn new(args: &RunArgs) -> anyhow::Result<Plan> {
        let suite = Suite::named(&args.suite).ok_or_else(|| {
            SpecError::unknown("suite", &args.suite, SUITES.iter().map(|s| s.name))
        })?;
        let tests = args.test.iter().flat_map(|t| t.split(','));
        let mut cullings: Vec<Culling> = Vec::new();
        for test in tests {
            let culling = args.culling.culling(test)?;
            culling.check()?;
            if cullings.contains(&culling) {
                bail!("test '{test}' is named twice");
            }
            cullings.push(culling);
        }
        let plan = Plan {
            suite,
            from_suite: args.scene.is_empty() && args.path.is_empty(),
            scenes: scenes(args, suite),
            structures: structures(&args.structure.join(","))?,
            cullings,
            lens: args.lens.defaults()?,
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
        let as_it_comes = plan.lens == LensDefaults::default()
            && plan.cullings.iter().all(|c| {
                let test = c.test;
                *c == Culling {
                    test,
                    ..Culling::default()
                }
            });
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
                for culling in &self.cullings {
                    Workload::new(&scene, &path, culling)?;
                }
            }
        }
        Ok(())
    }

    /// Everything that is asked on a scene with these paths: tests over boxes
    /// before those over spheres, so that structures are built twice at most.
    fn questions(&self, paths: &[String]) -> Vec<Question> {
        let mut questions = Vec::new();
        let of_spheres = |c: &&Culling| c.test == CullingTest::Sphere;
        let (spheres, boxes): (Vec<&Culling>, Vec<&Culling>) =
            self.cullings.iter().partition(of_spheres);
        for cullings in [boxes, spheres] {
            for path in paths {
                for &cold in &self.caches {
                    let tests = cullings.iter().map(|c| c.test.name().to_owned());
                    questions.extend(tests.map(|test| (path.clone(), cold, test)));
                }
            }
        }
        questions
    }

    fn culling(&self, test: &str) -> Culling {
        let named = self.cullings.iter().find(|c| c.test.name() == test);
        named.copied().unwrap_or_default()
    }

    fn groups(&self) -> usize {
        self.scenes
            .iter()
            .map(|(_, paths)| paths.len())
            .sum::<usize>()
            * self.caches.len()
            * self.cullings.len()
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
    args.kernel.choose()?;
    let plan = Plan::new(args)?;
    let machine = Machine::capture();
    interrupt::from_now_on_finish();
    let (mut folder, mut report) = open(args, &plan, &machine)?;
    let started = Instant::now();
    let bar = progress(plan.groups() as u64);
    let sweep = machine.cache_sweep_bytes();
    let mut interrupted = false;
    for (source, paths) in &plan.scenes {
        let done: BTreeSet<Question> = finished(&report, source);
        let mut shown = 0;
        let questions = plan.questions(paths);
        if questions.iter().any(|question| !done.contains(question)) {
            bar.set_message(format!("{source}: building"));
            let scene = scene::load(source, &plan.load)?;
            let info = SceneInfo::of(&scene);
            same_scene(&report, &info)?;
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
                let measured = measure(&plan, &culling, &scene, path, contenders, &protocol)?;
                let Some((path, group)) = measured else {
                    interrupted = true;
                    break;
                };
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

/// A path, whether caches are cold, and the culling test.
type Question = (String, bool, String);

/// What the report has already of a scene.
fn finished(report: &Report, scene: &str) -> BTreeSet<Question> {
    let cells = report.cells.iter().filter(|c| c.scene.name == scene);
    cells
        .map(|c| (c.path.name.clone(), c.path.cache == "cold", c.test.clone()))
        .collect()
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

type Measured = (PathInfo, cullbench::measure::Group);

/// `None` if interrupted.
fn measure(
    plan: &Plan,
    culling: &Culling,
    scene: &Scene,
    source: &str,
    contenders: &[Contender],
    protocol: &Protocol,
) -> anyhow::Result<Option<Measured>> {
    let path = path::load(source, scene, &plan.lens)?;
    let workload = Workload::new(scene, &path, culling)?;
    let info = PathInfo::of(source, &workload, protocol.cold);
    let group = measure_group(&workload, contenders, "linear", protocol, &interrupt::asked);
    Ok(group.map(|group| (info, group)))
}

/// Puts a finished group on disk.
fn keep(
    folder: &mut RunFolder,
    report: &mut Report,
    test: &str,
    scene: &SceneInfo,
    path: &PathInfo,
    group: cullbench::measure::Group,
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
