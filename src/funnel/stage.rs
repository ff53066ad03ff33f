//! Stages of the funnel in order, their back ends, and chains of these.

use serde::{Deserialize, Serialize};

use super::error::LeftOutRow;
use crate::index::StructureSpec;
use crate::kernel::Kernel;
use crate::query::ItemId;
use crate::scene::{Regions, Scene};
use crate::shown::{count, counted};
use crate::visibility::occlusion::{
    Interleaved, MaskedCentre, MaskedInner, OccluderTree, OcclusionBuffer, View,
};
use crate::visibility::triangle::TRIANGLE_ROWS;
use crate::visibility::{Guarantee, Row, SampleGrid, region};

named! {
    /// A stage that receives candidates and returns fewer of them.
    #[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, Default)]
    #[derive(Debug, Serialize, Deserialize)]
    #[serde(rename_all = "snake_case")]
    pub enum StageKind {
        /// Rooms that may be visible, and so their items.
        #[default]
        Region = "region",
        /// Items that the frustum meets.
        Object = "object",
        /// Items that are not hidden behind others.
        Occlusion = "occlusion",
        /// Triangles of the remaining items that face the eye.
        Triangle = "triangle",
        /// Items that are in front at a sample.
        Fragment = "fragment",
    }
}

impl StageKind {
    /// Stages that return whole items; their result is drawn.
    pub const OF_ITEMS: [StageKind; 3] =
        [StageKind::Region, StageKind::Object, StageKind::Occlusion];

    /// Unit of the counts after the stage.
    pub fn unit(self) -> &'static str {
        match self {
            StageKind::Triangle => "triangles",
            _ => "items",
        }
    }
}

/// Name of each stage's row that removes nothing.
pub const NONE: &str = "none";

/// A back end of a stage.
#[derive(Clone, Copy, PartialEq, Default, Debug, Serialize)]
pub struct BackEnd {
    /// Stage that it implements.
    pub stage: StageKind,
    /// Name on the command line.
    pub name: &'static str,
    /// One-line description.
    pub summary: &'static str,
    /// Declared guarantee of its answers.
    pub guarantee: Guarantee,
    /// `true` if it includes the object stage, in one traversal.
    pub does_object_stage: bool,
}

impl BackEnd {
    /// Creates a back end; in the occlusion stage, one with a tree of its own.
    pub fn new(
        stage: StageKind,
        [name, summary]: [&'static str; 2],
        guarantee: Guarantee,
    ) -> BackEnd {
        BackEnd {
            stage,
            name,
            summary,
            guarantee,
            does_object_stage: stage == StageKind::Occlusion && name != NONE,
        }
    }

    /// Back ends for the rows of the stage's table that a scene has.
    fn of<B>(stage: StageKind, rows: &[Row<B>], has: impl Fn(&B) -> bool) -> Vec<BackEnd> {
        let known = rows.iter().filter(|row| has(&row.build));
        let known = known.map(|row| BackEnd::new(stage, [row.name, row.summary], row.guarantee));
        known.collect()
    }
}

/// A stage of whole items and the name of its back end.
pub type Step = (StageKind, String);

/// Choice of a back end for each stage, by name.
#[derive(Clone, PartialEq, Eq, Hash, Debug, Serialize, Deserialize)]
pub struct Chain {
    names: [String; StageKind::ALL.len()],
}

impl Chain {
    /// Chain that leaves out every stage.
    pub fn empty() -> Chain {
        Chain {
            names: StageKind::ALL.map(|_| NONE.to_owned()),
        }
    }

    /// Default chain of a scene, with the first structure for the object stage.
    ///
    /// Each other stage has its safe back end that removes the most.
    pub fn for_scene(scene: &Scene, structures: &[StructureSpec], has_cut_outs: bool) -> Chain {
        let object = structures.first().map_or(NONE, |spec| &spec.label);
        let chain = Chain::empty().with(StageKind::Object, object);
        let wanted = [
            (StageKind::Region, PORTAL_RECT),
            (StageKind::Occlusion, MASKED_INNER),
            (StageKind::Triangle, "per-triangle"),
            (StageKind::Fragment, default_test(has_cut_outs)),
        ];
        let is_there = |(stage, name): &(StageKind, &str)| {
            let mut rows = back_ends(*stage, scene, has_cut_outs).into_iter();
            rows.any(|row| row.name == *name)
        };
        let known = wanted.into_iter().filter(is_there);
        known.fold(chain, |chain, (stage, name)| chain.with(stage, name))
    }

    /// Name of a stage's back end.
    pub fn of(&self, stage: StageKind) -> &str {
        &self.names[stage as usize]
    }

    /// Replaces the back end of one stage.
    pub fn with(mut self, stage: StageKind, name: &str) -> Chain {
        name.clone_into(&mut self.names[stage as usize]);
        self
    }

    /// Stages of whole items before `end` that the chain does not leave out.
    pub fn steps_before(&self, end: StageKind) -> Vec<Step> {
        let stages = StageKind::OF_ITEMS.into_iter().filter(|stage| *stage < end);
        let steps = stages.map(|stage| (stage, self.of(stage).to_owned()));
        steps.filter(|(_, name)| name != NONE).collect()
    }

    /// Stages of whole items up to `stage`, which uses the back end `name`.
    pub fn steps_with(&self, stage: StageKind, name: &str) -> Vec<Step> {
        let mut steps = self.steps_before(stage);
        if name != NONE {
            steps.push((stage, name.to_owned()));
        }
        steps
    }

