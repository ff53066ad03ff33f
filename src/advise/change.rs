//! Changes of the workload on which the advice depends.
//!
//! Measures the contending structures on parts of the scene, with other shares of the items in
//! view, and with other shares of moving items, by the tasks of a run.

use anyhow::Context;
use serde::{Deserialize, Serialize};

use super::case::{AdviseInput, spec_of, subset};
use super::choice::{fastest, time_over};
use super::tasks::is_longer;
use crate::culling::{Culling, CullingTest};
use crate::measure::{
    Group, GroupPlan, Part, ProcessTimes, ReferenceResults, ReportCell, SceneInfo, Subject,
    Workload, measure,
};
use crate::motion::Motion;

/// Axis along which a workload is varied.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Axis {
    /// Number of items: evenly spread parts of the scene.
    Items,
    /// Share of the items in view: far and near planes are scaled.
    ShareInView,
    /// Share of the items that move per frame.
    ShareMoved,
}

/// Axes with the values that are measured in addition to the workload's.
///
/// Numbers of items are shares of the whole.
const AXES: [(Axis, [f64; 6]); 3] = [
    (Axis::Items, [4e-1, 1e-1, 2e-2, 4e-3, 1e-3, 2e-4]),
    (Axis::ShareInView, [0.001, 0.005, 0.02, 0.1, 0.4, 0.9]),
    (Axis::ShareMoved, [0.0001, 0.001, 0.01, 0.1, 0.4, 1.0]),
];
/// Smallest part of a scene, in items.
const MIN_ITEMS: f64 = 32.0;
/// Least ratio of a measured value to that of the workload.
const SPACING: f64 = 2.0;
/// Most frames of a changed workload.
const FRAMES: usize = 20;

/// Value from which another structure is faster.
#[derive(Clone, PartialEq, Debug, Serialize)]
pub struct Crossover {
    /// Fastest structure beyond it.
    pub structure: String,
    /// Value on the axis at which both structures take the same time.
    ///
    /// It lies between the measured values `lower` and `upper`: the chosen structure is
    /// significantly faster at one of them and slower at the other. If both tie at the workload's
    /// value, that value.
    pub at: f64,
    /// Smaller of the two values.
    pub lower: f64,
    /// Larger of the two values.
    pub upper: f64,
}

/// Dependence of the choice of structure on one axis.
#[derive(Clone, PartialEq, Debug, Serialize)]
pub struct Change {
    /// Number of items, share in view, or share moved.
    pub axis: Axis,
    /// Value of the workload.
    pub here: f64,
    /// Smallest and largest measured value.
    pub measured: [f64; 2],
    /// Reason why only the workload itself was measured; else null.
    pub not_varied: Option<String>,
    /// Crossover below `here`; null if the advice holds down to the smallest value.
    pub below: Option<Crossover>,
    /// Crossover above `here`; null if the advice holds up to the largest value.
    pub above: Option<Crossover>,
}

/// A workload varied along an axis.
#[derive(Clone, Debug, Serialize, Deserialize)]
struct VariedWorkload {
    /// `None` for the workload itself.
    axis: Option<Axis>,
    /// Requested value on the axis; `reached` is the actual one.
    value: f64,
    reached: f64,
    known: Option<ReferenceResults>,
}

/// Workloads measured in addition to the rules, the same for all processes.
#[derive(Clone, Debug, Default, Serialize, Deserialize)]
pub struct ExtraWorkloads {
    /// Labels of the contending structures.
    pub(super) contenders: Vec<String>,
    /// Label of the chosen structure with rebuilds, for the workload itself.
    pub(super) rebuilt: Option<String>,
    /// Values of the workload itself; `None` on an axis that it does not have.
    here: [Option<f64>; 3],
    /// Reasons why values of each axis were not measured.
    refused: [Option<String>; 3],
    changed: Vec<VariedWorkload>,
}

