//! Standard input on the command line: `-` stands for one input only.

use std::env;
use std::path::Path;

use super::args::Command;
use super::command_args::SceneCommand;

/// Refuses standard input for two inputs at once.
///
/// An output takes or refuses `-` itself.
pub fn one_stdin(command: &Command) -> anyhow::Result<()> {
    let args = env::args_os().map(|arg| arg.to_string_lossy().into_owned());
    let words = args.collect::<Vec<_>>().join("\n") + "\n";
    let words = words.replace("=-\n", "\n-\n");
    let words: Vec<&str> = words.lines().collect();
    let outputs = ["-o", "--out", "--svg", "--html", "--csv", "--markdown"];
    let is_input = |pair: &&[&str]| pair[1] == "-" && !outputs.contains(&pair[0]);
    let inputs = words.windows(2).filter(is_input);
    let output = match command {
        Command::Scene(SceneCommand::Convert(args)) => args.output.as_deref(),
        _ => None,
    };
    let count = inputs.count() - usize::from(output == Some(Path::new("-")));
    anyhow::ensure!(count < 2, "'-' {count} times; expected standard input once");
    Ok(())
}
