//! The `cullbench` program. Everything is in `cli`; the library never depends
//! on it.

mod cli;

use std::process::ExitCode;

fn main() -> ExitCode {
    cli::main()
}
