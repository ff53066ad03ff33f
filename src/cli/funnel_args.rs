//! Options of `cullbench funnel`.

use std::path::PathBuf;

use clap::Args;

use super::shared_args::{StudyArgs, TableFormat};
use super::values;
use crate::query::ItemId;
use crate::visibility::SampleGrid;
use crate::visibility::fragment::CutOuts;
use crate::visibility::inscribed::MOST_BOXES;

const FUNNEL_HELP: &str = "\
The chain has a back end for each stage; the table says what each is worth:
  in, out        items (triangles in the triangle stage) that the stage
                 receives and passes, per view
  time           CPU time of the stage per view, with half of its 95 % interval
  worth it from  cost of drawing one item (a triangle, shading a fragment) above
                 which the stage pays off: its time / what it removes in the end

With --all every other back end of each stage stands beside it:
  truth        received items in front at some sample; received triangles that
               face the eye
  FP, FN       false positives (passed, not visible) and false negatives
               (visible, not passed)
  per item     time / number of removed items
All back ends of a stage receive the output of the chain's previous stage. *
marks a back end of the chain, ? one without a guarantee. NAME is a value of the
column `by`; none leaves a stage out. The truth is exact, along the rays through
the samples. If the occlusion stage traverses its own tree (masked-inner,
masked), its time includes the object stage.

Orders: pairs of items that overlap in the image, pairs drawn in the wrong
order, and samples that show a wrong item without a z-test. Lower bounds do only
what any program must at least do; they decide nothing.

With and without a stage: the items, triangles (triangle stage) or shaded
fragments (fragment stage) that remain in the end. The stage pays off if drawing
or shading one of them takes longer than the last column. A fragment is an item
at a sample, in meshes and maps a triangle at a sample; orders draw whole items.
The time of the fragment stage is that of an exact test on one thread.

Items with cut-outs hide nothing in the occlusion stage, and at a sample only
where their mask is opaque: z-test treats them as solid, alpha-test tests the
mask. stencil-test (rooms) draws items beyond the eye's room only at the samples
that see its portals. Walls of rooms have no cut-outs; picking treats every item
as solid.";

#[derive(Args, Debug)]
#[command(after_help = FUNNEL_HELP)]
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
    #[arg(long, value_name = "WxH", default_value = "320x180", value_parser = values::samples)]
    pub samples: SampleGrid,
    /// Cut holes into a share of the items: fence or foliage, e.g.
    /// fence:share=0.2,tile=1,seed=1
    #[arg(long, value_name = "MASK", value_parser = CutOuts::parse)]
    pub cut_out: Option<CutOuts>,
    /// Treat a face of this item (across its shortest edge) as a mirror, and draw its
    /// reflection with and without a stencil
    #[arg(long, value_name = "ITEM", value_parser = values::whole(0..=ItemId::MAX))]
    pub mirror: Option<ItemId>,
    /// Back end of the region stage [default: the best for the regions of the scene]
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
    /// A potentially visible set for the back end stored-pvs: {"regions": N, "sees":
    /// [[0, 1], ..]}
    #[arg(long, value_name = "FILE")]
    pub pvs: Option<PathBuf>,
    /// Compare every back end of every stage, depth orders, picking and lower bounds
    /// too, as --format json, --csv and --html do
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
    /// Draw the first view from above, items coloured by the stage that removed them
    #[arg(long, value_name = "FILE")]
    pub svg: Option<PathBuf>,
    #[arg(long, value_enum, default_value = "table")]
    pub format: TableFormat,
}
