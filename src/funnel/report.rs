//! Report of a study as shown and written, with conclusions in sentences.

use serde::Serialize;

use super::error::LeftOutRow;
use super::fragment_stage::MeanCounts;
use super::item_stages::PlanView;
use super::picks::PickRow;
use super::stage::{BackEnd, Chain, NONE, STENCIL, StageKind, default_test};
use super::task::FunnelKey;
use super::visible_items::Errors;
use crate::measure::OverProcesses;
use crate::shown::{counted, significant, time};
use crate::statistics::{Estimate, about, centre, flat, ratio};
use crate::visibility::MapSelection;
use crate::visibility::fragment::CutOuts;
use crate::visibility::occluders::{BlockStats, GroundStats, InnerBoxStats};

/// The funnel of a scene and a path.
#[derive(Clone, Debug, Serialize)]
pub struct FunnelReport {
    /// Scene as typed.
    pub scene: String,
    /// Path as typed.
    pub path: String,
    /// Number of items of the scene.
    pub items: usize,
    /// Items left out on request (`--skip-bad-items`).
    pub skipped_items: usize,
    /// Number of views.
    pub views: usize,
    /// Number of cameras of the path; the views are evenly spread over them.
    pub cameras: usize,
    /// Columns and rows of samples of a view.
    pub samples: [u32; 2],
    /// Number of timed processes.
    pub processes: usize,
    /// The selected level of the scene's file.
    pub level: MapSelection,
    /// Items that have holes; null unless requested.
    pub cut_outs: Option<CutOutRow>,
    /// Measured chain; [`FunnelReport::stages`] vary one of its stages at a time.
    pub chain: Chain,
    /// Every back end of every stage.
    pub stages: Vec<StageRow>,
    /// Occluder boxes inside the items of a mesh; null for other scenes.
    pub inner_boxes: Option<InnerBoxStats>,
    /// Occluder boxes in the solid space of a map; null for other scenes.
    pub solid_blocks: Option<BlockStats>,
    /// Occluder boxes below the ground of a mesh; null for a scene without ground.
    pub ground: Option<GroundStats>,
    /// Results of picking, by back end and structure.
    pub picks: Vec<PickRow>,
    /// Missing rows, each with its reason.
    pub left_out: Vec<LeftOutRow>,
    /// Each stage of the chain, compared with the chain without it.
    pub gains: Vec<Gain>,
    /// Conclusions, a sentence each.
    pub conclusions: Vec<String>,
    /// Warnings about the cameras in the scene.
    pub warnings: Vec<String>,
    /// The view with the most visible items, from above.
    #[serde(skip)]
    pub plan_view: PlanView,
}

impl FunnelReport {
    /// Returns `true` for a task of the chain, or of the chain without one stage.
    pub(super) fn needs(&self, key: &FunnelKey) -> bool {
        let mut chosen = self.stages.iter().filter(|row| row.is_chosen);
        let mut of_gains = self.gains.iter().flat_map(|gain| &gain.tasks);
        chosen.any(|row| row.key(&self.chain).as_ref() == Some(key))
            || of_gains.any(|tasks| tasks.contains(key))
    }
}

/// Items with holes.
#[derive(Clone, Copy, PartialEq, Debug, Serialize)]
pub struct CutOutRow {
    /// Mask, share and seed as typed.
    #[serde(flatten)]
    pub typed: CutOuts,
    /// Number of items with holes.
    pub item_count: usize,
}

/// Results of one back end of a stage.
#[derive(Clone, Default, Debug, Serialize)]
pub struct StageRow {
    /// The back end.
    #[serde(flatten)]
    pub back_end: BackEnd,
    /// Structure of the object stage; null for other stages.
    pub structure: Option<String>,
    /// `true` for a back end of the chain.
    pub is_chosen: bool,
    /// Unit of the counts: items or triangles.
    pub unit: &'static str,
    /// Errors compared with the truth.
    #[serde(flatten)]
    pub errors: Errors,
    /// Thread CPU time per view.
    #[serde(flatten, serialize_with = "flat::stage_ns")]
    pub time: Option<Estimate>,
    /// Time / removed candidates: the stage pays if drawing one costs more.
    pub ns_per_removed: Option<f64>,
    /// Time / candidates.
    pub ns_per_decided: Option<f64>,
    /// Samples and fragments of a fragment test; null for other stages.
    pub fragments: Option<MeanCounts>,
}

