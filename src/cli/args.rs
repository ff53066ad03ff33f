//! Commands, and options of those that `command_args` lacks.
//!
//! Parsers of options ([`values`]) check single values; the commands check combinations.

use std::path::{Path, PathBuf};

use crate::drift;
use crate::spec::values;
use crate::stress::extremes::DEFAULT_CASES;
use clap::builder::ArgPredicate;
use clap::{ArgGroup, Args, Parser, Subcommand, ValueEnum};

use super::command_args::{CompareArgs, FunnelArgs, SceneCommand, ViewArgs};
use super::shared_args::{
    CullingArgs, KernelArgs, MotionArgs, RowFormat, SceneArgs, SpreadArgs, StudyArgs, TableFormat,
    WhatArgs,
};
use super::{program, text};

/// Benchmarks spatial indexes: frustum culling, region search, checked answers
#[derive(Parser, Debug)]
#[command(name = program::name(), bin_name = program::name(), version = program::version())]
#[command(about, term_width = text::width().min(100), mut_subcommands(taking_negative_numbers))]
#[command(after_help = program::named(include_str!("assets/help/examples.txt")))]
pub struct Cli {
    #[command(subcommand)]
    pub command: Command,
}

/// Lets values begin with a minus, so that parsers of options report the error.
fn taking_negative_numbers(command: clap::Command) -> clap::Command {
    let command = command.mut_subcommands(taking_negative_numbers);
    command.mut_args(|arg| {
        let has_value = arg.get_action().takes_values() && !arg.is_positional();
        arg.allow_negative_numbers(has_value)
    })
}

#[derive(Subcommand, Debug)]
pub enum Command {
    /// List the available structures, scenes, paths, motions, tests and metrics
    List {
        /// Topic to list [default: everything]
        topic: Option<ListTopic>,
        #[arg(long, value_enum, default_value = "table")]
        format: TableFormat,
    },
    /// Measure structures on scenes along camera paths (the main job)
    Run(RunArgs),
    /// Join the shards of a plan (run --shard) into one run
    Merge(MergeArgs),
    /// Show the results of a run: ranked tables, lower bounds, crossovers, growth
    Report(ReportArgs),
    /// Compare a run with an older one: list slower, faster and wrong structures
    Compare(CompareArgs),
    /// Run frustum queries: the visible items per structure and camera
    Query(QueryArgs),
    /// Find the regions that contain points, or the items that overlap boxes
    Locate(LocateArgs),
    /// Cross-check all structures against the reference scan
    Verify(VerifyArgs),
    /// Plot error against time for every test, arithmetic and plane derivation
    Precision(PrecisionArgs),
    /// Measure the visibility funnel: items removed per stage, from regions to
    /// fragments, and the time
    Funnel(FunnelArgs),
    /// Recommend a structure, a test and work to skip for a scene, with the evidence
    Advise(AdviseArgs),
    /// Measure errors of camera updates: turns after millions of steps, spring arms
    /// with 1, 2, 4, 16 and 64 steps per frame
    Drift(DriftArgs),
    /// Replay test vectors and generated extremes, and check their declared outcomes
    Stress(StressArgs),
    /// Write a scene with the verdicts along a path as a page in 3-D
    View(ViewArgs),
    /// Inspect, draw, generate or convert scenes
    #[command(subcommand)]
    Scene(SceneCommand),
    /// Show the machine, toolchain and source as recorded in reports
    Env {
        #[arg(long, value_enum, default_value = "table")]
        format: TableFormat,
    },
    /// Print shell completions
    Completions { shell: clap_complete::Shell },
    /// Print the manual (roff), or write it as a page per command
    Man {
        /// Folder of the pages, such as share/man/man1
        folder: Option<PathBuf>,
    },
    /// Print the licences of the program and of the real scenes inside it
    Licences,
}

