//! What a study of the funnel finds, as it is shown and written.

use serde::Serialize;

use super::bounds::BoundRow;
use super::chain::Chain;
use super::fragments::FragmentCounts;
use super::judged::Errors;
use super::left_out::LeftOutRow;
use super::mirror::MirrorRow;
use super::orders::OrderRow;
use super::picks::PickRow;
use super::plan_view::PlanView;
use super::stage::{BackEnd, StageKind};
use super::times::Times;
use crate::measure::OverProcesses;
use crate::statistics::{ALPHA, trimmed_mean};
use crate::visibility::Level;
use crate::visibility::fragment::{CutOuts, Surfaces};
use crate::visibility::hiders::{BlocksRow, GroundRow, InnerRow};

/// The funnel of a scene and a path.
#[derive(Clone, Debug, Serialize)]
#[non_exhaustive]
pub struct FunnelReport {
    /// As it was asked for.
    pub scene: String,
    /// As it was asked for.
    pub path: String,
    /// Items of the scene.
    pub items: usize,
    /// Views that were looked at.
    pub views: usize,
    /// Columns and rows of samples of a view.
    pub samples: [u32; 2],
    /// Processes that the times are of.
    pub processes: usize,
    /// What was selected of the scene's file.
    pub level: LevelRow,
    /// Which items have holes; null where none was asked for.
    pub cut_outs: Option<CutOutRow>,
    /// What `hierarchical-z` draws: `all`, `nearest:64`.
    pub occluders: String,
    /// The chain whose stages follow each other in [`FunnelReport::stages`].
    pub chain: Chain,
    /// Every stage with every back end, each given what the chain hands it.
    pub stages: Vec<StageRow>,
    /// The boxes inside the items of a mesh, which hide what is behind them; null for
    /// what is no mesh.
    pub inner_boxes: Option<InnerRow>,
    /// The boxes in the solid of a map, which hide what is behind them; null for what is no
    /// map.
    pub solid_blocks: Option<BlocksRow>,
    /// The boxes below the ground of a mesh; null for a scene without ground.
    pub ground: Option<GroundRow>,
    /// What is seen in a mirror; null where none was asked for.
    pub mirror: Option<MirrorRow>,
    /// What is left, drawn in every order.
    pub orders: Vec<OrderRow>,
    /// What is under a cursor, by every back end of picking and every structure.
    pub picks: Vec<PickRow>,
    /// Rows that are not there, and why.
    pub left_out: Vec<LeftOutRow>,
    /// The least that some of the back ends can take.
    pub bounds: Vec<BoundRow>,
    /// Each stage of the chain, with it and without it.
    pub gains: Vec<Gain>,
    /// What follows, in a sentence each.
    pub conclusions: Vec<String>,
    /// The first view from above.
    #[serde(skip)]
    pub plan_view: PlanView,
}

/// The level stage.
#[derive(Clone, PartialEq, Debug, Serialize)]
#[non_exhaustive]
pub struct LevelRow {
    /// Maps of the file; 1 for what holds none.
    pub map_count: usize,
    /// The one that was selected.
    pub selected: String,
    /// Items of all maps.
    pub input_count: usize,
    /// Items of the selected one.
    pub output_count: usize,
    /// Wall time that decoding the others takes; null where there are none.
    pub saved_load_ns: Option<f64>,
    /// Lower end of its 95 % interval.
    pub saved_load_ns_lower: Option<f64>,
    /// Upper end of its 95 % interval.
    pub saved_load_ns_upper: Option<f64>,
}

impl LevelRow {
    /// Of a level.
    pub fn of(level: &Level) -> LevelRow {
        let saved = level.saved_ns();
        let interval = saved.map(|saved| saved.interval(1.0 - ALPHA));
        LevelRow {
            map_count: level.maps.len(),
            selected: level.maps[level.selected].name.clone(),
            input_count: level.items(),
            output_count: level.selected_items(),
            saved_load_ns: saved.map(|saved| saved.mean),
            saved_load_ns_lower: interval.map(|(lower, _)| lower.max(0.0)),
            saved_load_ns_upper: interval.map(|(_, upper)| upper),
        }
    }
}

/// The items that have holes.
#[derive(Clone, Copy, PartialEq, Debug, Serialize)]
#[non_exhaustive]
pub struct CutOutRow {
    /// Where they are opaque.
    pub mask: &'static str,
    /// Of the items that may be cut out.
    pub share: f64,
    /// Edge length of a tile of the mask, world units.
    pub tile: f64,
    /// Which items they are.
    pub seed: u64,
    /// How many they are.
    pub item_count: usize,
}

