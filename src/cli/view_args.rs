//! Options of `cullbench view`.

use std::path::PathBuf;

use clap::Args;

use super::shared_args::{CullingArgs, KernelArgs, LensArgs, SceneArgs};
use super::values;
use crate::suite::DEFAULT_PATH;
use crate::visibility::SampleGrid;

const VIEW_HELP: &str = "\
Example:
  cullbench view --scene city:n=20000 --path street:frames=120 -o city.html

The page needs WebGL2 and no network. It shows every item as a box in the colour
of its verdict, which the exact oracle gives: visible, false positive (returned,
but not visible), lost (visible, but not returned) or culled. With --samples,
returned items that are in front at no sample are hidden. Boxes are rounded for
drawing only; the sets of a view are those of `query --ids`.";

#[derive(Args, Debug)]
#[command(after_help = VIEW_HELP)]
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
    #[arg(long, value_name = "WxH", value_parser = values::samples)]
    pub samples: Option<SampleGrid>,
    #[command(flatten)]
    pub scene_args: SceneArgs,
    #[command(flatten)]
    pub lens: LensArgs,
    #[command(flatten)]
    pub culling: CullingArgs,
    #[command(flatten)]
    pub kernel: KernelArgs,
}
