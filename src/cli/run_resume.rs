//! The folder of a run: a new one, or an unfinished one to continue.
//!
//! An unfinished run continues with its original options and plan, on the same machine and with the
//! same program.

use std::collections::BTreeSet;
use std::ffi::OsString;
use std::fs;
use std::path::{Path, PathBuf};
use std::time::SystemTime;

use anyhow::{Context, Result, bail, ensure};
use clap::parser::ValueSource;
use clap::{ArgMatches, CommandFactory, Parser};

use super::args::{Cli, Command, RunArgs};
use super::run_plan::{RunPlan, same_digest};
use super::{program, text};
use crate::measure::{Machine, Toolchain};
use crate::report::{
    Header, RunFolder, RunInfo, SCHEMA_VERSION, StoppedRun, Stream, digits, read_report,
    read_stream, utc,
};
use crate::scene;

/// Creates the folder of a new run.
pub fn create(args: &RunArgs, plan: &RunPlan, machine: Machine) -> Result<(RunFolder, Stream)> {
    let clock = SystemTime::now();
    let now = utc(clock);
    let id = digits(clock);
    let stamp: String = now.chars().filter(|c| !matches!(c, '-' | ':')).collect();
    let own = || PathBuf::from(format!("results/{stamp}-{}-{id}", machine.slug()));
    let path = args.out.clone().unwrap_or_else(own);
    let typed = typed_args()?;
    let mut header = Header::of(&plan.plan, machine, format!("{stamp}-{id}"), now);
    header.source = program::source();
    header.run.command = command_line(&typed);
    header.run.suite = plan.suite.clone();
    header.run.left_out.clone_from(&plan.left_out);
    header.run.shard.clone_from(&args.shard);
    header.args = typed;
    header.whole.clone_from(&plan.whole);
    header.binary = binary_digest();
    let groups = header.whole().iter();
    let names = groups.flat_map(|key| [&key.path, &key.motion]);
    let names: BTreeSet<&String> = names.chain(&args.what.suite).collect();
    let digest = |name: &String| Some((name.clone(), digest(Path::new(name))?));
    header.files = names.into_iter().filter_map(digest).collect();
    let folder = RunFolder::create(&path, &header)?;
    Ok((folder, Stream::of(header)))
}

/// The words of a command, quoted to be typed again.
pub fn command_line(typed: &[String]) -> String {
    let words = typed.iter().map(|word| text::quoted(word));
    let words = [program::name().to_owned()].into_iter().chain(words);
    words.collect::<Vec<_>>().join(" ")
}

/// The arguments after the program's name, for a worker to read again.
pub fn typed_args() -> Result<Vec<String>> {
    let typed = std::env::args_os().skip(1).map(OsString::into_string);
    let typed: Result<_, _> = typed.collect();
    typed.map_err(|bad| anyhow::anyhow!("argument {bad:?} is no UTF-8; expected text"))
}

/// SHA-256 of the running program; `None` if it cannot be read.
fn binary_digest() -> Option<String> {
    digest(&std::env::current_exe().ok()?)
}

/// SHA-256 of a file; `None` if it cannot be read, or is a pipe.
fn digest(file: &Path) -> Option<String> {
    let bytes = file.is_file().then(|| fs::read(file).ok())??;
    Some(scene::hex(&hmac_sha256::Hash::hash(&bytes)))
}

/// Opens the run to continue, with its options; writes nothing.
pub fn resume(args: &RunArgs) -> Result<(StoppedRun, Stream, RunArgs)> {
    let path = args.out.clone().map_or_else(newest_unfinished, Ok)?;
    let (folder, stream) = StoppedRun::open(&path)?;
    let place = || path.display().to_string();
    let begun = same_options(&stream.header.args).with_context(place)?;
    // Times of another machine or program do not belong in one report.
    let kernel = begun.what.culling.kernel.execution().with_context(place)?;
    let here = Header {
        schema_version: SCHEMA_VERSION,
        machine: Machine::capture().by(kernel.kernel),
        toolchain: Toolchain::capture(),
        source: program::source(),
        binary: binary_digest(),
        ..stream.header.clone()
    };
    if let Some(differs) = stream.header.differs_in_place(&here) {
        let why = format!("{differs} here; expected the same: begin a new run");
        return Err(anyhow::Error::msg(why).context(place()));
    }
    let suite = begun.what.suite.as_deref().unwrap_or_default();
    // A missing file is reported by its reader.
    let before = stream.header.files.get(suite).cloned();
    if let Some(now) = digest(Path::new(suite)) {
        same_digest("suite", suite, before, || now.clone()).with_context(place)?;
    }
    Ok((folder, stream, begun))
}