impl CutOutRow {
    /// Of what was asked for, and what it made.
    pub fn of(cut_outs: &CutOuts, made: &Surfaces) -> CutOutRow {
        CutOutRow {
            mask: cut_outs.mask.name(),
            share: cut_outs.share,
            tile: cut_outs.tile,
            seed: cut_outs.seed,
            item_count: made.count(),
        }
    }
}

/// A stage done by a back end.
#[derive(Clone, Debug, Serialize)]
#[non_exhaustive]
pub struct StageRow {
    /// What does it.
    #[serde(flatten)]
    pub back_end: BackEnd,
    /// The structure of the object stage; `null` elsewhere.
    pub structure: Option<String>,
    /// Whether it is part of the chain.
    pub is_chosen: bool,
    /// What is counted: items or triangles.
    pub unit: &'static str,
    /// What it let through and what it lost.
    #[serde(flatten)]
    pub errors: Errors,
    /// Thread CPU time of a view.
    #[serde(flatten)]
    pub times: Times,
    /// Time / what it removed: above this cost of drawing one of them it pays.
    pub ns_per_removed: Option<f64>,
    /// Time / what it was given.
    pub ns_per_decided: Option<f64>,
    /// Samples and fragments of a test of the fragment stage; null elsewhere.
    pub fragments: Option<FragmentCounts>,
}

/// What a stage is worth where all others are as in the chain.
#[derive(Clone, Debug, Serialize)]
#[non_exhaustive]
pub struct Gain {
    /// The stage that is left out on the other side.
    pub stage: StageKind,
    /// What does it.
    pub back_end: String,
    /// What is counted at the end: items, triangles or shaded fragments.
    pub unit: &'static str,
    /// Time of all stages of whole items together, a view, and of the one behind them if it
    /// is this one.
    pub with_ns: Option<f64>,
    /// The same without the stage.
    pub without_ns: Option<f64>,
    /// What is left in the end, a view.
    pub with_count: f64,
    /// The same without the stage.
    pub without_count: f64,
    /// Cost of drawing one of them above which the stage pays: what it costs in all / what
    /// it removes in the end. 0 if it saves time as well; null if it removes nothing or has no
    /// time.
    pub break_even_ns: Option<f64>,
    /// Lower end of its 95 % interval.
    pub break_even_ns_lower: Option<f64>,
    /// Upper end of its 95 % interval.
    pub break_even_ns_upper: Option<f64>,
}

/// One side of a [`Gain`]: the tasks of a chain's steps, and what is left in the end.
pub struct Side {
    /// Tasks of the timed pass.
    pub tasks: Vec<usize>,
    /// What is left, a view.
    pub count: f64,
}

impl Gain {
    /// What the stage removes in the end, a view.
    pub fn removed(&self) -> f64 {
        self.without_count - self.with_count
    }

    /// Of a chain with and without a stage.
    pub fn of(
        stage: StageKind,
        back_end: &str,
        unit: &'static str,
        [with, without]: [&Side; 2],
        times: &OverProcesses,
    ) -> Gain {
        let (spent, saved) = (sums(with, times), sums(without, times));
        let mean = |sums: &[f64]| centre(sums).filter(|_| !sums.is_empty());
        let removed = without.count - with.count;
        let costs: Vec<f64> = spent
            .iter()
            .zip(&saved)
            .map(|(a, b)| (a - b) / removed)
            .collect();
        let pays = removed > 0.0;
        let interval = trimmed_mean(&costs)
            .map(|cost| cost.interval(1.0 - ALPHA))
            .filter(|_| pays);
        Gain {
            stage,
            back_end: back_end.to_owned(),
            unit,
            with_ns: mean(&spent),
            without_ns: mean(&saved),
            with_count: with.count,
            without_count: without.count,
            break_even_ns: centre(&costs).filter(|_| pays).map(|ns| ns.max(0.0)),
            break_even_ns_lower: interval.map(|(lower, _)| lower.max(0.0)),
            break_even_ns_upper: interval.map(|(_, upper)| upper.max(0.0)),
        }
    }
}

/// Time of all steps of a side in each process, ns. A chain without steps takes none;
/// one with a step that has no time has none.
fn sums(side: &Side, times: &OverProcesses) -> Vec<f64> {
    let of_steps: Vec<Vec<f64>> = side.tasks.iter().map(|&task| times.ln_ns(task)).collect();
    let processes = (0..times.processes()).map(|process| {
        let parts = of_steps
            .iter()
            .map(|step| step.get(process).map(|ln| ln.exp()));
        parts.sum::<Option<f64>>().map(|sum| sum + 0.0)
    });
    processes.collect::<Option<_>>().unwrap_or_default()
}

/// The trimmed mean, or below three values the plain one.
fn centre(values: &[f64]) -> Option<f64> {
    let plain = || values.iter().sum::<f64>() / values.len() as f64;
    (!values.is_empty()).then(|| trimmed_mean(values).map_or_else(plain, |mean| mean.mean))
}