impl ExtraWorkloads {
    /// Plans the workloads; also returns the results of the count pass.
    pub(super) fn plan(
        input: &AdviseInput,
        (contenders, rebuilt): (Vec<String>, Option<String>),
        here: [Option<f64>; 3],
        progress: &dyn Fn(&str),
    ) -> (ExtraWorkloads, Vec<Part>) {
        let mut beside = ExtraWorkloads {
            contenders,
            rebuilt,
            here,
            ..ExtraWorkloads::default()
        };
        let is_choice = beside.contenders.len() > 1;
        let mut wanted = vec![(None, 0.0); usize::from(beside.rebuilt.is_some() || is_choice)];
        // A choice needs two contenders.
        let axes = AXES.into_iter().zip(here);
        for ((axis, values), here) in axes.filter(|_| is_choice) {
            let Some(here) = here else { continue };
            let whole = if axis == Axis::Items { here } else { 1.0 };
            let values = values.map(|value| value * whole).into_iter();
            let values = values.filter(|value| axis != Axis::Items || *value >= MIN_ITEMS);
            let values = values.filter(|value| (value / here).max(here / value) >= SPACING);
            beside.refused[axis as usize] = Some("the scene is too small for parts".to_owned());
            wanted.extend(values.map(|value| (Some(axis), value)));
        }
        progress("other numbers of items, shares in view and shares moved");
        let mut parts = Vec::new();
        for (axis, value) in wanted {
            let mut changed = VariedWorkload {
                axis,
                value,
                reached: value,
                known: None,
            };
            // No such workload: the cameras do not reach the share, or the motion is recorded.
            match (changed.measured(input, &beside), axis) {
                (Ok((reached, part)), _) => {
                    (changed.reached, changed.known) = (reached, part.known.clone());
                    beside.changed.push(changed);
                    parts.push(part);
                }
                (Err(why), Some(axis)) => {
                    // The shares of an axis are no wish of the user.
                    let why = why.to_string().replace("; expected a larger share", "");
                    beside.refused[axis as usize] = Some(why);
                }
                (Err(_), None) => {}
            }
        }
        (beside, parts)
    }

    /// Cells of the unchanged workload, for the contending structures only.
    pub(super) fn here<'g>(&self, groups: &'g [Group]) -> Option<&'g [ReportCell]> {
        let first = self.changed.first().zip(groups.first());
        first.and_then(|(own, group)| own.axis.is_none().then_some(&group.cells[..]))
    }

    /// Measures the workloads in one process.
    pub(super) fn times(&self, input: &AdviseInput) -> anyhow::Result<Vec<Part>> {
        let parts = self.changed.iter().map(|changed| {
            let measured = changed.measured(input, self).map(|(_, part)| part);
            measured.context("another scene or motion than the advice was spec_of for")
        });
        parts.collect()
    }

    /// Group of each workload, from the count pass and all processes.
    pub(super) fn groups(&self, counted: Vec<Part>, processes: &[ProcessTimes]) -> Vec<Group> {
        let groups = counted.into_iter().enumerate().map(|(n, counted)| {
            let timed = processes.iter().filter_map(|times| times.parts.get(n));
            let parts: Vec<Part> = [&counted].into_iter().chain(timed).cloned().collect();
            Group::of(&parts)
        });
        groups.collect()
    }

    /// Dependence of the choice on each axis that the workload has.
    ///
    /// `here` are the cells of the workload itself.
    pub(super) fn changes(&self, here: &[ReportCell], groups: &[Group]) -> Vec<Change> {
        let axes = AXES.iter().zip(self.here).zip(&self.refused);
        let changes = axes.filter_map(|((&(axis, _), value), refused)| {
            let (taken, value) = (self.contenders.first()?, value?);
            let own = self.changed.iter().zip(groups);
            let own = own.filter(|(changed, _)| changed.axis == Some(axis));
            let own = own.map(|(changed, group)| (changed.reached, &group.cells[..]));
            let mut points: Vec<(f64, &[ReportCell])> = own.chain([(value, here)]).collect();
            points.sort_by(|a, b| a.0.total_cmp(&b.0));
            let middle = points.iter().position(|point| point.0 == value)?;
            let (down, up) = (points[..=middle].iter().rev(), points[middle..].iter());
            let not_varied = refused.clone().filter(|_| points.len() == 1);
            (points.len() > 1 || not_varied.is_some()).then(|| Change {
                axis,
                here: value,
                not_varied,
                measured: [points[0].0, points[points.len() - 1].0],
                below: turn(taken, down.collect()),
                above: turn(taken, up.collect()),
            })
        });
        changes.collect()
    }
}

