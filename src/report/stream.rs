//! The stream of a run: one JSON line for each part as soon as it is measured.
//!
//! Lines are appended and never rewritten, and the report is made from them. However a run ends,
//! all lines but the last are complete.

use std::collections::BTreeMap;
use std::io;
use std::time::{Duration, SystemTime, UNIX_EPOCH};

use serde::{Deserialize, Serialize};

use super::changes::{Fact, Setting, differences, facts, known};
use super::ranking::unique;
use super::surface::enter_growths;
use super::{Report, RunInfo, SCHEMA_VERSION, SamplesRef};
use crate::measure::{Group, GroupKey, Machine, Part, Plan, Source, Toolchain};
use crate::scene::GENERATOR_NAME;
use crate::shown::counted;
use crate::statistics::{geometric_mean, two_speeds};

/// A line of stream.jsonl.
#[derive(Clone, Copy, PartialEq, Debug, Serialize)]
#[serde(tag = "line", rename_all = "snake_case")]
pub enum Line<'l> {
    /// The first line: everything about the run except its cells.
    Run(&'l Header),
    /// Results of one process for one group of cells.
    Part(&'l StoredPart),
    /// All parts of the plan are present.
    Finished {
        /// RFC 3339, UTC.
        at: &'l str,
    },
}

/// Machine, program and options of a run.
#[derive(Clone, Default, PartialEq, Debug, Serialize, Deserialize)]
pub struct Header {
    /// [`SCHEMA_VERSION`](super::SCHEMA_VERSION) of the program that wrote it.
    pub schema_version: u32,
    /// The command and when it started.
    pub run: RunInfo,
    /// The arguments of `run`, to continue with.
    pub args: Vec<String>,
    /// The machine.
    pub machine: Machine,
    /// Compiler, flags and features of the program.
    pub toolchain: Toolchain,
    /// Version and commit of the program.
    pub source: Source,
    /// The groups of the plan, in order; for a shard its own.
    pub groups: Vec<GroupKey>,
    /// Groups of the whole plan, in order, if this run is a shard.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub whole: Vec<GroupKey>,
    /// The structures of the plan, as requested.
    pub structures: Vec<String>,
    /// SHA-256 of the program.
    pub binary: Option<String>,
    /// SHA-256 of the files of suite, cameras and motions, by name in the plan.
    #[serde(default, skip_serializing_if = "BTreeMap::is_empty")]
    pub files: BTreeMap<String, String>,
}

impl Line<'_> {
    /// The line as JSON, with its newline.
    ///
    /// # Errors
    /// None are expected: it consists of text, numbers and maps with text keys.
    pub fn to_json(&self) -> io::Result<Vec<u8>> {
        let mut text = serde_json::to_vec(self)?;
        text.push(b'\n');
        Ok(text)
    }
}

impl Header {
    /// Header of a plan that starts now on this machine, without a command line.
    pub fn of(plan: &Plan, machine: Machine, id: String, started_at: String) -> Header {
        let threads = plan.structures.iter().map(|s| s.execution.threads);
        Header {
            schema_version: SCHEMA_VERSION,
            run: RunInfo {
                id,
                started_at,
                seed: plan.seed,
                generator: GENERATOR_NAME.to_owned(),
                processes: plan.effort.processes,
                threads: threads.max().unwrap_or(1) as u32,
                ..RunInfo::default()
            },
            machine,
            toolchain: Toolchain::capture(),
            source: Source::capture(),
            groups: plan.groups(),
            structures: plan.structures.iter().map(|s| s.label.clone()).collect(),
            ..Header::default()
        }
    }

    /// The first fact of machine, build or program in which two runs differ.
    pub fn differs_in_place(&self, other: &Header) -> Option<Setting> {
        differences(self.place(), other.place()).next()
    }

    /// The first fact in which two plans differ, or else two machines or builds.
    pub fn differs(&self, other: &Header) -> Option<Setting> {
        let of_plans = differences(self.plan(), other.plan()).next();
        of_plans.or_else(|| self.differs_in_place(other))
    }

