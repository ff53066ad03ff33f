//! The command line: from arguments to a validated plan to one file per command.
//!
//! Defines exit codes, progress and tables, and no arithmetic.
//!
//! A function of a [`Registry`]: [`main_with`] is the whole of the `cullbench` program, and of any
//! program that adds a structure.
//!
//! Exit codes: 0 ok; 1 a wrong answer, none at all or a failed verification; 2 usage
//! or bad input; 3 a regression, in `compare`; 130 interrupted.

/// Prints a line made by `format!` on stderr.
macro_rules! tell {
    ($($line:tt)*) => { $crate::cli::tell(&format!($($line)*)) };
}

mod advise;
mod against;
mod args;
mod command_args;
mod compare;
mod compare_table;
mod diagram;
mod document;
mod drift;
mod figure;
mod funnel;
mod funnel_table;
mod interrupt;
mod list;
mod page;
mod plan;
mod precision;
mod processes;
mod program;
mod query;
mod report;
mod run;
mod run_figures;
mod run_plan;
mod run_resume;
mod run_table;
mod run_verdict;
mod run_why;
mod scene;
mod scene_facts;
mod shared_args;
mod sheet;
mod stress;
mod study;
mod surface_tables;
#[cfg(test)]
mod tests_same_truth;
mod text;
mod verify;
mod view;
mod worker;

use std::collections::BTreeMap;
use std::error::Error;
use std::fs;
use std::io::{self, Write};
use std::path::{Path, PathBuf};
use std::process::ExitCode;

use crate::index::Registry;
use crate::input::{InputError, hold_files, tell_notes, tell_warnings};
use crate::report::{folder_of, try_folder, try_place, write_atomically};
use crate::scene::{LoadOptions, NOTICE, Scene, split_part};
use crate::shown::{expected_by, kind_of};
use anyhow::{Context, Result, ensure};
use clap::{CommandFactory, Parser};
use interrupt::Interrupted;
use serde::Serialize;

use args::{Cli, Command};
use command_args::SceneCommand;
use shared_args::TableFormat;

/// Ending of a command that did not fail, with its exit code.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum Ending {
    /// No findings.
    Ok = 0,
    /// A structure answered wrongly.
    WrongAnswer = 1,
    /// Slower than before, or an answer is missing.
    Regression = 3,
    /// Stopped by Ctrl-C.
    Interrupted = 130,
}

impl Ending {
    /// Ending of a completed command; reports it if checks were skipped.
    ///
    /// A wrong answer takes precedence.
    fn of(is_right: bool) -> Ending {
        if interrupt::heard() {
            tell!("interrupted: only the cases shown were checked");
        }
        match (is_right, interrupt::heard()) {
            (false, _) => Ending::WrongAnswer,
            (true, true) => Ending::Interrupted,
            (true, false) => Ending::Ok,
        }
    }
}

/// Runs the program with the structures of a registry; returns its exit code.
///
/// Call it once, from `main`: it reads the process's arguments and handles Ctrl-C.
///
/// ```no_run
/// use cullbench::index::Registry;
///
/// fn main() -> std::process::ExitCode {
///     // Registry::builtin().with::<MyTree>() adds yours.
///     cullbench::cli::main_with(Registry::builtin())
/// }
/// ```
pub fn main_with(registry: Registry) -> ExitCode {
    start(None, registry)
}

/// [`main_with`] under the name and the version of another crate.
///
/// Help texts, reports and the commands in messages use these.
///
/// ```no_run
/// use cullbench::{cli, index::Registry};
///
/// fn main() -> std::process::ExitCode {
///     let program = (env!("CARGO_PKG_NAME"), env!("CARGO_PKG_VERSION"));
///     cli::main_as(program, Registry::builtin())
/// }
/// ```
pub fn main_as(program: (&'static str, &'static str), registry: Registry) -> ExitCode {
    start(Some(program), registry)
}

/// The only argument of a process that measures a share of a run.
const WORKER: &str = "worker";

/// Place of an error without a file.
const OUTPUT: &str = "standard output: ";

