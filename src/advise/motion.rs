//! Update policies of the structure to take, under the motion of the items.

use serde::Serialize;

use super::choice::{StructureChoice, ns};
use super::options::AdviseInput;
use crate::index::UpdatePolicy;
use crate::measure::ReportCell;

/// Rebuilds are ruled out where the builds alone take this many times a frame.
const RULED_OUT: f64 = 1.5;

/// The policy to update the structure by.
#[derive(Clone, Default, Debug, Serialize)]
pub struct MotionChoice {
    /// The fastest policy of the structure that is taken; null without a structure.
    pub policy: Option<String>,
    /// Others that the processes do not tell from it.
    pub policy_ties: Vec<String>,
    /// Measured policies of the structure, fastest first.
    pub policies: Vec<ReportCell>,
    /// Policies that are not measured, each with its builds / a frame with refits.
    ///
    /// Both are from the same processes.
    pub ruled_out: Vec<(String, f64)>,
    /// `false` if the structure is built again in every frame.
    #[serde(skip)]
    refits: bool,
}

impl MotionChoice {
    /// The choice before it is made, and the label of the rebuilds to be measured.
    ///
    /// Policies of `--update` are rows of the run instead.
    pub(super) fn begun(
        input: &AdviseInput,
        structure: &StructureChoice,
    ) -> (MotionChoice, Option<String>) {
        let mut all = input.setting.structures.iter();
        let are_rows = all.clone().any(|s| s.policy != UpdatePolicy::Refit);
        let spec = all.find(|s| structure.name.as_ref() == Some(&s.label));
        let mut begun = MotionChoice {
            refits: spec.is_none_or(|spec| spec.info().refits),
            ..MotionChoice::default()
        };
        let spec = spec.filter(|_| begun.refits && !are_rows);
        let rebuilt = spec.zip(structure.rows.first()).and_then(|(spec, row)| {
            let builds = row.value("build_ms").unwrap_or(0.0) * 1e6;
            if builds > RULED_OUT * ns(row).unwrap_or(f64::INFINITY) {
                let frames = builds / ns(row).unwrap_or(f64::INFINITY);
                begun.ruled_out.push(("rebuild".to_owned(), frames));
                return None;
            }
            Some(format!("{}@rebuild", spec.label))
        });
        (begun, rebuilt)
    }

    /// Chooses among the cells of the structure that is taken, under several policies.
    pub(super) fn chosen(self, structure: &StructureChoice, cells: &[ReportCell]) -> MotionChoice {
        let alone = |label: &str| label.split('@').next().map(str::to_owned);
        let taken = structure.name.as_deref().and_then(alone);
        let own = cells.iter().filter(|cell| alone(&cell.structure) == taken);
        let own = StructureChoice::of(&own.cloned().collect::<Vec<_>>());
        let policy = |label: &String| match policy_of(label) {
            "refit" if !self.refits => "rebuild".to_owned(),
            policy => policy.to_owned(),
        };
        MotionChoice {
            policy: own.name.as_ref().map(policy),
            policy_ties: own.ties.iter().map(policy).collect(),
            policies: own.rows,
            ..self
        }
    }
}

/// The policy in a label, `wide@every=10`.
pub fn policy_of(label: &str) -> &str {
    label.split_once('@').map_or("refit", |(_, policy)| policy)
}