impl Command {
    /// Refuses standard input, `-`, for two inputs at once.
    ///
    /// An output takes or refuses `-` itself.
    pub fn expect_one_stdin(&self) -> anyhow::Result<()> {
        let args = std::env::args_os().map(|arg| arg.to_string_lossy().into_owned());
        let words = args.collect::<Vec<_>>().join("\n") + "\n";
        let words = words.replace("=-\n", "\n-\n");
        let words: Vec<&str> = words.lines().collect();
        let outputs = ["-o", "--out", "--svg", "--html", "--csv", "--markdown"];
        let is_input = |pair: &&[&str]| pair[1] == "-" && !outputs.contains(&pair[0]);
        let inputs = words.windows(2).filter(is_input);
        let output = match self {
            Command::Scene(SceneCommand::Convert(args)) => args.output.as_deref(),
            _ => None,
        };
        let count = inputs.count() - usize::from(output == Some(Path::new("-")));
        anyhow::ensure!(count < 2, "'-' {count} times; expected standard input once");
        Ok(())
    }
}

#[derive(Clone, Copy, PartialEq, Eq, ValueEnum, Debug)]
pub enum ListTopic {
    Structures,
    Scenes,
    Paths,
    Tests,
    Metrics,
    Motions,
}

#[derive(Args, Debug)]
#[command(after_help = include_str!("assets/help/run.txt"))]
pub struct RunArgs {
    #[command(flatten)]
    pub what: WhatArgs,
    /// Folder for the page, the report, the samples and the stream [default: a
    /// new one under results/]
    #[arg(long, value_name = "DIR")]
    pub out: Option<PathBuf>,
    /// Continue the run in --out (or the newest unfinished one under results/) with the
    /// options of that run
    #[arg(long)]
    pub resume: bool,
    /// Processes to spread the rounds over; ten or more give intervals [default: the
    /// suite's]
    #[arg(long, value_name = "N", value_parser = values::whole(1..=1000u32))]
    pub processes: Option<u32>,
    /// Show every column and every scene and path, in several tables if need be
    #[arg(long)]
    pub all_columns: bool,
    /// Show a structure beside the best other: what a query tests, and time per test
    #[arg(long, value_name = "STRUCTURE", conflicts_with = "plan")]
    pub why: Option<String>,
    /// Print the cells as JSON lines instead of measuring them
    #[arg(long, conflicts_with_all = ["resume", "out", "all_columns"])]
    pub plan: bool,
    /// Measure share i of n of the plan only; `merge` joins the reports
    #[arg(long, value_name = "i/n")]
    pub shard: Option<String>,
    /// Keep the report as a baseline as well: results/baselines/NAME.json, which
    /// `compare --baseline NAME` reads; one of this name is replaced
    #[arg(long, value_name = "NAME", value_parser = values::baseline, conflicts_with_all = ["plan", "shard"])]
    pub save: Option<String>,
}

#[derive(Args, Debug)]
#[command(after_help = program::named(include_str!("assets/help/merge.txt")))]
pub struct MergeArgs {
    /// Folders of finished shards
    #[arg(value_name = "RUN", required = true)]
    pub runs: Vec<PathBuf>,
    /// A new folder for the page, the report, the samples and the stream
    #[arg(long, value_name = "DIR")]
    pub out: PathBuf,
}

#[derive(Args, Debug)]
pub struct ReportArgs {
    /// report.json of a run, or the folder it is in; several with --history
    #[arg(value_name = "RUN.json", required = true)]
    pub reports: Vec<PathBuf>,
    /// Write one page about all runs: time per query of each structure over the runs
    #[arg(long, value_name = "FILE", conflicts_with_all = ["markdown", "svg", "html", "bencher"])]
    pub history: Option<PathBuf>,
    /// Write Markdown to a file [default: to standard output]
    #[arg(long, value_name = "FILE")]
    pub markdown: Option<PathBuf>,
    /// Write charts into a folder: speed-ups per scene and path, time against items
    #[arg(long, value_name = "DIR")]
    pub svg: Option<PathBuf>,
    /// Show all columns in place of those that fit, as `run` does
    #[arg(long, conflicts_with = "history")]
    pub all_columns: bool,
    /// Write one self-contained page with charts and tables, as `run` does
    #[arg(long, value_name = "FILE")]
    pub html: Option<PathBuf>,
    /// Write the figures in the Bencher Metric Format (JSON)
    #[arg(long, value_name = "FILE")]
    pub bencher: Option<PathBuf>,
}