    /// Returns `true` if a stage is timed by itself.
    ///
    /// False for the object stage if the occlusion stage includes it.
    pub fn is_separate(&self, stage: StageKind) -> bool {
        stage != StageKind::Object || self.of(StageKind::Occlusion) == NONE
    }

    /// All stages of whole items that the chain does not leave out.
    pub fn steps(&self) -> Vec<Step> {
        self.steps_before(StageKind::Triangle)
    }
}

/// Portal search of the region stage.
pub const PORTAL_RECT: &str = "portal-rect";
const MASKED_INNER: &str = "masked-inner";
/// Depth test that treats every item as solid.
pub const Z: &str = "z-test";
const ALPHA: &str = "alpha-test";
/// Depth test restricted to the samples of portals.
pub const STENCIL: &str = "stencil-test";
/// Tests that not every scene has, with their requirements.
pub const NEEDS: [[&str; 2]; 2] = [
    [ALPHA, "--cut-out as well"],
    [STENCIL, "a scene of rooms with portals"],
];

/// Region stage, table or back end that a map cannot have, with the reason.
///
/// The whole stage if the sectors do not divide the plane; else the REJECT table if it is too
/// short, or the visibility table if the map has none.
pub fn left_out_of(scene: &Scene) -> Option<LeftOutRow> {
    let map = match &scene.regions {
        Regions::Bsp(map) => map,
        Regions::Leaves(map) if map.sees().is_none() => {
            let reason = "the map has no table of which cluster sees which";
            return Some(LeftOutRow::new("stages", "stored-pvs", reason));
        }
        _ => return None,
    };
    if let Some(dispute) = map.disputes().first() {
        return Some(LeftOutRow::new("stages", "region", dispute));
    }
    let (bytes, sectors) = (map.reject.len(), map.sectors.len());
    let least = sectors.saturating_mul(sectors).div_ceil(8);
    let (found, of) = (counted(bytes, "byte"), counted(sectors, "sector"));
    let reason = format!("REJECT of {found} for {of}, expected {}", count(least));
    // Map builders leave it empty.
    let is_short = (1..least).contains(&bytes);
    is_short.then(|| LeftOutRow::new("stages", "reject", reason))
}

/// Back ends that a scene can have in a stage, without structures.
///
/// `has_cut_outs` is true if some items have holes.
pub fn back_ends(stage: StageKind, scene: &Scene, has_cut_outs: bool) -> Vec<BackEnd> {
    let declared = [NONE, "the stage is left out"];
    let mut rows = vec![BackEnd::new(stage, declared, Guarantee::Conservative)];
    rows.extend(match stage {
        StageKind::Region => BackEnd::of(stage, region::BACK_ENDS, |has| has(scene)),
        StageKind::Object => Vec::new(),
        StageKind::Occlusion => BackEnd::of(stage, OCCLUSION_ROWS, |_| true),
        StageKind::Triangle => BackEnd::of(stage, TRIANGLE_ROWS, |_| true),
        StageKind::Fragment => BackEnd::of(stage, FRAGMENT_ROWS, |has| has(scene, has_cut_outs)),
    });
    rows
}

/// Tests of the fragment stage.
///
/// `build` tests whether a scene has what the row needs; its flag is true if some items have holes.
const FRAGMENT_ROWS: &[FragmentRow] = rows! { FragmentRow { name, guarantee, summary, build }
    Z, Guarantee::SampleExact, "the nearest fragment of each sample, exactly",
        |_, has_cut_outs| !has_cut_outs;
    Z, Guarantee::Unproven, "the nearest fragment, holes or not", |_, has_cut_outs| has_cut_outs;
    ALPHA, Guarantee::SampleExact, "the nearest opaque fragment", |_, has_cut_outs| has_cut_outs;
    STENCIL, Guarantee::SampleExact,
        "the same, but beyond the eye's room only at samples that see its portals",
        |scene, _| matches!(&scene.regions, Regions::Tiling(rooms) if !rooms.portals.is_empty());
};

type FragmentRow = Row<fn(&Scene, bool) -> bool>;

/// Default test of the fragment stage.
pub fn default_test(has_cut_outs: bool) -> &'static str {
    if has_cut_outs { ALPHA } else { Z }
}

/// Appends the items of a view that are not hidden.
pub type Occlude = Box<dyn FnMut(&OccluderTree, &View, &mut Vec<ItemId>)>;

/// Row of the occlusion stage: allocates a buffer of the given size.
pub type OcclusionRow = Row<fn(SampleGrid, Kernel) -> Occlude>;

/// Rows of the occlusion stage.
///
/// A summary names the source of code written after a description.
pub const OCCLUSION_ROWS: &[OcclusionRow] = rows! { OcclusionRow { name, guarantee, build, summary }
    MASKED_INNER, Guarantee::Conservative, occlude::<MaskedInner>,
        "masked tiles of 8 x 4 pixels; only wholly covered pixels hide";
    "masked", Guarantee::Unproven, occlude::<MaskedCentre>,
        "masked tiles of 8 x 4 pixels; pixels whose centre is covered hide (stand-in for \
         Hasselgren, Andersson, Akenine-Moeller 2016)";
};

fn occlude<B: OcclusionBuffer + 'static>(grid: SampleGrid, kernel: Kernel) -> Occlude {
    let mut state = Interleaved::new(B::new(grid), kernel);
    Box::new(move |scene, view, out| {
        state.cull(scene, view, out);
    })
}
