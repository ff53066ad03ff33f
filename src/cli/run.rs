//! `cullbench run`, the main job, and `cullbench merge`.
//!
//! `run` plans, measures in separate processes, keeps every finished part on disk, and shows the
//! conclusion; `merge` joins the shards of a plan into one run.

use std::collections::BTreeMap;
use std::io::{self, Write};
use std::path::Path;
use std::time::{Duration, Instant, SystemTime};

use anyhow::{Context, Result, bail};
use indicatif::ProgressBar;

use super::args::{MergeArgs, RunArgs};
use super::document::show;
use super::interrupt::{self, Interrupted};
use super::processes::{Died, Job, Message, Workers};
use super::report::{close, shown, write_page};
use super::run_plan::{RunPlan, plan};
use super::run_resume::{TypedOptions, command_line, create, resume, same_recorded};
use super::study::{progress, tell_progress};
use super::{Ending, compare, expect_folder, program, run_why, text, unread_is_fine};
use crate::index::Registry;
use crate::input;
use crate::measure::{GroupKey, Machine, Part, Plan, Share, Verdict};
use crate::path::DEFAULT_PATH;
use crate::report::{
    Line, Report, RunFolder, Stream, comparisons, merge as join, read_stream, save_report, utc,
};

pub fn run(registry: &Registry, args: &RunArgs) -> Result<Ending> {
    expect_folder("--out", args.out.as_deref())?;
    let folder = args.save.as_ref().map(|_| Path::new(compare::BASELINES));
    expect_folder("--save", folder)?;
    if args.resume {
        let (stopped, stream, begun) = resume(args)?;
        let plan = plan(registry, &begun)?;
        plan.check_goes_on(&stream)
            .with_context(|| stopped.path.display().to_string())?;
        check_why(&begun, &plan)?;
        interrupt::from_now_on_finish();
        if stopped.lost > 0 {
            let (run, parts) = (stopped.path.display(), text::counted(stopped.lost, "part"));
            tell!("note: {run}: samples.csv lacks samples; {parts} measured again");
        }
        let folder = stopped.go_on(&stream)?;
        return Run::new(&begun, plan.plan, folder, stream)?.all();
    }
    let plan = plan(registry, args)?;
    check_why(args, &plan)?;
    plan.check_inputs()?;
    if args.plan {
        // The cells as JSON lines; nothing is measured.
        let mut out = io::stdout().lock();
        for cell in plan.plan.cells() {
            writeln!(out, "{}", serde_json::to_string(&cell)?)?;
        }
        out.flush()?;
        return Ok(Ending::Ok);
    }
    if plan.plan.scenes.is_empty() {
        bail!(
            "nothing to do: this shard has no scene; expected a shard per scene and path at most"
        );
    }
    interrupt::from_now_on_finish();
    let machine = Machine::capture().by(args.what.culling.kernel.execution()?.kernel);
    let (folder, stream) = create(args, &plan, machine)?;
    Run::new(args, plan.plan, folder, stream)?.all()
}

/// Refuses to explain a structure that is not measured.
fn check_why(args: &RunArgs, plan: &RunPlan) -> Result<()> {
    let labels = plan.plan.structures.iter().map(|spec| spec.label.as_str());
    let labels: Vec<&str> = labels.collect();
    let is_there = |why: &String| labels.iter().any(|label| run_why::is_named(label, why));
    if let Some(why) = args.why.as_ref().filter(|why| !is_there(why)) {
        let labels = labels.join(", ");
        bail!("--why is '{why}'; expected a structure that is measured: {labels}");
    }
    Ok(())
}

/// A run in progress.
struct Run<'a> {
    args: &'a RunArgs,
    plan: Plan,
    folder: RunFolder,
    stream: Stream,
    workers: Workers,
    bar: ProgressBar,
    started: Instant,
    /// Time of the last line about the progress.
    told: Instant,
    /// True if a part of the run existed before.
    resumes: bool,
}

impl<'a> Run<'a> {
    fn new(args: &'a RunArgs, plan: Plan, folder: RunFolder, stream: Stream) -> Result<Self> {
        let parts = plan.groups().len() as u64 * u64::from(plan.effort.processes);
        let left = parts.saturating_sub(stream.parts.len() as u64);
        let patience = Duration::from_secs(args.what.timeout);
        Ok(Run {
            bar: progress(left, ""),
            // Files in the run's folder: the next run removes those that a killed run leaves.
            workers: Workers::new(stream.header.args.clone(), patience, &folder.path)?,
            started: Instant::now(),
            told: Instant::now(),
            resumes: !stream.parts.is_empty(),
            args,
            plan,
            folder,
            stream,
        })
    }