    fn place(&self) -> Vec<Fact> {
        let (machine, source) = (&self.machine, &self.source);
        let (version, features) = (self.schema_version.to_string(), machine.features.join(","));
        // The system reserves a varying part of it.
        let gib = |bytes: u64| format!("{:.0} GiB", bytes as f64 / f64::from(1 << 30));
        let memory = machine.memory_bytes.map(gib);
        let dirty = source.dirty.map(|dirty| dirty.to_string());
        let mut all = facts(machine, &self.toolchain);
        all.extend([
            ("program", "schema version", false, version),
            ("machine", "features", true, features),
            ("machine", "memory", true, known(&memory)),
            ("machine", "system", false, known(&machine.os)),
            ("program", "version", false, source.version.clone()),
            ("program", "commit", false, known(&source.commit)),
            ("program", "dirty", false, known(&dirty)),
            ("program", "digest", false, known(&self.binary)),
        ]);
        all
    }

    fn plan(&self) -> Vec<Fact> {
        let run = &self.run;
        let files = self.files.iter();
        let files = files.map(|(name, digest)| format!("{name} {digest:.8}"));
        vec![
            ("plan", "seed", false, run.seed.to_string()),
            ("plan", "suite", false, known(&run.suite)),
            ("plan", "generator", false, run.generator.clone()),
            ("plan", "processes", false, run.processes.to_string()),
            ("plan", "structures", false, self.structures.join(",")),
            ("plan", "files", false, files.collect::<Vec<_>>().join(",")),
        ]
    }

    /// The groups of the whole plan, in order.
    pub fn whole(&self) -> &[GroupKey] {
        let is_whole = self.whole.is_empty();
        if is_whole { &self.groups } else { &self.whole }
    }
}

/// A part with the length of samples.csv after it.
#[derive(Clone, Default, PartialEq, Debug, Serialize, Deserialize)]
pub struct StoredPart {
    /// Results of the process.
    pub part: Part,
    /// Rows of each structure or bound.
    pub rows: BTreeMap<String, u64>,
    /// Length of samples.csv after them, bytes.
    pub samples_end: u64,
}

/// The contents of a stream.
#[derive(Clone, Default, PartialEq, Debug)]
pub struct Stream {
    /// The first line.
    pub header: Header,
    /// Parts in the order of measurement.
    pub parts: Vec<StoredPart>,
    /// RFC 3339, UTC; `None` for a run that is running or was stopped.
    pub finished_at: Option<String>,
}

impl Stream {
    /// The stream of a run that has just started.
    pub fn of(header: Header) -> Stream {
        Stream {
            header,
            ..Stream::default()
        }
    }

    /// The lines of the file, in order.
    pub fn lines(&self) -> impl Iterator<Item = Line<'_>> {
        let parts = self.parts.iter().map(Line::Part);
        let finished = self.finished_at.iter().map(|at| Line::Finished { at });
        let first = std::iter::once(Line::Run(&self.header));
        first.chain(parts).chain(finished)
    }

    /// Returns true if every process has measured every group.
    pub fn is_finished(&self) -> bool {
        let processes = self.header.run.processes;
        let mut all = self.header.groups.iter();
        self.finished_at.is_some() && all.all(|key| (0..processes).all(|p| self.has(key, p)))
    }

    /// Returns true if the process has measured the group.
    pub fn has(&self, key: &GroupKey, process: u32) -> bool {
        let mut parts = self.parts.iter().map(|kept| &kept.part);
        parts.any(|part| part.key == *key && part.process == process)
    }

    /// The parts of a group, the first process first.
    pub fn of_group(&self, key: &GroupKey) -> Vec<&StoredPart> {
        let parts = self.parts.iter().filter(|kept| kept.part.key == *key);
        let mut parts: Vec<&StoredPart> = parts.collect();
        parts.sort_by_key(|kept| kept.part.process);
        parts
    }

    /// The report of every group that the first process has finished.
    pub fn report(&self) -> Report {
        let header = &self.header;
        let mut run = header.run.clone();
        run.finished_at.clone_from(&self.finished_at);
        let whole = header.whole().iter();
        run.missing = pairs(whole.filter(|key| !self.has(key, 0)));
        let mut report = Report {
            schema_version: SCHEMA_VERSION,
            run,
            machine: header.machine.clone(),
            toolchain: header.toolchain.clone(),
            source: header.source.clone(),
            ..Report::default()
        };
        let mut speeds = (0, 0);
        for key in &header.groups {
            let kept = self.of_group(key);
            let parts: Vec<Part> = kept.iter().map(|kept| kept.part.clone()).collect();
            if parts.first().is_none_or(|part| part.process != 0) {
                continue;
            }
            let mut group = Group::of(&parts);
            report.noise.twins.extend(group.twin);
            for cell in group.cells.iter_mut().chain(&mut group.bounds) {
                let rows = |kept: &&StoredPart| kept.rows.get(&cell.structure).copied();
                let rows = kept.iter().filter_map(rows).fold(0, u64::saturating_add);
                let file = super::writing::SAMPLES.to_owned();
                cell.samples_ref = (rows > 0).then_some(SamplesRef { file, rows });
            }
            report.cells.append(&mut group.cells);
            report.bounds.append(&mut group.bounds);
            for task in parts.iter().flat_map(|part| &part.tasks) {
                speeds.1 += 1;
                speeds.0 += usize::from(two_speeds(&task.rounds_ns).is_some());
            }
        }
        let twins = report.noise.twins.iter();
        report.noise.aa_ratio = geometric_mean(&twins.map(|twin| twin.ratio).collect::<Vec<_>>());
        report.noise.warnings = warnings(&report, speeds);
        enter_growths(&mut report);
        report
    }
}