/// First of the points at which another structure is faster than the chosen one.
fn turn(taken: &str, points: Vec<&(f64, &[ReportCell])>) -> Option<Crossover> {
    (1..points.len()).find_map(|n| {
        let (value, there) = *points[n];
        let first = fastest(there);
        let winner = first.first()?;
        let ratio_at = |cells| time_over(cells, taken, &winner.structure);
        if is_longer(ratio_at(there)?) != Some(true) {
            return None;
        }
        // Last point at which the chosen one is significantly faster; none if the points tie from
        // the start.
        let ratio = |at: usize| ratio_at(points[at].1);
        let ahead = (0..n).rfind(|&at| ratio(at).and_then(is_longer) == Some(false));
        let before = points[ahead.unwrap_or(0)].0;
        // Interpolates the logarithms of value and ratio.
        let ln = |at: usize| ratio(at).map_or(0.0, |ratio| ratio.value.ln());
        let last = ahead.and_then(|_| (0..n).rfind(|&at| ln(at) <= 0.0));
        let at = last.map_or(before, |at| {
            let along = ln(at) / (ln(at) - ln(at + 1));
            points[at].0 * (points[at + 1].0 / points[at].0).powf(along)
        });
        let (lower, upper) = (before.min(value), before.max(value));
        Some(Crossover {
            structure: winner.structure.clone(),
            at: at.clamp(lower, upper),
            lower,
            upper,
        })
    })
}

