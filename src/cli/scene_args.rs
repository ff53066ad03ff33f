//! Options of `cullbench scene`.

use std::path::PathBuf;

use clap::{Args, Subcommand, ValueEnum};

use super::shared_args::{LensArgs, SceneArgs, TableFormat};
use super::{program, values};

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
    #[arg(value_name = "SCENE")]
    pub scene: String,
    /// Cameras to show as used: a path, or a cameras CSV
    #[arg(long, visible_alias = "cameras", value_name = "PATH")]
    pub path: Option<String>,
    #[arg(long, value_enum, default_value = "table")]
    pub format: TableFormat,
    #[command(flatten)]
    pub scene_args: SceneArgs,
    #[command(flatten)]
    pub lens: LensArgs,
}

#[derive(Args, Debug)]
pub struct SceneGenerateArgs {
    /// A spec such as city:n=100000,seed=7, or any other scene
    #[arg(value_name = "SCENE")]
    pub scene: String,
    /// The file to write [default: standard output]
    #[arg(long, short, value_name = "FILE")]
    pub out: Option<PathBuf>,
    #[command(flatten)]
    pub scene_args: SceneArgs,
}

/// Formats of a written scene.
#[derive(Clone, Copy, PartialEq, Eq, ValueEnum, Debug)]
pub enum SceneFormat {
    Csv,
}

const CONVERT_HELP: &str = "\
Examples:
  cullbench scene convert maps.wad#MAP07 --out map07.csv
  cullbench scene convert helsinki city.csv
  cullbench scene convert city:n=1000 | head

Boxes CSV has world coordinates and all labels, in the order of ids. Bounds are
written in f64 as they were read, not rounded to f32: queries on the file have
the same answers, and converting it again writes the same bytes. Regions, camera
places and the tree of a map are not written.";

#[derive(Args, Debug)]
#[command(after_help = program::named(CONVERT_HELP))]
pub struct SceneConvertArgs {
    /// A scene: boxes CSV, glTF, OBJ, Doom or Quake III map, zip, built-in name or spec
    #[arg(value_name = "INPUT")]
    pub scene: String,
    /// The file to write [default: standard output]
    #[arg(value_name = "OUTPUT")]
    pub output: Option<PathBuf>,
    /// The file to write, in place of OUTPUT
    #[arg(long, short, value_name = "FILE", conflicts_with = "output")]
    pub out: Option<PathBuf>,
    /// The format [default: by the extension]
    #[arg(long, value_enum)]
    pub to: Option<SceneFormat>,
    #[command(flatten)]
    pub scene_args: SceneArgs,
}

const DRAW_HELP: &str = "\
Examples:
  cullbench scene draw freedm-map12 --structure bsp-textbook --depth 3 -o bsp.svg
  cullbench scene draw city:n=1000 --structure quadtree-textbook --camera street -o tree.svg
  cullbench scene draw helsinki --camera orbit:frames=8 --frame 3 -o view.svg

Cells that a query rejects are filled, those that it opens have a blue outline.
Items that lie around others are outlined. Cells of a structure are what its
queries test: children in blocks of sixteen, but for the textbook forms.";

#[derive(Args, Debug)]
#[command(after_help = program::named(DRAW_HELP))]
pub struct SceneDrawArgs {
    /// A scene: boxes CSV, glTF, OBJ, Doom or Quake III map, zip, built-in name or spec
    #[arg(value_name = "SCENE")]
    pub scene: String,
    /// A structure whose cells are drawn, e.g. quadtree-textbook:leaf=4
    #[arg(long, value_name = "STRUCTURE")]
    pub structure: Option<String>,
    /// A camera path (spec or cameras CSV); one of its cameras is drawn with its query
    #[arg(long, value_name = "PATH")]
    pub camera: Option<String>,
    /// The camera of the path, counted from 0
    #[arg(long, value_name = "N", default_value_t = 0, requires = "camera")]
    pub frame: usize,
    /// Deepest level of cells that is drawn; 0 is the root
    #[arg(long, value_name = "LEVEL", default_value_t = 3, value_parser = values::whole(0..=1000u32))]
    pub depth: u32,
    /// The SVG file to write
    #[arg(long, short, value_name = "FILE")]
    pub out: PathBuf,
    #[command(flatten)]
    pub scene_args: SceneArgs,
    #[command(flatten)]
    pub lens: LensArgs,
}
