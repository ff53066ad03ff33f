//! Commands that time in processes: `advise`, `drift`, `funnel`, `precision`.
//!
//! Their inputs, their progress bar, and the collection of times from all processes.

use std::io::{self, Write as _};
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

use anyhow::Context;
use indicatif::{HumanDuration, ProgressBar, ProgressState, ProgressStyle};
use serde::Serialize;
use serde_json::json;

use super::processes::{Job, Message, Timing, Workers};
use super::run_resume::typed_args;
use super::shared_args::{SpreadArgs, StudyArgs, TableFormat};
use super::{Ending, interrupt, load_scene, print, tell, text};
use crate::index::Registry;
use crate::input::{is_readable, tell_warnings, warn};
use crate::measure::{Machine, NO_ITEMS, ProcessTimes, Setting, Status};
use crate::path;
use crate::scene::{self, Scene, split_part};

/// Fewest and most rounds of a task if a single process does them all.
pub const ROUNDS: [usize; 2] = [5, 15];

/// A progress bar of `parts` parts, with a word for them.
pub fn progress(parts: u64, word: &str) -> ProgressBar {
    // Drawn on stderr, and only if that is a terminal.
    let template = format!("{{bar:24}} {{pos}}/{{len}}{word}  {{elapsed}}{{left}}  {{wide_msg}}");
    let style = ProgressStyle::with_template(&template);
    let left = |state: &ProgressState, out: &mut dyn std::fmt::Write| {
        // Parts differ too much for the speed of the last seconds. Before the first part is done
        // nothing is known.
        let undone = state.len().unwrap_or(0).saturating_sub(state.pos());
        if state.pos() > 0 {
            let left = state.elapsed().mul_f64(undone as f64 / state.pos() as f64);
            let _ = write!(out, ", {:#} left", HumanDuration(left));
        }
    };
    let bar = ProgressBar::new(parts);
    let style = style.unwrap_or_else(|_| ProgressStyle::default_bar());
    bar.set_style(style.with_key("left", left));
    bar
}

/// Reports progress in `parts` if no bar is drawn: a line per minute.
pub fn tell_progress(bar: &ProgressBar, parts: &str, told: &mut Instant) {
    if bar.is_hidden() && told.elapsed() >= Duration::from_secs(60) {
        *told = Instant::now();
        let (done, all) = (bar.position(), bar.length().unwrap_or(0));
        let left = all.saturating_sub(done) as f64 / done.max(1) as f64;
        let left = HumanDuration(bar.elapsed().mul_f64(left));
        tell!("at work: {done} of {all} {parts} done, {left:#} left");
    }
}

/// Loads the inputs that the arguments name; with `timing`, in a worker.
///
/// The command itself checks memory for structures, `each` per named one and some `more`, and for
/// bytes per triangle.
pub fn load(
    registry: &Registry,
    args: &StudyArgs,
    rounds: [usize; 2],
    timing: Option<&Timing>,
    [each, more, per_triangle]: [u64; 3],
) -> anyhow::Result<Setting> {
    let structures = args.kernel.structures(registry, &args.structure)?;
    // An impossible lens is reported before anything is loaded.
    let lens = args.lens.defaults()?;
    let mut options = args.lens.scene_args.options(0);
    let scene = match timing {
        None => {
            options.structures = each * structures.len() as u64 + more;
            options.per_triangle = per_triangle;
            load_scene(&args.scene, &options)?
        }
        Some(_) => scene::load(&args.scene, &options)?,
    };
    if scene.items.is_empty() {
        return Err(LeftOut(scene.name).into());
    }
    let lens_scale = timing.and_then(|timing| timing.lens_scale);
    let process = timing.map_or(0, |timing| timing.process);
    Ok(Setting {
        path: path::load_scaled(&args.path, &scene, &lens, lens_scale)?,
        protocol: args.spread.protocol(rounds, process),
        structures,
        scene,
    })
}

/// Notes for readers of tables that boxes of a file are taken as solid.
pub fn note_solid(scene: &Scene, format: TableFormat) {
    let is_file = is_readable(Path::new(split_part(&scene.name).0));
    let is_boxes = scene.surfaces.is_none() && scene.own_tree.is_none();
    if format == TableFormat::Table && is_file && is_boxes {
        warn("items count as solid boxes; the meshes in them may hide less");
        tell_warnings();
    }
}

