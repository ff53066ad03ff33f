//! What the commands share that take their times in several processes of their own
//! (`advise`, `drift`, `funnel`, `precision`): the bar that says what is done, and how
//! the times of all processes come together.

use std::fmt::Write;
use std::time::Duration;

use indicatif::{HumanDuration, ProgressBar, ProgressState, ProgressStyle};

use super::processes::{Said, Workers};
use super::protocol::{Job, Timing};
use super::shared_args::SpreadArgs;
use super::{tell, text};
use crate::measure::ProcessTimes;

/// A bar of so many parts, with a word for them.
pub fn progress(parts: u64, word: &str) -> ProgressBar {
    // Drawn on stderr, and only if that is a terminal.
    let template = format!("{{bar:24}} {{pos}}/{{len}}{word}  {{elapsed}}{{left}}  {{msg}}");
    let style = ProgressStyle::with_template(&template);
    let left = |state: &ProgressState, out: &mut dyn Write| {
        // Before the first part is done nothing is known.
        if state.pos() > 0 {
            let _ = write!(out, ", {:#} left", HumanDuration(state.eta()));
        }
    };
    let bar = ProgressBar::new(parts);
    let style = style.unwrap_or_else(|_| ProgressStyle::default_bar());
    bar.set_style(style.with_key("left", left));
    bar
}

/// A study on its way.
pub struct Study {
    bar: ProgressBar,
    /// What stands before every step.
    about: String,
    /// Steps before the processes that take the times.
    before: u64,
    processes: u32,
}

impl Study {
    pub fn new(about: String, before: u64, spread: &SpreadArgs) -> Study {
        let processes = spread.processes;
        let bar = progress(before + u64::from(processes), "");
        if !bar.is_hidden() {
            // The time goes on while a step takes long.
            bar.enable_steady_tick(Duration::from_secs(1));
        }
        Study {
            bar,
            about,
            before,
            processes,
        }
    }

    /// Prints the amount of work, on a terminal or not, and how long the defaults take.
    pub fn announce(&self, work: &str, by_default: &str) {
        let times = text::counted(self.processes as usize, "process");
        let line = format!(
            "at work: {}{work}, timed in {times}; the defaults take {by_default}",
            self.about
        );
        self.bar.suspend(|| tell(&line));
    }

    /// Says what is done now.
    pub fn begin(&self, step: &str) {
        let message = format!("{}{step}", self.about);
        self.bar.set_message(text::plain(&message));
    }

    /// One more of the steps before the processes is done.
    pub fn advance(&self) {
        self.bar.inc(1);
    }

    /// The times of all processes, one after the other.
    pub fn times(
        self,
        workers: &Workers,
        step: &str,
        lens_scale: Option<f64>,
        job: impl Fn(Timing) -> Job,
    ) -> anyhow::Result<Vec<ProcessTimes>> {
        let mut all = Vec::new();
        for process in 0..self.processes {
            let timing = Timing {
                process,
                lens_scale,
            };
            let told = |_: &str| {
                self.bar.set_position(self.before + u64::from(process));
                self.begin(step);
            };
            let found = workers.found(process, job(timing), &told)?;
            all.extend(found.into_iter().filter_map(|said| match said {
                Said::Times(times) => Some(times),
                _ => None,
            }));
        }
        self.bar.finish_and_clear();
        Ok(all)
    }
}