    /// Measures all scenes; saves a finished run as the baseline that the options name.
    fn all(mut self) -> Result<Ending> {
        // The processes of a scene are spread over the run: another program that occupies the
        // caches for some seconds affects one process of every scene instead of all of one.
        let scenes = 0..self.plan.scenes.len();
        let processes = 0..self.plan.effort.processes;
        let mut all = processes.flat_map(|process| scenes.clone().map(move |s| (s, process)));
        let measured = all.try_for_each(|(scene, process)| self.process(scene, process));
        self.bar.finish_and_clear();
        let stopped = measured.is_err();
        // After an error measured parts are kept, but not an empty folder.
        let failed = measured.err().filter(|error| !error.is::<Interrupted>());
        if self.stream.parts.is_empty() {
            drop(self.workers);
            self.folder.discard();
            if failed.is_none() {
                tell!("interrupted: no cell was finished, and nothing was saved");
            }
            return failed.map_or(Ok(Ending::Interrupted), Err);
        }
        if !stopped && self.stream.finished_at.is_none() {
            let at = utc(SystemTime::now());
            self.folder.append(Line::Finished { at: &at })?;
            self.stream.finished_at = Some(at);
        }
        let report = self.stream.report();
        let (name, folder) = (program::name(), self.folder.path.display().to_string());
        let again = format!("{name} run --resume --out {}", text::quoted(&folder));
        if let Some(error) = failed {
            // A part of the cells gives no conclusion; files on disk are kept.
            let _ = save_report(&self.folder.path, &report);
            if error.chain().any(|cause| cause.is::<io::Error>()) {
                tell!("note: finished cells were saved; continue with {again}");
            }
            return Err(error);
        }
        // Tables before files: if a file cannot be written, the results are still seen.
        let mut blocks = shown(&report, self.args.all_columns, text::width());
        let why = || self.args.why.iter();
        let why = || why().flat_map(|structure| run_why::blocks(&report, structure));
        blocks.extend(why());
        let shown = unread_is_fine(show(&blocks));
        save_report(&self.folder.path, &report)?;
        write_page(&report, &self.folder.path, why().collect())?;
        let save = self.args.save.as_deref().filter(|_| !stopped);
        if let Some(name) = save {
            compare::save_baseline(name, &report)?;
        }
        shown?;
        unread_is_fine(self.close(&report, save))?;
        if stopped {
            tell!("interrupted: finished cells were saved; continue with {again}");
            return Ok(Ending::Interrupted);
        }
        Ok(Ending::of(!report.has_failed()))
    }

    /// One process of a scene, restarted after a structure has ended it.
    fn process(&mut self, scene: usize, process: u32) -> Result<()> {
        let planned = self.plan.scenes[scene].clone();
        let keys = self.plan.keys_of(&planned);
        // Structures that have ended a process on this scene.
        let before = self.stream.parts.iter().map(|kept| &kept.part);
        let before = before.filter(|part| part.key.scene == planned.source);
        let mut failed: BTreeMap<_, _> = before.flat_map(|part| part.failed.clone()).collect();
        loop {
            interrupt::check()?;
            let share = self.share(&keys, process, &failed);
            if !share.wanted.contains(&true) {
                return Ok(());
            }
            let Err(ended) = self.worker(scene, share) else {
                return Ok(());
            };
            match ended.downcast()? {
                Died(Some(structure), verdict) if !failed.contains_key(&structure) => {
                    failed.insert(structure, verdict);
                }
                // Not attributable to a structure.
                Died(_, verdict) => return self.fail_all(&failed, &keys, process, &verdict),
            }
        }
    }

    fn share(&self, keys: &[GroupKey], process: u32, failed: &BTreeMap<String, Verdict>) -> Share {
        let known = |key: &GroupKey| {
            let first = self.stream.of_group(key);
            let known = first.first().and_then(|kept| kept.part.known.clone());
            known.filter(|_| process > 0)
        };
        let wanted = keys.iter().map(|key| !self.stream.has(key, process));
        Share {
            plan_only: false,
            process,
            known: keys.iter().map(known).collect(),
            wanted: wanted.collect(),
            failed: failed.clone(),
        }
    }

    fn worker(&mut self, scene: usize, share: Share) -> Result<()> {
        let process = share.process;
        let job = Job::scene(scene, share, true);
        let source = self.plan.scenes[scene].source.clone();
        let processes = self.plan.effort.processes;
        let mut keep = |said| {
            if let Message::Part(part, samples) = said {
                self.stream.parts.push(self.folder.keep(*part, &samples)?);
                self.bar.inc(1);
                tell_progress(&self.bar, "parts", &mut self.told);
            }
            Ok(())
        };
        let step = |step: &str| {
            let at = format!("{source}, process {} of {processes}: {step}", process + 1);
            self.bar.set_message(text::plain(&at));
        };
        self.workers.see_through(process, job, &mut keep, &step)
    }