/// Options that do not change the measurement.
const NOT_OF_THE_PLAN: [&str; 6] = ["resume", "out", "timeout", "save", "all_columns", "why"];

/// The recorded options, unless those typed now contradict them.
fn same_options(recorded: &[String]) -> Result<RunArgs> {
    let before = TypedOptions::recorded(recorded)?;
    let now = TypedOptions::of("run", "run", std::env::args_os())?;
    for (id, name, _) in now.typed() {
        ensure!(
            NOT_OF_THE_PLAN.contains(&id) || before.values(id) == now.values(id),
            "--{name} is '{}', and the run was begun {}; expected the same or none: \
             --resume continues with the recorded options",
            now.values(id).join(" "),
            before.told(id)
        );
    }
    // Options typed now that are not part of the plan replace recorded ones.
    let is_new = |name: &str| !now.words(|typed| typed == name).is_empty();
    let mut line = [program::name(), "run"].map(str::to_owned).to_vec();
    line.extend(before.words(|name| !is_new(name)));
    line.extend(now.words(|_| true));
    let all = Cli::try_parse_from(line);
    match all.map_err(one_line)?.command {
        Command::Run(args) => Ok(args),
        _ => bail!(NO_RUN),
    }
}

/// Message if there is no run.
const NO_RUN: &str = "no run was recorded there; expected the folder of a run";

/// Checks that two runs have the same options, except folder and shard.
pub fn same_recorded(one: &[String], other: &[String]) -> Result<()> {
    let (one, other) = (TypedOptions::recorded(one)?, TypedOptions::recorded(other)?);
    for (id, name, _) in one.all() {
        let is_free = id == "shard" || NOT_OF_THE_PLAN.contains(&id);
        let (first, this) = (one.told(id), other.told(id));
        ensure!(
            is_free || first == this,
            "was begun {this} for --{name}, and the first shard {first}; expected the same options"
        );
    }
    Ok(())
}

/// An error of recorded options, which is not a usage error of this command.
fn one_line(error: clap::Error) -> anyhow::Error {
    let line = program::one_line(&error).map(|line| format!("recorded options: {line}"));
    anyhow::Error::msg(line.unwrap_or_else(|| NO_RUN.to_owned()))
}

/// The options of a command, as typed after it or after another command.
pub struct TypedOptions {
    matches: ArgMatches,
    owner: clap::Command,
}

impl TypedOptions {
    /// The options of a started run.
    pub fn recorded(args: &[String]) -> Result<TypedOptions> {
        let line = [&[program::name().to_owned()][..], args].concat();
        TypedOptions::of("run", "run", line)
    }

    /// The options of `owner` in a line of `command`.
    pub fn of(
        command: &str,
        owner: &str,
        line: impl IntoIterator<Item = impl Into<OsString> + Clone>,
    ) -> Result<TypedOptions> {
        let mut cli = Cli::command();
        let matches = cli.try_get_matches_from_mut(line).map_err(one_line)?;
        let matches = matches.subcommand_matches(command).cloned();
        let owner = cli.find_subcommand(owner).cloned();
        Ok(TypedOptions {
            matches: matches.context(NO_RUN)?,
            owner: owner.context(NO_RUN)?,
        })
    }

    /// Ids and names of all options; true for those with a value.
    fn all(&self) -> impl Iterator<Item = (&str, &str, bool)> {
        self.owner.get_arguments().map(|arg| {
            let id = arg.get_id().as_str();
            (
                id,
                arg.get_long().unwrap_or(id),
                arg.get_action().takes_values(),
            )
        })
    }