impl VariedWorkload {
    /// Measures the workload; only counts if there is no count pass yet.
    ///
    /// # Errors
    /// There is no such workload.
    fn measured(
        &self,
        input: &AdviseInput,
        beside: &ExtraWorkloads,
    ) -> anyhow::Result<(f64, Part)> {
        let is = |axis| self.axis == Some(axis);
        let (whole, count) = (&input.setting.scene, self.value.round() as usize);
        let part = is(Axis::Items).then(|| subset(whole, whole.origin, count));
        let part = part.transpose()?;
        let scene = part.as_ref().unwrap_or(whole);
        let mut path = input.setting.path.clone();
        if is(Axis::ShareInView) {
            let lens_scale = self.known.as_ref().and_then(|known| known.lens_scale);
            path = path.seeing(scene, self.value, lens_scale)?;
        }
        let mut motion = None;
        if let Some(source) = input.motion {
            let own = Motion::load(source, whole)?;
            let share = is(Axis::ShareMoved).then_some(self.value);
            motion = Some(match (self.axis, own.respecified(share, FRAMES)) {
                (None, _) | (Some(Axis::ShareInView), None) => own,
                (_, spec) => Motion::load(&spec.context("the motion is recorded")?, scene)?,
            });
        }
        let culling = Culling::default();
        let workload = Workload::moving(scene, &path, &culling, motion, input.views)?;
        let rebuilt = beside.rebuilt.iter().filter(|_| self.axis.is_none());
        let build = |label: &String| {
            let spec = spec_of(&input.setting.structures, label);
            Subject::build(spec, false, scene, CullingTest::SixPlane)
        };
        let subjects: Vec<_> = beside.contenders.iter().chain(rebuilt).map(build).collect();
        let info = SceneInfo::of(scene);
        let plan = GroupPlan {
            process: u32::from(self.known.is_some()),
            known: self.known.as_ref(),
            plan_only: self.known.is_none(),
            locate: false,
            ..GroupPlan::new(&workload, &info, input.setting.protocol)
        };
        let (part, _) = measure(&workload, &subjects, plan);
        let items = scene.items.len();
        let moved = workload.motion.as_ref().map(Motion::share);
        let reached = match self.axis {
            Some(Axis::Items) => Some(items as f64),
            // Mean share of the items that a query returns.
            Some(Axis::ShareInView) => part.known.as_ref().map(|known| {
                let counts = known.visible.iter().map(|answer| answer.count as f64);
                counts.sum::<f64>() / (known.visible.len() * items).max(1) as f64
            }),
            _ => moved,
        };
        Ok((reached.unwrap_or(self.value), part))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::measure::{GroupKey, PathInfo, Status};

    /// Cells of structures with times in ns; ten processes, each slightly different.
    fn cells(times: &[(&str, f64)]) -> Vec<ReportCell> {
        let key = GroupKey::of("scene", "path", false, &Culling::default(), "");
        let cell = |&(structure, ns): &(&str, f64)| {
            let text = serde_json::json!({
                "scene": SceneInfo::unknown("scene"), "path": PathInfo::unknown(&key),
                "structure": structure, "params": null, "test": "six-plane",
                "status": Status::Ok, "reason": null, "rank": 1, "metrics": {
                    "query_ns": { "value": ns, "lower": null, "upper": null, "unit": "ns" }
                }, "error": null, "left_out": [], "samples_ref": null,
            });
            let mut cell: ReportCell = serde_json::from_value(text).unwrap();
            let off = |n: usize| 1.0 + 0.002 * ((n * structure.len()) % 7) as f64;
            let own = (0..10).map(|n| ns * off(n)).collect();
            cell.times.by_process.insert("query_ns".to_owned(), own);
            cell
        };
        times.iter().map(cell).collect()
    }

    #[test]
    fn advice_turns_where_another_structure_is_faster_by_more_than_a_tie() {
        let of = |tree: f64| cells(&[("wide", tree), ("linear", 100.0)]);
        let [here, tie, slower] = [of(50.0), of(103.0), of(200.0)];
        let found = |points: &[(f64, &[ReportCell])]| turn("wide", points.iter().collect());
        // Half the time at 400 items, twice the time at 100: equal at 200.
        let first = found(&[(400.0, &here), (100.0, &slower), (10.0, &of(900.0))]).unwrap();
        assert_eq!(
            (&first.structure[..], first.lower, first.upper),
            ("linear", 100.0, 400.0)
        );
        assert!((first.at / 200.0 - 1.0).abs() < 0.01, "{first:?}");
        // A tie changes no advice; the turn lies between it and where the tree is faster.
        assert_eq!(found(&[(400.0, &here), (100.0, &tie)]), None);
        let late = found(&[(400.0, &here), (100.0, &tie), (25.0, &slower)]).unwrap();
        assert_eq!((late.lower, late.upper), (25.0, 400.0));
        assert!(100.0 < late.at && late.at < 110.0, "{late:?}");
        // A tie from the start, though slightly faster: there is no point to interpolate from.
        let near = of(99.0);
        let tied = found(&[(400.0, &near), (100.0, &slower)]).unwrap();
        assert_eq!((tied.at, tied.lower, tied.upper), (400.0, 100.0, 400.0));
        // Slower from the start, but not significantly.
        let early = found(&[(400.0, &tie), (100.0, &slower)]).unwrap();
        assert_eq!((early.at, early.lower), (400.0, 100.0));
        assert_eq!(found(&[(400.0, &here)]), None);
    }

    #[test]
    fn each_axis_has_the_values_about_the_workload() {
        let group = |tree: f64| Group {
            cells: cells(&[("wide", tree), ("linear", 100.0)]),
            bounds: Vec::new(),
            twin: None,
        };
        let changed = |axis, reached| VariedWorkload {
            axis: Some(axis),
            value: reached,
            reached,
            known: None,
        };
        let beside = ExtraWorkloads {
            contenders: vec!["wide".to_owned()],
            here: [Some(400.0), Some(0.02), None],
            changed: vec![
                changed(Axis::Items, 100.0),
                changed(Axis::ShareInView, 0.5),
                changed(Axis::ShareInView, 0.001),
            ],
            ..ExtraWorkloads::default()
        };
        let groups = [group(200.0), group(150.0), group(10.0)];
        let here = group(50.0).cells;
        let changes = beside.changes(&here, &groups);
        let axes: Vec<Axis> = changes.iter().map(|change| change.axis).collect();
        assert_eq!(axes, [Axis::Items, Axis::ShareInView]);
        assert_eq!(changes[1].measured, [0.001, 0.5]);
        let sides = |c: &Change| [c.below.is_some(), c.above.is_some()];
        assert_eq!(sides(&changes[0]), [true, false]);
        assert_eq!(sides(&changes[1]), [false, true]);
    }
}
