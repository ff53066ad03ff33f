//! The `cullbench` program.
//!
//! The command line of the library over the structures of this build.

use std::process::ExitCode;

use cullbench::cli;
use cullbench::index::Registry;

fn main() -> ExitCode {
    let program = (env!("CARGO_PKG_NAME"), env!("CARGO_PKG_VERSION"));
    cli::main_as(program, Registry::builtin())
}
