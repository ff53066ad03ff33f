//! Options of `compare`: the two sides, what decides, and how it is shown.

use std::path::PathBuf;

use clap::{Args, ValueEnum};

use super::shared_args::{TableFormat, WhatArgs};
use super::{program, values};

const COMPARE_HELP: &str = "\
Examples:
  cullbench compare results/before results/after
  cullbench compare old.json new.json --threshold 10% --metric query_ns,build_ms
  cullbench compare old.json new.json --markdown > changes.md
  cullbench run --save main; ..; cullbench run; cullbench compare --baseline main
  cullbench compare --against ./before --gate work     counts only, no times: seconds, no noise

Two reports are compared process by process, each structure relative to the others of its scene
and path; a change of all structures at once is reported as one line. Reports of one process are
inconclusive. compare --against BINARY resolves smaller changes: it runs both programs in turns.
Exit codes: 0 no regression, 1 wrong answer in NEW, 2 wrong usage or bad input, 3 regression: an
answer is lost, or slower (--gate time), or takes more than --threshold more tests of nodes, items
or planes per query (--gate work).";

/// Measure of a regression; an answer that is not given any more is one by each.
#[derive(Clone, Copy, PartialEq, Eq, ValueEnum, Debug)]
pub enum Gate {
    /// A proven change of the time
    Time,
    /// Nodes, items and planes tested per query, which are exact; no times are judged
    Work,
}

#[derive(Args, Debug)]
#[command(after_help = program::named(COMPARE_HELP))]
pub struct CompareArgs {
    /// report.json of the older run, or the folder it is in; with --baseline NEW alone
    #[arg(value_name = "OLD.json", required_unless_present_any = ["against", "baseline"])]
    pub old: Option<PathBuf>,
    /// report.json of the newer run, or the folder it is in [default with --baseline:
    /// the newest run under results/]
    #[arg(value_name = "NEW.json", required_unless_present_any = ["against", "baseline"])]
    pub new: Option<PathBuf>,
    /// OLD is the baseline that `run --save NAME` kept
    #[arg(long, value_name = "NAME", value_parser = values::baseline, conflicts_with_all = ["new", "against"])]
    pub baseline: Option<String>,
    /// Run another build of this program against this one instead: OLD is that binary
    /// (a name without a slash is looked up in PATH), NEW is this
    #[arg(long, value_name = "BINARY", conflicts_with_all = ["old", "new"])]
    pub against: Option<PathBuf>,
    #[command(flatten)]
    pub what: WhatArgs,
    /// Largest relative change that counts as no change, of time or work: 5% or 0.05
    #[arg(
        long,
        value_name = "SHARE",
        default_value = "5%",
        value_parser = values::threshold,
        allow_hyphen_values = true
    )]
    pub threshold: f64,
    /// Metrics to compare: query_ns, locate_ns, locate_batched_ns, build_ms, frame_ns,
    /// update_ns; may be repeated [default: query_ns, and frame_ns of motions]
    #[arg(long, value_name = "LIST", conflicts_with = "against")]
    pub metric: Vec<String>,
    /// Measure of a regression
    #[arg(long, value_enum, default_value = "time")]
    pub gate: Gate,
    /// Exit with 3 where a cell is inconclusive as well
    #[arg(long)]
    pub fail_inconclusive: bool,
    /// Show unchanged cells and every column as well
    #[arg(long)]
    pub all: bool,
    /// Also write the changes and the whole table as one page
    #[arg(long, value_name = "FILE")]
    pub html: Option<PathBuf>,
    #[arg(long, value_enum, default_value = "table")]
    pub format: TableFormat,
    /// Print Markdown, for a pull request: one line, and the rest folded
    #[arg(long, conflicts_with = "format")]
    pub markdown: bool,
}
