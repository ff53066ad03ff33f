//! Options of `view`, `funnel`, `scene` and `compare`.

use std::path::PathBuf;

use clap::{Args, Subcommand, ValueEnum};
use serde::Serialize;

use super::program;
use super::shared_args::{CullingArgs, LensArgs, SceneArgs, StudyArgs, TableFormat, WhatArgs};
use crate::path::DEFAULT_PATH;
use crate::report::JUDGED_METRICS;
use crate::spec::{SpecError, values};
use crate::visibility::SampleGrid;
use crate::visibility::fragment::CutOuts;
use crate::visibility::inner_boxes::MOST_BOXES;

#[derive(Args, Debug)]
#[command(after_help = program::named(include_str!("assets/help/view.txt")))]
pub struct ViewArgs {
    /// A scene: boxes CSV, glTF, OBJ, Doom or Quake III map, zip, built-in name or spec
    #[arg(long)]
    pub scene: String,
    /// A camera path: a spec or a cameras CSV
    #[arg(long, visible_alias = "cameras", value_name = "PATH", default_value = DEFAULT_PATH)]
    pub path: String,
    /// The page to write
    #[arg(long, short, value_name = "FILE.html")]
    pub out: PathBuf,
    /// Number of cameras to use, evenly spread over the path
    #[arg(long, value_name = "N", default_value_t = 256, value_parser = values::whole(1..=10_000usize))]
    pub frames: usize,
    /// Structures to count the tested nodes of, e.g. linear,bvh:leaf=4
    #[arg(long, value_name = "LIST", default_value = "default")]
    pub structure: String,
    /// The culling test: sphere, six-plane, six-box or exact
    #[arg(long, default_value = "six-plane")]
    pub test: String,
    /// Columns and rows of samples that find hidden items, e.g. 320x180 [default: none]
    #[arg(long, value_name = "WxH", value_parser = samples)]
    pub samples: Option<SampleGrid>,
    #[command(flatten)]
    pub culling: CullingArgs,
}

/// Columns and rows of an image, `320x180`.
fn samples(text: &str) -> Result<SampleGrid, SpecError> {
    const MOST: u32 = 16_384;
    let side = |text: &str| text.trim().parse().ok().filter(|n| (1..=MOST).contains(n));
    let sides = text.split_once(['x', 'X']);
    let grid = sides.and_then(|(width, height)| Some(SampleGrid::new(side(width)?, side(height)?)));
    let what = format_args!("columns x rows such as 320x180, each from 1 to {MOST}");
    values::expected(grid, what)
}

#[derive(Args, Debug)]
#[command(after_help = include_str!("assets/help/funnel.txt"))]
#[command(mut_arg("path", |arg| arg.default_value("street:frames=32")))]
#[command(mut_arg("structure", |arg| arg
    .default_value("wide,bvh,linear")
    .help("Structures for the object stage; the chain uses the first")))]
pub struct FunnelArgs {
    #[command(flatten)]
    pub study: StudyArgs,
    /// Number of cameras to use, evenly spread over the path
    #[arg(long, value_name = "N", default_value_t = 8, value_parser = values::whole(1..=u32::MAX))]
    pub frames: u32,
    /// Columns and rows of samples
    #[arg(long, value_name = "WxH", default_value = "320x180", value_parser = samples)]
    pub samples: SampleGrid,
    /// Cut holes into a share of the items: fence or foliage, e.g.
    /// fence:share=0.2,tile=1,seed=1
    #[arg(long, value_name = "MASK", value_parser = CutOuts::parse)]
    pub cut_out: Option<CutOuts>,
    /// Back end of the region stage [default: the safe one that removes the most]
    #[arg(long, value_name = "NAME")]
    pub region: Option<String>,
    /// Back end of the occlusion stage
    #[arg(long, value_name = "NAME")]
    pub occlusion: Option<String>,
    /// Maximum number of boxes inscribed in each closed item of a mesh, drawn as its
    /// occluders [default: 8]
    #[arg(long, value_name = "N", value_parser = values::whole(1..=MOST_BOXES as u32))]
    pub inner_boxes: Option<u32>,
    /// Back end of the triangle stage
    #[arg(long, value_name = "NAME")]
    pub triangle: Option<String>,
    /// Back end of the fragment stage
    #[arg(long, value_name = "NAME")]
    pub fragment: Option<String>,
    /// Compare every back end of every stage, picking too, as --format json, --csv and
    /// --html do
    #[arg(long)]
    pub all: bool,
    /// Leave picking out of what --all, --format, --csv and --html add
    #[arg(long)]
    pub no_picks: bool,
    /// Also write tables and picture as one HTML page
    #[arg(long, value_name = "FILE")]
    pub html: Option<PathBuf>,
    /// Also write each table as a CSV file (stages.csv, gains.csv, ..) to a folder
    #[arg(long, value_name = "FOLDER")]
    pub csv: Option<PathBuf>,
    /// Draw the view that sees most from above, items by the stage that removed them
    #[arg(long, value_name = "FILE")]
    pub svg: Option<PathBuf>,
    #[arg(long, value_enum, default_value = "table")]
    pub format: TableFormat,
}

