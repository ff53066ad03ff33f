//! Options of `cullbench funnel`.

use std::path::PathBuf;

use clap::{Args, ValueEnum};

use super::shared_args::StudyArgs;
use super::values;
use crate::query::ItemId;
use crate::visibility::SampleGrid;
use crate::visibility::fragment::CutOuts;
use crate::visibility::inscribed::MOST_BOXES;
use crate::visibility::occlusion::OccluderChoice;

const FUNNEL_HELP: &str = "\
Columns of the table:
  in, out      items (triangles in the triangle stage) that the stage receives and passes, per view
  truth        of them those that are in front at a sample; of triangles those that face the eye
  FP, FN       false positives (passed, not visible) and false negatives (visible, not passed)
  time         CPU time of the stage per view, with half of its 95 % interval
  per item     time / what the stage removed
The rows of a stage receive what the chain passes; * marks the chain's own, ? a back end that
has no guarantee. NAME is what the column `by` shows; none leaves a stage out. What is true is
decided exactly, along the rays through the samples. Where the occlusion stage walks a tree of its
own (masked-inner, masked), its time holds the object stage's. Orders: pairs of items that overlap in
the image, those drawn in the wrong order, and samples that show a wrong item without a z-test.
A lower bound does what must at least be done and decides nothing. With and without each stage
is counted what is left in the end: items, of the triangle stage triangles, of the fragment stage
shaded fragments; it pays where drawing or shading one of them takes longer than what stands in the
last column. A fragment is an item at a sample, of meshes and maps a triangle at a sample, but that
orders draw whole items. The fragment stage is timed as it is done here, exactly and on one thread.
Items that are cut out hide nothing in the occlusion stage, and at a sample only where their mask is
opaque: z-test takes them for solid, alpha-test asks the mask. stencil-test (rooms) draws what is
beyond the eye's room only on the samples that see its portals. Walls of rooms are never cut out,
picking takes every item for solid.";

#[derive(Args, Debug)]
#[command(after_help = FUNNEL_HELP)]
#[command(mut_arg("path", |arg| arg.default_value("street:frames=32")))]
#[command(mut_arg("structure", |arg| arg
    .default_value("wide,bvh,linear")
    .help("Structures for the object stage; the first is the chain's")))]
pub struct FunnelArgs {
    #[command(flatten)]
    pub study: StudyArgs,
    /// Cameras of the path to look at, evenly spread
    #[arg(long, value_name = "N", default_value_t = 32, value_parser = values::whole(1..=u32::MAX))]
    pub frames: u32,
    /// Columns and rows of samples
    #[arg(long, value_name = "WxH", default_value = "320x180", value_parser = values::samples)]
    pub samples: SampleGrid,
    /// Cut holes into a share of the items: fence or foliage, e.g.
    /// fence:share=0.2,tile=1,seed=1
    #[arg(long, value_name = "MASK", value_parser = CutOuts::parse)]
    pub cut_out: Option<CutOuts>,
    /// Take a face of this item for a mirror (across its shortest edge): what is seen
    /// in it, with and without a stencil of its samples
    #[arg(long, value_name = "ITEM", value_parser = values::whole(0..=ItemId::MAX))]
    pub mirror: Option<ItemId>,
    /// Back end of the region stage [default: the best that the scene has regions for]
    #[arg(long, value_name = "NAME")]
    pub region: Option<String>,
    /// Back end of the occlusion stage
    #[arg(long, value_name = "NAME")]
    pub occlusion: Option<String>,
    /// Occluders that hierarchical-z draws: all, nearest:64, largest:64
    #[arg(long, value_name = "CHOICE", default_value = "all", value_parser = values::occluders)]
    pub occluders: OccluderChoice,
    /// Most boxes that are looked for inside each closed item of a mesh, and drawn for
    /// it [default: 8]
    #[arg(long, value_name = "N", value_parser = values::whole(1..=MOST_BOXES as u32))]
    pub inner_boxes: Option<u32>,
    /// Back end of the triangle stage
    #[arg(long, value_name = "NAME")]
    pub triangle: Option<String>,
    /// Back end of the fragment stage
    #[arg(long, value_name = "NAME")]
    pub fragment: Option<String>,
    /// A claim of what is seen from each region, for the row stored-pvs: {"regions": N,
    /// "sees": [[0, 1], ..]}
    #[arg(long, value_name = "FILE")]
    pub pvs: Option<PathBuf>,
    /// Write tables and picture as one HTML page too
    #[arg(long, value_name = "FILE")]
    pub html: Option<PathBuf>,
    /// Draw the first view from above, each item by the stage that removed it
    #[arg(long, value_name = "FILE")]
    pub svg: Option<PathBuf>,
    #[arg(long, value_enum, default_value = "table")]
    pub format: FunnelFormat,
}

#[derive(Clone, Copy, PartialEq, Eq, ValueEnum, Debug)]
pub enum FunnelFormat {
    Table,
    Csv,
    Json,
}