fn start(program: Option<(&str, &str)>, registry: Registry) -> ExitCode {
    program::set(program);
    let ended = if std::env::args_os().skip(1).eq([WORKER]) {
        // A terminal sends Ctrl-C to the whole group, and the parent decides about its workers.
        // Without this one ends early: its parent is about to end it.
        drop(ctrlc::set_handler(|| ()));
        worker::worker(&registry)
    } else {
        let cli = match Cli::try_parse() {
            Ok(cli) => cli,
            Err(error) => return refused(&error),
        };
        interrupt::install();
        hold_files(BTreeMap::new());
        tell_notes(tell);
        let checked = cli.command.expect_one_stdin();
        checked.and_then(|()| dispatch(&registry, cli.command))
    };
    match ended {
        Ok(ending) => {
            tell_warnings();
            ExitCode::from(ending as u8)
        }
        Err(error) if error.is::<Interrupted>() => {
            tell!("{Interrupted}");
            ExitCode::from(Ending::Interrupted as u8)
        }
        // A reader that has closed the pipe is no failure.
        Err(error) if error.chain().any(is_broken_pipe) => ExitCode::SUCCESS,
        Err(error) => {
            tell!("error: {}", without_repeats(&error));
            ExitCode::from(if error.is::<query::Panicked>() { 1 } else { 2 })
        }
    }
}

/// Displays the argument parser's error on one line, or the help.
fn refused(error: &clap::Error) -> ExitCode {
    let line = match program::one_line(error) {
        Some(line) => line,
        None => match error.print().and_then(|()| io::stdout().flush()) {
            Ok(()) => return ExitCode::from(u8::from(error.use_stderr()) * 2),
            Err(unread) if is_broken_pipe(&unread) => return ExitCode::SUCCESS,
            Err(full) => format!("{OUTPUT}{full}{}", expected_by(&full, "file")),
        },
    };
    tell!("error: {line}");
    ExitCode::from(2)
}

/// Runs a command.
fn dispatch(registry: &Registry, command: Command) -> Result<Ending> {
    match command {
        Command::List { topic, format } => list::list(registry, topic, format),
        Command::Run(args) => run::run(registry, &args),
        Command::Merge(args) => run::merge(&args),
        Command::Report(args) => report::report(&args),
        Command::Compare(args) => compare::compare(registry, &args),
        Command::Query(args) => query::query(registry, &args),
        Command::Locate(args) => query::locate(registry, &args),
        Command::Verify(args) => verify::verify(registry, &args),
        Command::Precision(args) => {
            let files = [&args.svg, &args.html];
            study::or_left_out(args.format, &files, precision::precision(registry, &args))
        }
        Command::Advise(args) => {
            study::or_left_out(args.format, &[], advise::advise(registry, &args))
        }
        Command::Funnel(args) => {
            let files = [&args.csv, &args.svg, &args.html];
            study::or_left_out(args.format, &files, funnel::funnel(registry, &args))
        }
        Command::Drift(args) => drift::drift(&args),
        Command::Stress(args) => stress::stress(registry, &args),
        Command::Scene(SceneCommand::Info(args)) => scene::info(&args),
        Command::Scene(SceneCommand::Generate(args)) => scene::generate(&args),
        Command::Scene(SceneCommand::Convert(args)) => scene::convert(&args),
        Command::Scene(SceneCommand::Draw(args)) => scene::draw(registry, &args),
        Command::View(args) => view::view(registry, &args),
        Command::Env { format } => list::env(format),
        Command::Completions { shell } => {
            let mut script = Vec::new();
            clap_complete::generate(shell, &mut Cli::command(), program::name(), &mut script);
            print_all(&script)
        }
        Command::Man { folder: None } => {
            let mut command = Cli::command().disable_help_subcommand(true);
            command.build();
            let mut pages = Vec::new();
            manual(&command, &mut pages)?;
            print_all(&pages)
        }
        Command::Man { folder: Some(to) } => {
            expect_folder("man", Some(&to))?;
            let made = fs::create_dir_all(&to);
            let written = made.and_then(|()| clap_mangen::generate_to(Cli::command(), &to));
            written.with_context(|| to.display().to_string())?;
            Ok(Ending::Ok)
        }
        Command::Licences => print_all(NOTICE.as_bytes()),
    }
}