/// Scenes with paths, each once.
pub(super) fn pairs<'k>(groups: impl IntoIterator<Item = &'k GroupKey>) -> Vec<String> {
    let pairs = groups.into_iter();
    unique(pairs.map(|key| format!("{} along {}", key.scene, key.path)))
}

/// Four digits that distinguish runs of the same second.
pub fn digits(clock: SystemTime) -> String {
    let since = clock.duration_since(SystemTime::UNIX_EPOCH);
    let nanos = since.map_or(0, |since| since.subsec_nanos());
    format!("{:04x}", (nanos ^ std::process::id()) & 0xFFFF)
}

/// RFC 3339 in UTC, to the second.
///
/// A clock out of range is clamped to the nearest valid date: that is no reason not to measure.
pub fn utc(clock: SystemTime) -> String {
    // 9999-12-31T23:59:59Z.
    let last = UNIX_EPOCH + Duration::from_secs(253_402_300_799);
    humantime::format_rfc3339_seconds(clock.clamp(UNIX_EPOCH, last)).to_string()
}

/// Causes of noisy times, with advice.
fn warnings(report: &Report, (two_speeds, tasks): (usize, usize)) -> Vec<String> {
    let mut warnings = Vec::new();
    if let Some(busy) = report.machine.busy() {
        let advice = "close other programs, or wait, and run again";
        warnings.push(format!("{busy}: {advice}"));
    }
    let (threads, cores) = (report.run.threads as usize, report.machine.cores);
    if threads > cores {
        let cores = counted(cores, "core");
        warnings.push(format!(
            "{threads} threads shared {cores}: their times say little"
        ));
    }
    if two_speeds * 10 > tasks {
        warnings.push(format!(
            "{two_speeds} of {tasks} timed tasks ran at two speeds (a shared core or a changing \
             clock frequency): ratios within a run allow for it, absolute times do not; fix the \
             frequency, or run on a machine of your own"
        ));
    }
    if report.toolchain.opt_level.as_deref() == Some("0") {
        let advice = "times are not those of a release; build with --release";
        warnings.push(format!("the program is not optimised: {advice}"));
    }
    let twins = report.noise.twins.iter();
    let holds = twins.filter_map(super::TwinEntry::holds_one);
    let (all, missed) = (holds.clone().count(), holds.filter(|holds| !holds).count());
    // One in twenty misses by chance; more than this number of `all` is not chance.
    if missed > 1 + all / 8 {
        warnings.push(format!(
            "of {all} structures that were entered twice, {missed} differ from themselves: the \
             intervals of this run are too narrow; raise --processes"
        ));
    }
    warnings
}