    /// Gives every cell that is still wanted this verdict.
    fn fail_all(
        &mut self,
        failed: &BTreeMap<String, Verdict>,
        keys: &[GroupKey],
        process: u32,
        verdict: &Verdict,
    ) -> Result<()> {
        // Later processes do not try a failed group again.
        let later = process..self.plan.effort.processes;
        let missed = keys.iter().filter(|key| !self.stream.has(key, process));
        let missed = missed.flat_map(|key| later.clone().map(move |process| (key, process)));
        let missed = missed.filter(|(key, process)| !self.stream.has(key, *process));
        let missed: Vec<_> = missed.collect();
        for (key, process) in missed {
            let before = self.stream.of_group(key);
            let before = before.first().map(|kept| &kept.part);
            let mut part = Part {
                process,
                failed: failed.clone(),
                ..Part::of_failed(key, &self.plan.structures, verdict)
            };
            if let Some(before) = before {
                (part.scene, part.path) = (before.scene.clone(), before.path.clone());
            }
            self.stream.parts.push(self.folder.keep(part, &[])?);
            self.bar.inc(1);
        }
        Ok(())
    }

    fn close(&self, report: &Report, save: Option<&str>) -> io::Result<()> {
        let seconds = self.started.elapsed().as_secs_f64();
        let time = [" in", ", resumed for"][usize::from(self.resumes)];
        let kept = save.map(|name| {
            let file = compare::baseline_file(name);
            format!("{}: compare --baseline {name}", file.display())
        });
        let next = next(report, &self.stream.header.args, text::width());
        let time = format!("{time} {seconds:.1} s");
        close(report, &time, next, &self.folder.path, kept)
    }
}

/// Options of a run that the suggested command repeats.
///
/// They determine how files are read, what a frame of moving items is, and the threads and
/// instructions of a query.
const KEPT: &str =
    "up items views update threads kernel skip-bad-items matrix-convention fovy aspect near far";

/// The next command that a reader will want, with its purpose if that fits.
///
/// Within `width` characters. `None` if nothing is ranked.
fn next(report: &Report, args: &[String], width: usize) -> Option<String> {
    let program = report.run.command.split(' ').next()?;
    let all = comparisons(report);
    let first = all.iter().find(|c| c.decides())?.about();
    if report.run.suite.is_some() {
        let gives = "the same for a scene of your own";
        return Some(format!("next    {program} run --scene FILE  {gives}"));
    }
    let option = |(name, value, usual): (&str, &String, &str)| {
        // A value that starts with a minus needs `=`.
        let sign = if value.starts_with('-') { "=" } else { " " };
        (value != usual).then(|| format!("--{name}{sign}{}", text::quoted(value)))
    };
    let (scene, path) = (&first.scene.name, &first.path);
    let mut line = format!("next    {program} advise {}", option(("scene", scene, ""))?);
    let others = [
        ("path", &path.name, DEFAULT_PATH),
        ("motion", &path.motion, ""),
    ];
    let recorded = TypedOptions::recorded(args).ok()?;
    let read = recorded.words(|name| KEPT.split(' ').any(|kept| kept == name));
    for option in others.into_iter().filter_map(option).chain(read) {
        let last = line.rsplit('\n').next().unwrap_or_default();
        let is_within = last.chars().count() + option.chars().count() < width;
        // The shell joins the lines.
        let gap = if is_within { " " } else { " \\\n        " };
        line += &format!("{gap}{option}");
    }
    // A pipe cannot be read again.
    if input::pipes().iter().any(|(pipe, _)| line.contains(pipe)) {
        return None;
    }
    let gives = "  which shortcuts pay here";
    let is_within = line.chars().count() + gives.len() <= width;
    Some(line + if is_within { gives } else { "" })
}

/// Joins the shards of a plan into one run, with the files of one.
pub fn merge(args: &MergeArgs) -> Result<Ending> {
    expect_folder("--out", Some(&args.out))?;
    let mut first: Option<Vec<String>> = None;
    for path in &args.runs {
        let other = read_stream(&path.join("stream.jsonl"))?.0.header.args;
        // The first too: its own options may be invalid.
        let first = first.get_or_insert_with(|| other.clone());
        same_recorded(first, &other).with_context(|| path.display().to_string())?;
    }
    let options = TypedOptions::recorded(&first.unwrap_or_default())?;
    let options = options.words(|name| !["shard", "out"].contains(&name));
    let kept = [&["run".to_owned()][..], &options].concat();
    let merged = join(&args.runs, (&kept, &command_line(&kept)))?;
    interrupt::from_now_on_finish();
    let check = || interrupt::check().map_err(io::Error::other);
    match merged.write(&args.out, &check) {
        Err(_) if interrupt::asked() => return Err(Interrupted.into()),
        written => written?,
    }
    let report = merged.stream.report();
    write_page(&report, &args.out, Vec::new())?;
    unread_is_fine(show(&shown(&report, false, text::width())))?;
    let shards = format!(" of {}", text::counted(args.runs.len(), "shard"));
    unread_is_fine(close(&report, &shards, None, &args.out, None))?;
    Ok(Ending::of(!report.has_failed()))
}