/// Writes the pages of a command and of those below it, one after the other.
fn manual(command: &clap::Command, pages: &mut Vec<u8>) -> io::Result<()> {
    clap_mangen::Man::new(command.clone()).render(pages)?;
    let mut below = command.get_subcommands();
    below.try_for_each(|below| manual(below, pages))
}

/// Prints a text as one line on stderr, wrapped for a terminal.
///
/// Unlike `eprintln!`, does not panic if standard error is closed.
fn tell(line: &str) {
    let size = console::Term::stderr().size_checked();
    let width = size.map_or(usize::MAX, |(_, columns)| usize::from(columns.max(1)));
    let line = text::wrapped(&text::message(line), width);
    let _ = writeln!(io::stderr(), "{line}");
}

/// Loads a scene, with a note on bad items.
fn load_scene(source: &str, options: &LoadOptions) -> Result<Scene> {
    let scene = crate::scene::load(source, options)?;
    if scene.skipped_items > 0 {
        let (bad, name) = (text::counted(scene.skipped_items, "bad item"), &scene.name);
        tell!("note: {bad} left out of {name}; ids are rows of that file");
    }
    Ok(scene)
}

/// Checks that outputs can be written, and that none is an input or another output.
///
/// Called before the work. Inputs may be specs and names, or parts of files.
fn expect_places(outputs: &[(&str, &Option<PathBuf>)], inputs: &[impl AsRef<Path>]) -> Result<()> {
    // The canonical name in the file system, also for a file that does not exist yet.
    let known = |file: &Path| -> Option<PathBuf> {
        let place = folder_of(file).canonicalize().ok()?.join(file.file_name()?);
        Some(place.canonicalize().unwrap_or(place))
    };
    // A run is its measurements and everything made from them except its page.
    let names = ["report.json", "summary.csv", "samples.csv", "stream.jsonl"];
    let files = inputs.iter().flat_map(|input| {
        let input = input.as_ref();
        let source = input.to_str().map(|source| split_part(source).0);
        let input = source.map_or(input, Path::new);
        let is_report = input.ends_with(names[0]);
        let run = if is_report { folder_of(input) } else { input };
        let files = names.map(|name| run.join(name)).into_iter();
        files.chain([input.to_path_buf()])
    });
    let files = files.filter(|file| file.is_file());
    let mut taken: Vec<PathBuf> = files.filter_map(|file| known(&file)).collect();
    for &(option, file) in outputs {
        let Some(file) = file else { continue };
        expect_named(option, file, "file")?;
        let (shown, folder) = (file.display(), folder_of(file));
        ensure!(
            !file.is_dir(),
            "{shown}: a folder; expected a file for {option}"
        );
        ensure!(
            folder.is_dir(),
            "{}: expected an existing folder for {option}",
            folder.display()
        );
        try_place(file)?;
        let Some(place) = known(file) else { continue };
        ensure!(
            !taken.contains(&place),
            "{}: an input or another output; expected a file of its own for {option}",
            place.display()
        );
        taken.push(place);
    }
    Ok(())
}

fn expect_named(option: &str, place: &Path, what: &str) -> Result<()> {
    ensure!(
        place != Path::new("-"),
        "{option} is '-'; expected a {what}, such as './-'"
    );
    Ok(())
}

/// Checks that a folder is writable, or that one of this name can be created.
fn expect_folder(option: &str, folder: Option<&Path>) -> Result<()> {
    let Some(folder) = folder else { return Ok(()) };
    expect_named(option, folder, "folder")?;
    ensure!(
        folder.is_dir() || !folder.exists(),
        "{}: not a folder; expected a folder for {option}",
        folder.display()
    );
    Ok(try_folder(folder)?)
}

/// One JSON document on standard output, indented.
fn print_json(document: &impl Serialize) -> io::Result<()> {
    let mut out = io::stdout().lock();
    writeln!(out, "{}", serde_json::to_string_pretty(document)?)?;
    out.flush()
}