    fn typed(&self) -> impl Iterator<Item = (&str, &str, bool)> {
        self.all().filter(|(id, ..)| {
            let is_known = self.matches.try_contains_id(id).unwrap_or(false);
            is_known && self.matches.value_source(id) == Some(ValueSource::CommandLine)
        })
    }

    /// The typed options as words, `--up=y`, whose names `is_wanted` accepts.
    pub fn words(&self, is_wanted: impl Fn(&str) -> bool) -> Vec<String> {
        let typed = self.typed().filter(|(_, name, _)| is_wanted(name));
        let words = typed.flat_map(|(id, name, has_value)| match has_value {
            true => (self.values(id).iter().map(|v| format!("--{name}={v}"))).collect(),
            false => vec![format!("--{name}")],
        });
        words.collect()
    }

    fn values(&self, id: &str) -> Vec<String> {
        let raw = self.matches.try_get_raw(id).ok().flatten();
        let raw = raw.into_iter().flatten();
        raw.map(|value| value.to_string_lossy().into_owned())
            .collect()
    }

    fn told(&self, id: &str) -> String {
        match self.values(id).join(" ") {
            none if none.is_empty() => "without it".to_owned(),
            value => format!("with '{value}'"),
        }
    }
}

/// The folder in results with the newest of the runs that `of` reads.
pub fn newest_run(of: impl Fn(&Path) -> Option<RunInfo>) -> Option<PathBuf> {
    // Without a folder of results there are no runs.
    let listing = fs::read_dir("results").into_iter().flatten().flatten();
    let runs = listing.filter_map(|entry| {
        let run = of(&entry.path())?;
        let changed = entry.metadata().and_then(|found| found.modified()).ok();
        Some((run.started_at, run.finished_at, changed, entry.path()))
    });
    runs.max().map(|(.., path)| path)
}

fn newest_unfinished() -> Result<PathBuf> {
    let found = newest_run(|path| {
        // A run killed at the very end lacks only its report.
        let report = read_report(&path.join("report.json"));
        let is_finished = report.is_ok_and(|report| report.run.finished_at.is_some());
        let stream = (!is_finished).then(|| read_stream(&path.join("stream.jsonl")));
        Some(stream?.ok()?.0.header.run)
    });
    let expected = "expected one to resume there, or its folder as --out DIR";
    found.with_context(|| format!("no unfinished run in results; {expected}"))
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::time::Duration;

    #[test]
    fn an_error_of_recorded_options_is_one_line() {
        for (recorded, wanted) in [
            (
                "run --no-such",
                "recorded options: unexpected argument '--no-such' found; expected",
            ),
            (
                "run --processes many",
                "recorded options: --processes is 'many'; expected a whole",
            ),
            (
                "run --help",
                "no run was recorded there; expected the folder of a run",
            ),
            (
                "list",
                "no run was recorded there; expected the folder of a run",
            ),
        ] {
            let words: Vec<String> = recorded.split(' ').map(str::to_owned).collect();
            let error = TypedOptions::recorded(&words)
                .err()
                .expect(recorded)
                .to_string();
            assert!(
                error.starts_with(wanted) && !error.contains('\n'),
                "{error}"
            );
        }
    }

    #[test]
    fn any_clock_dates_a_run() {
        let at = |seconds: i64| match u64::try_from(seconds) {
            Ok(after) => SystemTime::UNIX_EPOCH + Duration::from_secs(after),
            Err(_) => SystemTime::UNIX_EPOCH - Duration::from_secs(seconds.unsigned_abs()),
        };
        for (seconds, wanted) in [
            (-1, "1970-01-01T00:00:00Z"),
            (-99_999_999_999, "1970-01-01T00:00:00Z"),
            (0, "1970-01-01T00:00:00Z"),
            (1_700_000_000, "2023-11-14T22:13:20Z"),
            (253_402_300_799, "9999-12-31T23:59:59Z"),
            (253_402_300_800, "9999-12-31T23:59:59Z"),
            (9_000_000_000_000, "9999-12-31T23:59:59Z"),
        ] {
            assert_eq!(utc(at(seconds)), wanted, "{seconds}");
        }
    }
}