impl StageRow {
    /// A row without times, for a back end at its place in a chain.
    pub(super) fn new(back_end: BackEnd, name: &str, chain: &Chain, errors: Errors) -> StageRow {
        StageRow {
            structure: (back_end.name != name).then(|| name.to_owned()),
            is_chosen: chain.of(back_end.stage) == name,
            unit: back_end.stage.unit(),
            back_end,
            errors,
            ..StageRow::default()
        }
    }

    /// Sentence on the visible items that it drops; `None` if it drops none.
    pub fn loss(&self) -> Option<String> {
        let errors = &self.errors;
        (errors.false_negative_count > 0.0).then(|| {
            format!(
                "{} {} drops {} visible items per view; the largest covers {}.",
                self.back_end.stage.name(),
                self.back_end.name,
                significant(errors.false_negative_count),
                counted(errors.worst_missing_samples as usize, "sample")
            )
        })
    }

    /// Task of the back end at its place in a chain; `None` for [`NONE`].
    pub(super) fn key(&self, chain: &Chain) -> Option<FunnelKey> {
        let name = self.structure.as_deref().unwrap_or(self.back_end.name);
        match self.back_end.stage {
            _ if name == NONE => None,
            stage @ (StageKind::Triangle | StageKind::Fragment) => {
                Some(FunnelKey::Stage(stage, name.to_owned()))
            }
            stage => Some(FunnelKey::Steps(chain.steps_with(stage, name))),
        }
    }

    pub(super) fn set(&mut self, chain: &Chain, times: &OverProcesses<FunnelKey>) {
        let Some(found) = self.key(chain).and_then(|key| times.ns(&key)) else {
            return;
        };
        let per = |count: f64| (count > 0.0).then(|| found.value / count);
        self.ns_per_removed = per(self.errors.input_count - self.errors.output_count);
        self.ns_per_decided = per(self.errors.input_count);
        self.time = Some(found);
    }
}

/// Benefit of a stage, with all other stages as in the chain.
#[derive(Clone, Default, Debug, Serialize)]
pub struct Gain {
    /// Stage that is compared with leaving it out.
    pub stage: StageKind,
    /// Back end of the stage.
    pub back_end: String,
    /// Unit of the counts: items, triangles or shaded fragments.
    pub unit: &'static str,
    /// Time per view of all stages of whole items, plus the stage itself.
    pub with_ns: Option<f64>,
    /// Time per view without the stage.
    pub without_ns: Option<f64>,
    /// Count at the end of the chain, per view.
    pub with_count: f64,
    /// Count without the stage, per view.
    pub without_count: f64,
    /// Extra time / removed candidates: the least draw cost for which the stage pays.
    ///
    /// 0 if it saves time as well; null if it removes nothing or all, or has no time.
    /// The interval includes the machine's speed, as that of a time does.
    #[serde(flatten, serialize_with = "flat::break_even_ns")]
    pub break_even: Option<Estimate>,
    /// Time with the stage / time without it.
    #[serde(skip)]
    pub ratio: Option<Estimate>,
    /// Tasks with the stage and without it.
    #[serde(skip)]
    pub(super) tasks: [Vec<FunnelKey>; 2],
}

