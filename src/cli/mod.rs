//! The command line: from what was typed to a validated plan to one file per
//! command. It owns exit codes, progress and tables, and no arithmetic.
//!
//! Exit codes: 0 ok; 1 a wrong answer or a failed verification; 2 usage or bad
//! input; 130 interrupted.

mod args;
mod compare_structures;
mod env;
mod interrupt;
mod list;
mod locate;
mod query;
mod run;
mod scene;
mod text;
mod verify;

use std::io;
use std::process::ExitCode;

use clap::{CommandFactory, Parser};

use args::{Cli, Command, SceneCommand};

/// How a command ended that did not fail.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum Ending {
    Ok,
    /// A structure answered wrongly: exit code 1.
    WrongAnswer,
    /// Stopped by Ctrl-C: exit code 130.
    Interrupted,
}

pub fn main() -> ExitCode {
    let cli = Cli::parse();
    interrupt::install();
    let ended = match cli.command {
        Command::List(args) => list::list(&args),
        Command::Run(args) => run::run(&args),
        Command::Query(args) => query::query(&args),
        Command::Locate(args) => locate::locate(&args),
        Command::Verify(args) => verify::verify(&args),
        Command::Scene(SceneCommand::Info(args)) => scene::info(&args),
        Command::Scene(SceneCommand::Generate(args)) => scene::generate(&args),
        Command::Env(args) => env::env(&args),
        Command::Completions { shell } => {
            clap_complete::generate(shell, &mut Cli::command(), "cullbench", &mut io::stdout());
            Ok(Ending::Ok)
        }
        Command::Man => man(),
    };
    match ended {
        Ok(Ending::Ok) => ExitCode::SUCCESS,
        Ok(Ending::WrongAnswer) => ExitCode::from(1),
        Ok(Ending::Interrupted) => ExitCode::from(130),
        // Nobody reads on: not our failure.
        Err(error) if is_broken_pipe(&error) => ExitCode::SUCCESS,
        Err(error) => {
            // One line: the context first, then its causes.
            eprintln!("error: {error:#}");
            ExitCode::from(2)
        }
    }
}

fn is_broken_pipe(error: &anyhow::Error) -> bool {
    error.chain().any(|cause| {
        let io = cause.downcast_ref::<io::Error>();
        io.is_some_and(|e| e.kind() == io::ErrorKind::BrokenPipe)
    })
}

fn man() -> anyhow::Result<Ending> {
    let mut page = Vec::new();
    clap_mangen::Man::new(Cli::command()).render(&mut page)?;
    io::Write::write_all(&mut io::stdout(), &page)?;
    Ok(Ending::Ok)
}