#[derive(Args, Debug)]
pub struct QueryArgs {
    /// A scene: boxes CSV, glTF, OBJ, Doom or Quake III map, zip, built-in name or spec
    #[arg(long)]
    pub scene: String,
    /// Cameras: a cameras CSV or a path spec
    #[arg(long, visible_alias = "path")]
    pub cameras: String,
    /// Items in motion: a spec (see `list motions`) or a motion CSV
    #[arg(long)]
    pub motion: Option<String>,
    /// Frame of the motion to query, from 1; 0 is the scene as it comes [default: the
    /// last one]
    #[arg(long, value_name = "K", requires = "motion", value_parser = values::whole(0..=u32::MAX))]
    pub frame: Option<u32>,
    /// Structures, e.g. linear,bvh:leaf=4
    #[arg(long, value_name = "LIST", default_value = "all")]
    pub structure: String,
    /// The culling test: sphere, six-plane, six-box or exact
    #[arg(long, default_value = "six-plane")]
    pub test: String,
    /// Print the visible ids as well
    #[arg(long)]
    pub ids: bool,
    #[arg(long, value_enum, default_value = "csv")]
    pub format: RowFormat,
    #[command(flatten)]
    pub culling: CullingArgs,
}

#[derive(Args, Debug)]
#[command(group(ArgGroup::new("sought").required(true)))]
#[command(override_usage = program::named("cullbench locate [OPTIONS] --scene <SCENE> <--points|--boxes> <FILE>"))]
pub struct LocateArgs {
    /// A scene: boxes CSV, glTF, OBJ, Doom or Quake III map, zip, built-in name or spec
    #[arg(long)]
    pub scene: String,
    /// Points CSV (x,y,z), or places: find the regions that contain each point.
    ///
    /// `places` are the camera places of the scene, such as the spawn points of a map
    #[arg(long, value_name = "FILE", group = "sought")]
    pub points: Option<PathBuf>,
    /// Boxes CSV: find the items that overlap each box (closed bounds)
    #[arg(long, value_name = "FILE", group = "sought")]
    pub boxes: Option<PathBuf>,
    /// Structures, e.g. linear,bvh:leaf=4
    #[arg(long, value_name = "LIST", default_value = "all")]
    pub structure: String,
    #[arg(long, value_enum, default_value = "csv")]
    pub format: RowFormat,
    #[command(flatten)]
    pub scene_args: SceneArgs,
    #[command(flatten)]
    pub kernel: KernelArgs,
}

#[derive(Args, Debug)]
pub struct VerifyArgs {
    /// A scene (file or spec; maps.wad#* for all of a file); may be repeated [default:
    /// small ones of every family and the real ones]
    #[arg(long, value_name = "SCENE")]
    pub scene: Vec<String>,
    /// A camera path (spec or cameras CSV); may be repeated [default: several]
    #[arg(long, visible_alias = "cameras", value_name = "PATH")]
    pub path: Vec<String>,
    /// Structures, e.g. linear,bvh:leaf=4
    #[arg(long, value_name = "LIST", default_value = "all")]
    pub structure: String,
    /// Random differential cases [default: 20000, or 0 if scenes or paths are named]
    #[arg(long, value_name = "N", value_parser = values::whole(0..=u64::MAX))]
    pub cases: Option<u64>,
    /// Seed of the first case; case i has seed N + i [default: 1]
    #[arg(long, value_name = "N", value_parser = values::whole(0..=u64::MAX))]
    pub seed: Option<u64>,
    #[arg(long, value_enum, default_value = "table")]
    pub format: TableFormat,
    #[command(flatten)]
    pub culling: CullingArgs,
}