impl Gain {
    /// A gain without times, from counts and tasks with and without the stage.
    pub(crate) fn new(
        stage: StageKind,
        (back_end, unit): (&str, &'static str),
        [with_count, without_count]: [f64; 2],
        tasks: [Vec<FunnelKey>; 2],
    ) -> Gain {
        Gain {
            stage,
            back_end: back_end.to_owned(),
            unit,
            with_count,
            without_count,
            tasks,
            ..Gain::default()
        }
    }

    /// Net number of candidates that the stage removes, per view.
    pub fn removed(&self) -> f64 {
        self.without_count - self.with_count
    }

    pub(super) fn set(&mut self, times: &OverProcesses<FunnelKey>) {
        let speeds = times.speeds();
        let steady = |ns: &[f64]| {
            let ns = ns.iter().zip(&speeds).map(|(ns, speed)| ns * speed);
            centre(&Vec::from_iter(ns))
        };
        let [with, without] = self.tasks.each_ref().map(|tasks| sums(times, tasks));
        (self.with_ns, self.without_ns) = (steady(&with), steady(&without));
        let logs = |ns: &Vec<f64>| Vec::from_iter(ns.iter().map(|ns| ns.ln()));
        let [own, other] = [&with, &without].map(logs);
        self.ratio = ratio(&other, &own, &other);
        let removed = self.removed();
        if removed > 0.0 && self.with_count > 0.0 {
            let costs = with.iter().zip(&without).map(|(a, b)| (a - b) / removed);
            let costs: Vec<f64> = costs.collect();
            self.break_even = steady(&costs).map(|ns| about(ns, &costs).map(|ns| ns.max(0.0)));
        }
    }
}

/// Summed times of some tasks as measured in each process, ns.
///
/// 0 without tasks; empty if one of them has no times.
fn sums(times: &OverProcesses<FunnelKey>, tasks: &[FunnelKey]) -> Vec<f64> {
    let logs: Vec<&[f64]> = tasks.iter().map(|key| times.own(key)).collect();
    let sum = |process: usize| {
        let parts = logs.iter().map(|own| own.get(process).map(|ln| ln.exp()));
        parts.sum::<Option<f64>>().map(|sum| sum + 0.0)
    };
    let sums: Option<Vec<f64>> = (0..times.processes()).map(sum).collect();
    sums.unwrap_or_default()
}

/// Conclusions: remaining items and the benefit of each stage, then sentences.
///
/// The sentences are about back ends that lost items, and about the stencil.
pub fn conclusions(report: &FunnelReport) -> Vec<String> {
    let is_last = |row: &&StageRow| row.is_chosen && row.back_end.stage == StageKind::Occlusion;
    let last = report.stages.iter().find(is_last);
    let seen = report.stages[0].errors.truth_count;
    if seen == 0.0 && last.is_some_and(|last| last.errors.output_count == 0.0) {
        let views = counted(report.views, "view");
        return vec![format!(
            "Nothing is to be taken: no item is seen in the {views} used."
        )];
    }
    let last = last.map(|last| {
        format!(
            "Of {} {} remain to be drawn and {} are in front at some sample, per view.",
            counted(report.items, "item"),
            significant(last.errors.output_count),
            significant(seen)
        )
    });
    let inner = report.inner_boxes.as_ref();
    let none_boxed = inner.is_some_and(|inner| inner.boxed_count == 0);
    let gains = report.gains.iter();
    let gains = gains.filter_map(|gain| of_gain(gain, &report.stages, none_boxed));
    let told: Vec<String> = last.into_iter().chain(gains).collect();
    let mut sentences = vec![told.join(" ")];
    sentences.extend(report.stages.iter().filter_map(StageRow::loss));
    sentences.extend(of_stencil(report));
    sentences
}

const UNBOXED: &str = ": no box is found inside of a closed one, so none is an occluder";

/// Sentence on a stage; a stage that loses visible items saves nothing.
///
/// `None` for the depth test, which costs a GPU next to nothing.
fn of_gain(gain: &Gain, stages: &[StageRow], none_boxed: bool) -> Option<String> {
    if gain.stage == StageKind::Fragment {
        return None;
    }
    let what = format!("{} ({})", gain.stage.name(), gain.back_end);
    let unit = gain.unit.trim_end_matches('s');
    let is_own = |row: &&StageRow| row.is_chosen && row.back_end.stage == gain.stage;
    let errors = stages.iter().find(is_own).map(|row| &row.errors);
    if let Some(errors) = errors.filter(|errors| errors.false_negative_count > 0.0) {
        return Some(format!(
            "{what} removes {} {} per view, {} of them visible.",
            significant(errors.input_count - errors.output_count),
            gain.unit,
            significant(errors.false_negative_count)
        ));
    }
    let is_occlusion = gain.stage == StageKind::Occlusion;
    let hidden = errors.map(|errors| errors.output_count - errors.truth_count);
    Some(match (gain.break_even, hidden.filter(|_| is_occlusion)) {
        (None, _) if gain.removed() > 0.0 => return None,
        // Items may be hidden even if no occluder is found to hide them.
        (None, Some(hidden)) if hidden > 0.0 => {
            let why = if none_boxed { UNBOXED } else { "" };
            let hidden = significant(hidden);
            let left = format!("{hidden} of the items left are in front at no sample");
            format!("{what} removes nothing, though {left}{why}.")
        }
        (None, _) => {
            format!("{what} is not needed: it removes nothing that the other stages leave.")
        }
        (Some(ns), _) if ns.upper.unwrap_or(ns.value) == 0.0 => {
            format!("Use {what}: it saves time as well.")
        }
        (Some(ns), _) => {
            // The interval includes saving time as well.
            let most = ns.upper.filter(|_| ns.lower == Some(0.0));
            let within = most.map_or_else(String::new, |most| format!(" (0 to {})", time(most)));
            let least = time(ns.value);
            format!("Use {what} if drawing one {unit} takes more than {least}{within}.")
        }
    })
}

/// Sentence on the samples that the stencil test saves over the default test.
fn of_stencil(report: &FunnelReport) -> Option<String> {
    let test = |name: &str| {
        let row = report.stages.iter().find(|row| row.back_end.name == name)?;
        Some((row, row.fragments?.asked_count))
    };
    let (stencil, with) = test(STENCIL)?;
    let (other, without) = test(default_test(report.cut_outs.is_some()))?;
    if without == 0.0 || with == without {
        return None;
    }
    Some(format!(
        "fragment {} tests {} samples per view instead of {} ({:.1} % {}) and leaves {} items as {} \
         does.",
        stencil.back_end.name,
        significant(with),
        significant(without),
        (1.0 - with / without).abs() * 100.0,
        if with > without { "more" } else { "fewer" },
        match stencil.errors.output_count == other.errors.output_count {
            true => "as many",
            false => "not as many",
        },
        other.back_end.name,
    ))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::measure::ProcessTimes;

    /// The first task is the reference of all others; its own spread is not zero.
    #[test]
    fn a_break_even_spreads_as_the_time_of_its_stage() {
        let key = FunnelKey::Stage(StageKind::Object, "wide".to_owned());
        let process = |n: usize| ProcessTimes {
            ln_ns: vec![Ok(Some(5.0 + [0.0, 0.02, 0.05][n % 3]))],
            ..ProcessTimes::default()
        };
        let processes: Vec<ProcessTimes> = (0..10).map(process).collect();
        let times = OverProcesses::keyed(vec![key.clone()], &processes);
        let named = ("wide", "items");
        let mut gain = Gain::new(StageKind::Object, named, [2.0, 4.0], [vec![key], vec![]]);
        gain.set(&times);
        let time = times.ns(&gain.tasks[0][0]).expect("a time").per(2.0);
        let found = gain.break_even.expect("a cost");
        assert!((found.value / time.value - 1.0).abs() < 1e-12);
        let width = |of: Estimate| of.ends().map_or(f64::NAN, |[lower, upper]| upper - lower);
        assert!((width(found) / width(time) - 1.0).abs() < 0.01, "{found:?}");
    }

    #[test]
    fn noise_makes_no_advice_unconditional() {
        let gain = |value, lower, upper| {
            let mut gain = Gain::new(
                StageKind::Region,
                ("portals", "items"),
                [1.0, 2.0],
                [vec![], vec![]],
            );
            gain.break_even = Some(Estimate {
                value,
                lower: Some(lower),
                upper: Some(upper),
            });
            gain
        };
        let advice =
            |value, lower, upper| of_gain(&gain(value, lower, upper), &[], false).expect("one");
        let wanted = "Use region (portals) if drawing one item takes more than 350 ns";
        assert_eq!(
            advice(350.0, 0.0, 734.0),
            format!("{wanted} (0 to 734 ns).")
        );
        assert_eq!(advice(350.0, 300.0, 734.0), format!("{wanted}."));
        let lossy = |stage, false_negative_count| {
            let named = ["portals", ""];
            let errors = Errors {
                input_count: 9.0,
                output_count: 3.0,
                false_negative_count,
                ..Errors::of(&[])
            };
            let back_end = BackEnd::new(stage, named, crate::visibility::Guarantee::Unproven);
            StageRow {
                is_chosen: true,
                ..StageRow::new(back_end, "portals", &Chain::empty(), errors)
            }
        };
        let own = lossy(StageKind::Region, 5.0);
        assert_eq!(
            of_gain(&gain(350.0, 300.0, 734.0), &[own], false).expect("one"),
            "region (portals) removes 6.00 items per view, 5.00 of them visible."
        );
        // Losses of another stage are not attributed to this one.
        let other = lossy(StageKind::Occlusion, 5.0);
        let own = of_gain(&gain(350.0, 300.0, 734.0), &[other], false);
        assert_eq!(own.expect("one"), format!("{wanted}."));
        assert!(advice(0.0, 0.0, 9.0).ends_with("more than 0 ns (0 to 9.00 ns)."));
        assert!(advice(0.0, 0.0, 0.0).ends_with("saves time as well."));
        // Items that may still be hidden: the stage must not be called "not needed".
        let named = |stage| Gain::new(stage, ("masked", "items"), [3.0; 2], [vec![], vec![]]);
        let row = |truth_count| {
            let mut row = lossy(StageKind::Occlusion, 0.0);
            row.errors.truth_count = truth_count;
            of_gain(&named(StageKind::Occlusion), &[row], true).expect("one")
        };
        let wanted = "occlusion (masked) removes nothing, though 2.00 of the items left are in front \
            at no sample: no box is found inside of a closed one, so none is an occluder.";
        assert_eq!(row(1.0), wanted);
        assert!(row(3.0).contains("is not needed"));
    }
}