/// A scene without items, which is no failure: a run leaves it out too.
#[derive(Debug, thiserror::Error)]
#[error("{0}: left out: {NO_ITEMS}")]
pub struct LeftOut(String);

/// The ending of a study; prints why nothing was measured or written.
pub fn or_left_out(
    format: TableFormat,
    files: &[&Option<PathBuf>],
    ended: anyhow::Result<Ending>,
) -> anyhow::Result<Ending> {
    let Err(error) = ended else { return ended };
    let left_out = error.downcast::<LeftOut>()?;
    let LeftOut(scene) = &left_out;
    let document = json!({ "scene": scene, "status": Status::LeftOut, "reason": NO_ITEMS });
    let line = text::plain(&left_out.to_string());
    print(format, &document, || writeln!(io::stdout(), "{line}"))?;
    for file in files.iter().filter_map(|file| file.as_ref()) {
        tell!("note: {}: not written", file.display());
    }
    Ok(Ending::Ok)
}

/// A study in progress.
pub struct Study {
    pub workers: Workers,
    pub bar: ProgressBar,
    /// Text before every step.
    about: String,
    processes: u32,
}

impl Study {
    /// A study of `before` steps, followed by the processes that time.
    ///
    /// # Errors
    /// The errors of [`Workers::new`]; an argument that is not text.
    pub fn new(about: String, before: u64, spread: &SpreadArgs) -> anyhow::Result<Study> {
        let processes = spread.processes;
        let bar = progress(before + u64::from(processes), "");
        if !bar.is_hidden() {
            // Elapsed time advances during a long step.
            bar.enable_steady_tick(Duration::from_secs(1));
        }
        Ok(Study {
            // No time limit.
            workers: Workers::new(typed_args()?, Duration::MAX, &std::env::temp_dir())?,
            bar,
            about,
            processes,
        })
    }

    /// Prints the amount of work and how long the defaults take, on a terminal only.
    pub fn announce(&self, work: &str, by_default: &str) {
        let times = text::counted(self.processes as usize, "process");
        let work = format!("{}{work}, timed in {times}", self.about);
        let line = format!("at work: {work}; the defaults take {by_default}");
        let busy = Machine::capture().busy();
        if let Some(busy) = busy.filter(|_| !self.bar.is_hidden()) {
            warn(&format!("{busy}: times and advice may differ"));
        }
        self.bar.suspend(tell_warnings);
        if !self.bar.is_hidden() {
            self.bar.suspend(|| tell(&line));
        }
    }

    /// Shows the step that begins.
    pub fn begin(&self, step: &str) {
        let message = format!("{}{step}", self.about);
        self.bar.set_message(text::plain(&message));
    }

    /// The times of all processes, one after the other, by the plan of the command.
    ///
    /// From now on Ctrl-C stops the work at the next safe point; before, it ends the program.
    pub fn times(
        self,
        step: &str,
        lens_scale: Option<f64>,
        plan: &impl Serialize,
    ) -> anyhow::Result<Vec<ProcessTimes>> {
        interrupt::from_now_on_finish();
        // Earlier steps say nothing about the duration of the parts.
        if self.bar.position() == 0 {
            self.bar.reset_elapsed();
        }
        let plan = serde_json::to_value(plan)?;
        let mut all = Vec::new();
        let mut told = Instant::now();
        for process in 0..self.processes {
            let timing = Timing {
                process,
                lens_scale,
                plan: plan.clone(),
            };
            let times = |said| match said {
                Message::Times(times) => Some(times),
                _ => None,
            };
            let (begin, job) = (|_: &str| self.begin(step), Job::Times(timing));
            let found = self.workers.found(process, job, &begin, times);
            all.extend(found.with_context(|| format!("process {}", process + 1))?);
            self.bar.inc(1);
            tell_progress(&self.bar, "steps", &mut told);
        }
        Ok(all)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_time_left_is_told_by_counted_parts() {
        let before = Duration::from_secs(3600);
        for done in [0, 1] {
            let spread = SpreadArgs {
                processes: 0,
                seed: 1,
            };
            let mut study = Study::new(String::new(), 1, &spread).unwrap();
            study.bar = study.bar.with_elapsed(before);
            let bar = study.bar.clone();
            bar.inc(done);
            study.times("", None, &()).unwrap();
            assert_eq!(bar.elapsed() < before, done == 0, "{done}");
        }
    }
}
