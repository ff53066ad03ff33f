//! Update policies of the structure to take, under the motion of the items.

use serde::Serialize;

use super::choice::{StructureChoice, ns};
use super::options::AdviseInput;
use crate::index::UpdatePolicy;
use crate::measure::ReportCell;
use crate::motion::Motion;

/// Policies measured beside the refit, unless their builds alone take longer.
const POLICIES: [UpdatePolicy; 3] = [
    UpdatePolicy::Rebuild,
    UpdatePolicy::Every(10),
    UpdatePolicy::Every(50),
];
/// A policy is ruled out where its builds alone take this many times a frame.
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
    /// Policies that are not measured, each with the time of its builds per frame, ns.
    pub ruled_out: Vec<(String, f64)>,
    /// `false` if the structure is built again in every frame.
    #[serde(skip)]
    refits: bool,
}

impl MotionChoice {
    /// The choice before it is made, and labels of the policies to be measured.
    ///
    /// `None` for a still scene. Policies of `--update` are rows of the run instead. Those
    /// without a second rebuild in the frames are left out.
    pub(super) fn begun(
        input: &AdviseInput,
        structure: &StructureChoice,
        motion: Option<&Motion>,
    ) -> Option<(MotionChoice, Vec<String>)> {
        let motion = motion?;
        let (mut ruled_out, mut measured) = (Vec::new(), Vec::new());
        let mut all = input.setting.structures.iter();
        let are_rows = all.clone().any(|s| s.policy != UpdatePolicy::Refit);
        let spec = all.find(|s| structure.name.as_ref() == Some(&s.label));
        let refits = spec.is_none_or(|spec| spec.info().refits);
        let spec = spec.filter(|_| refits);
        for policy in POLICIES.into_iter().filter(|_| !are_rows) {
            let frames = match policy {
                UpdatePolicy::Every(frames) if 2 * frames as usize > motion.frames() => continue,
                UpdatePolicy::Every(frames) => f64::from(frames),
                _ => 1.0,
            };
            let (Some(spec), Some(row)) = (spec, structure.rows.first()) else {
                continue;
            };
            let builds = row.value("build_ms").unwrap_or(0.0) * 1e6 / frames;
            match builds > RULED_OUT * ns(row).unwrap_or(f64::INFINITY) {
                true => ruled_out.push((policy.to_string(), builds)),
                false => measured.push(format!("{}@{policy}", spec.label)),
            }
        }
        let begun = MotionChoice {
            ruled_out,
            refits,
            ..MotionChoice::default()
        };
        Some((begun, measured))
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