#[derive(Args, Debug)]
pub struct PrecisionArgs {
    #[command(flatten)]
    pub study: StudyArgs,
    /// Number of cameras to use, evenly spread over the path
    #[arg(long, value_name = "N", default_value_t = 16, value_parser = values::whole(1..=u32::MAX))]
    pub frames: u32,
    /// Cubes for each size of the sweep over sizes; 0 skips all sweeps
    #[arg(long, value_name = "N", default_value_t = 2_000_000, value_parser = values::whole(0..=usize::MAX))]
    pub cubes: usize,
    /// Show every table: errors of every culling, the sweeps
    #[arg(long)]
    pub all: bool,
    /// Also write the figures and all tables as one page
    #[arg(long, value_name = "FILE")]
    pub html: Option<PathBuf>,
    /// Also draw false positives against time as an SVG file
    #[arg(long, value_name = "FILE")]
    pub svg: Option<PathBuf>,
    #[arg(long, value_enum, default_value = "table")]
    pub format: TableFormat,
}

#[derive(Args, Debug)]
#[command(after_help = include_str!("assets/help/advise.txt"))]
#[command(mut_arg("structure", |arg| arg.help("Structures to choose from, e.g. linear,bvh:leaf=4")))]
pub struct AdviseArgs {
    #[command(flatten)]
    pub study: StudyArgs,
    #[command(flatten)]
    pub moves: MotionArgs,
    /// Cost of drawing an item that is not visible, ns
    #[arg(long, value_name = "NS", default_value_t = 1000.0, value_parser = values::at_least_zero)]
    pub draw_ns: f64,
    /// Show the evidence too: every structure, test and rule with its times
    #[arg(long)]
    pub all_columns: bool,
    #[arg(long, value_enum, default_value = "table")]
    pub format: TableFormat,
}

#[derive(Args, Debug)]
pub struct DriftArgs {
    /// Number of steps of the camera bases
    #[arg(long, value_name = "N", default_value = "1e6", value_parser = drift::steps)]
    pub steps: u64,
    /// Show every table: what methods do, limits of stability
    #[arg(long)]
    pub all: bool,
    /// Also write the figures and all tables as one page
    #[arg(long, value_name = "FILE")]
    pub html: Option<PathBuf>,
    /// Also draw error against time of the spring arms as an SVG file
    #[arg(long, value_name = "FILE")]
    pub svg: Option<PathBuf>,
    #[command(flatten)]
    pub spread: SpreadArgs,
    #[arg(long, value_enum, default_value = "table")]
    pub format: TableFormat,
}

#[derive(Args, Debug)]
pub struct StressArgs {
    /// A file of test vectors instead of the built-in ones; may be repeated
    #[arg(long, value_name = "FILE")]
    pub vectors: Vec<PathBuf>,
    /// Structures, e.g. linear,bvh:leaf=4
    #[arg(long, value_name = "LIST", default_value = "all")]
    pub structure: String,
    /// Cases of each generated extreme, 0 for none [default: 66: ten million boxes; 0
    /// with --vectors]
    #[arg(long, value_name = "N", value_parser = values::whole(0..=u64::MAX))]
    #[arg(default_value_t = DEFAULT_CASES, hide_default_value = true)]
    #[arg(default_value_if("vectors", ArgPredicate::IsPresent, "0"))]
    pub cases: u64,
    /// Seed of the first case; case i has seed N + i [default: 1]
    #[arg(long, value_name = "N", value_parser = values::whole(0..=u64::MAX))]
    pub seed: Option<u64>,
    #[arg(long, value_enum, default_value = "table")]
    pub format: TableFormat,
    #[command(flatten)]
    pub kernel: KernelArgs,
}
