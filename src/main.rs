//! The `cullbench` program: the command line of the library over the
//! structures of this build.

use std::process::ExitCode;

use cullbench::cli;
use cullbench::index::Registry;

fn main() -> ExitCode {
    cli::main_with(Registry::builtin())
}