#[derive(Subcommand, Debug)]
pub enum SceneCommand {
    /// Show the contents of a scene
    Info(SceneInfoArgs),
    /// Write a scene as boxes CSV
    Generate(SceneGenerateArgs),
    /// Write any scene to a file that every command reads
    Convert(SceneConvertArgs),
    /// Draw a scene from above, with cells of a structure and verdicts of a query
    Draw(SceneDrawArgs),
}

#[derive(Args, Debug)]
pub struct SceneInfoArgs {
    /// A scene: boxes CSV, glTF, OBJ, Doom or Quake III map, zip, built-in name or spec
    pub scene: String,
    /// Cameras to show as used: a path, or a cameras CSV
    #[arg(long, visible_alias = "cameras", value_name = "PATH")]
    pub path: Option<String>,
    #[arg(long, value_enum, default_value = "table")]
    pub format: TableFormat,
    #[command(flatten)]
    pub lens: LensArgs,
}

#[derive(Args, Debug)]
pub struct SceneGenerateArgs {
    /// A spec such as city:n=100000,seed=7, or any other scene
    pub scene: String,
    /// The file to write [default: standard output]
    #[arg(long, short, value_name = "FILE")]
    pub out: Option<PathBuf>,
    #[command(flatten)]
    pub scene_args: SceneArgs,
}

#[derive(Args, Debug)]
#[command(after_help = program::named(include_str!("assets/help/convert.txt")))]
pub struct SceneConvertArgs {
    /// A scene: boxes CSV, glTF, OBJ, Doom or Quake III map, zip, built-in name or spec
    #[arg(value_name = "INPUT")]
    pub scene: String,
    /// The file to write [default: standard output]
    pub output: Option<PathBuf>,
    /// The file to write, in place of OUTPUT
    #[arg(long, short, value_name = "FILE", conflicts_with = "output")]
    pub out: Option<PathBuf>,
    /// The format [default: by the extension]
    #[arg(long, value_parser = ["csv"])]
    pub to: Option<String>,
    #[command(flatten)]
    pub scene_args: SceneArgs,
}

#[derive(Args, Debug)]
#[command(after_help = program::named(include_str!("assets/help/draw.txt")))]
#[command(mut_args(|arg| match arg.get_id().as_str() {
    "frame" | "fovy" | "aspect" | "near" | "far" | "matrix_convention" => arg.requires("camera"),
    _ => arg,
}))]
pub struct SceneDrawArgs {
    /// A scene: boxes CSV, glTF, OBJ, Doom or Quake III map, zip, built-in name or spec
    pub scene: String,
    /// A structure whose cells are drawn, e.g. quadtree-textbook:leaf=4
    #[arg(long, value_name = "STRUCTURE")]
    pub structure: Option<String>,
    /// A camera path (spec or cameras CSV); one of its cameras is drawn with its query
    #[arg(long, value_name = "PATH", visible_aliases = ["path", "cameras"])]
    pub camera: Option<String>,
    /// The camera of the path, counted from 0
    #[arg(long, value_name = "N", default_value_t = 0, value_parser = values::whole(0..=u32::MAX))]
    pub frame: u32,
    /// Deepest level of cells that is drawn; 0 is the root
    #[arg(long, value_name = "LEVEL", default_value_t = 3, requires = "structure", value_parser = values::whole(0..=1000u32))]
    pub depth: u32,
    /// The SVG file to write
    #[arg(long, short, value_name = "FILE")]
    pub out: PathBuf,
    #[command(flatten)]
    pub lens: LensArgs,
}

/// A metric that runs are compared by.
fn metric(name: &str) -> Result<&'static str, SpecError> {
    let known = JUDGED_METRICS.iter().copied();
    let metric = known.clone().find(|metric| *metric == name.trim());
    metric.ok_or_else(|| SpecError::unknown("metric", name, known))
}

/// Measure of a regression; an answer that is not given any more is one by each.
#[derive(Clone, Copy, PartialEq, Eq, ValueEnum, Debug, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Gate {
    /// A proven change of the time
    Time,
    /// Nodes, items and planes tested per query, which are exact; no times are judged
    Work,
}

#[derive(Args, Debug)]
#[command(after_help = program::named(include_str!("assets/help/compare.txt")))]
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
    /// Change that "same" rules out, and growth of work that is allowed: 5% or 0.05;
    /// a time is slower or faster from 1 % on (5 % in stored runs)
    #[arg(long, value_name = "SHARE", default_value = "5%", value_parser = values::threshold)]
    #[arg(allow_hyphen_values = true)]
    pub threshold: f64,
    /// Metrics to compare: query_ns, locate_ns, locate_batched_ns, build_ms, frame_ns,
    /// update_ns; may be repeated [default: query_ns, and frame_ns of motions]
    #[arg(long, value_name = "LIST", value_delimiter = ',', value_parser = metric)]
    #[arg(conflicts_with = "against")]
    pub metric: Vec<&'static str>,
    /// Measure of a regression
    #[arg(long, value_enum, default_value = "time")]
    pub gate: Gate,
    /// Exit with 3 also if a cell is inconclusive or different, or if all changed
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