/// Prints the result of a command in its format.
fn print(
    format: TableFormat,
    document: &impl Serialize,
    table: impl FnOnce() -> io::Result<()>,
) -> io::Result<()> {
    unread_is_fine(match format {
        TableFormat::Json => print_json(document),
        TableFormat::Table => table(),
    })
}

/// Writes a text as a file.
fn write_text(file: &Path, text: &str) -> Result<(), InputError> {
    write_atomically(file, |out| out.write_all(text.as_bytes()))
}

/// Writes a text as a file, if a file is named for it.
fn write_if(file: &Option<PathBuf>, text: impl FnOnce() -> String) -> Result<(), InputError> {
    (file.as_ref()).map_or(Ok(()), |file| write_text(file, &text()))
}

/// Ignores a closed pipe when writing output after the work.
///
/// A reader that stops early changes neither the work done nor the exit code.
fn unread_is_fine(written: io::Result<()>) -> io::Result<()> {
    match written {
        Err(error) if is_broken_pipe(&error) => Ok(()),
        other => other,
    }
}

/// The context first, then its causes, except those that the text already contains.
fn without_repeats(error: &anyhow::Error) -> String {
    let mut text = error.to_string();
    for cause in error.chain().map(ToString::to_string) {
        if !text.contains(&cause) {
            text += &format!(": {cause}");
        }
    }
    let mut causes = error.chain();
    match causes.find_map(|cause| cause.downcast_ref::<io::Error>()) {
        Some(error) if !text.contains("expected") => {
            // The context names files.
            let place = ["", OUTPUT][usize::from(text == error.to_string())];
            format!("{place}{text}{}", expected_by(error, "file or folder"))
        }
        _ => text,
    }
}

/// Returns true for an error that is or wraps a broken pipe.
fn is_broken_pipe(error: &(dyn Error + 'static)) -> bool {
    let io = match error.downcast_ref().map(csv::Error::kind) {
        Some(csv::ErrorKind::Io(io)) => Some(io),
        _ => error.downcast_ref(),
    };
    io.is_some_and(|io| kind_of(io) == io::ErrorKind::BrokenPipe)
}

/// Writes a whole text at once: clap's own writers panic on a closed pipe.
fn print_all(text: &[u8]) -> Result<Ending> {
    io::stdout().write_all(text)?;
    Ok(Ending::Ok)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::camera::PLANE_METHODS;
    use crate::culling::{ARITHMETICS, TESTS};

    fn broken() -> io::Error {
        io::ErrorKind::BrokenPipe.into()
    }

    #[test]
    fn a_broken_pipe_is_found_below_any_wrapping() {
        let wrapped = [
            anyhow::Error::from(broken()),
            anyhow::Error::from(csv::Error::from(broken())),
            anyhow::Error::from(io::Error::from(csv::Error::from(broken()))),
        ];
        for error in wrapped {
            let error = Err::<(), _>(error).context("writing").unwrap_err();
            assert!(error.chain().any(is_broken_pipe), "{error:#}");
        }
        let other = io::Error::from(csv::Error::from(io::Error::other("full")));
        assert!(!is_broken_pipe(&other));
    }

    #[test]
    fn no_cause_is_told_twice() {
        let error = Err::<(), _>(io::Error::other("b: is full"))
            .context("b: is full")
            .context("a")
            .unwrap_err();
        let expected = "; expected another file or folder";
        assert_eq!(without_repeats(&error), format!("a: b: is full{expected}"));
    }

    #[test]
    fn the_command_line_is_consistent() {
        Cli::command().debug_assert();
    }

    #[test]
    fn every_choice_of_a_culling_is_in_the_help() {
        let help = Cli::command()
            .find_subcommand_mut("query")
            .map(|c| c.render_long_help().to_string())
            .unwrap_or_default();
        let methods = PLANE_METHODS.iter().map(|row| row.1);
        let tests = TESTS.iter().map(|row| row.1);
        let numbers = ARITHMETICS.iter().map(|row| row.1);
        for name in methods.chain(tests).chain(numbers) {
            assert!(help.contains(name), "{name}");
        }
    }
}
