//! Outcome of one cell between an old measurement and a new one.
//!
//! Measurements are two reports, or alternating runs of two programs. One row type for both, the
//! metrics that may be judged, and the counters that are compared exactly.

use std::cmp::Ordering;

use serde::Serialize;

use crate::measure::{CellKey, GroupKey, Status};
use crate::statistics::{Change, Judgement};

/// The metrics with a value per process, as judging requires; less is better.
///
/// Structures are ranked by the first one.
pub static JUDGED_METRICS: &[&str] = &[
    "query_ns",
    "locate_ns",
    "locate_batched_ns",
    "build_ms",
    "frame_ns",
    "update_ns",
];

/// Counters that do not depend on the machine or the moment.
///
/// Any difference is a change of the program.
pub static COUNTERS: &[&str] = &[
    "visible_count",
    "nodes_tested",
    "planes_tested",
    "items_tested",
    "items_accepted_untested",
    "comparisons",
    "regions_found",
    "memory_bytes_per_item",
];

/// The counters that `compare --gate work` judges: of a query, of a region search.
#[rustfmt::skip]
pub static WORK: &[&str] = &["nodes_tested", "items_tested", "planes_tested", "comparisons"];

named! {
    /// Outcome of a cell, worst first.
    #[derive(Clone, Copy, Default, PartialEq, Eq, PartialOrd, Ord, Debug, Serialize)]
    #[serde(rename_all = "snake_case")]
    pub enum Outcome {
        /// The right answer is now wrong or unsafe, or the structure panics.
        Broken = "broken",
        /// The right answer is missing now.
        Lost = "lost",
        /// Takes longer: proven to exceed the comparison's floor.
        Slower = "slower",
        /// Tests more nodes, items or planes, by more than the threshold.
        MoreWork = "more_work",
        /// Not the same question, or another answer: times of stored runs are not judged.
        Different = "different",
        /// No positive time on at least one side: not judged.
        #[default]
        Unmeasured = "unmeasured",
        /// Right in neither report: not judged.
        FailedInBoth = "failed_in_both",
        /// The answer was not right and is now.
        Gained = "gained",
        /// Neither a change nor its absence is proven.
        Inconclusive = "inconclusive",
        /// Takes less time: proven to exceed the floor.
        Faster = "faster",
        /// Tests fewer nodes, items or planes, by more than the threshold.
        LessWork = "less_work",
        /// A change of the threshold's size is ruled out.
        Same = "same",
    }
}

impl Outcome {
    /// Outcome from statuses alone; `None` if both are ok and times decide.
    pub fn of_statuses(old: Status, new: Status) -> Option<Outcome> {
        match (old == Status::Ok, new == Status::Ok) {
            (true, true) => None,
            (true, false) if new.is_failure() => Some(Outcome::Broken),
            (true, false) => Some(Outcome::Lost),
            (false, true) => Some(Outcome::Gained),
            // Never queried, so not a failure.
            (false, false) if old == Status::LeftOut && new == old => Some(Outcome::Unmeasured),
            (false, false) => Some(Outcome::FailedInBoth),
        }
    }

    /// Returns true if the statistics decided.
    pub fn is_judged(self) -> bool {
        Change::ALL.map(Outcome::from).contains(&self)
    }
}

impl From<Change> for Outcome {
    fn from(change: Change) -> Outcome {
        match change {
            Change::Slower => Outcome::Slower,
            Change::Faster => Outcome::Faster,
            Change::Same => Outcome::Same,
            Change::Inconclusive => Outcome::Inconclusive,
        }
    }
}

/// A cell of a comparison, for one metric or as a whole.
#[derive(Clone, Default, PartialEq, Debug, Serialize)]
pub struct JudgedRow {
    /// Slower, faster, same, or why there is no verdict.
    #[serde(rename = "verdict")]
    pub outcome: Outcome,
    /// The cell in both reports.
    #[serde(flatten)]
    pub cell: CellKey,
    /// `None` if the cell failed or was not the same query.
    pub metric: Option<&'static str>,
    /// The reported value on the old side, in the unit of the metric.
    pub old: Option<f64>,
    /// The reported value on the new side.
    pub new: Option<f64>,
    /// Change, interval and resolution; `None` if nothing was judged.
    pub judgement: Option<Judgement>,
    /// Processes with a time on each side; for pairs, the same number twice.
    pub processes: [usize; 2],
    /// Status of the cell in the old report.
    pub old_status: Status,
    /// Status of the cell in the new report.
    pub new_status: Status,
    /// Reason for the verdict, unless the figures show it.
    pub reason: Option<String>,
    /// Judged samples of pairs of processes: ln ns per query, old and new.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub pairs_ln_ns: Option<[Vec<f64>; 2]>,
}

impl JudgedRow {
    /// new / old, as judged, or of the work.
    pub fn ratio(&self) -> Option<f64> {
        let is_work = self.metric.is_some_and(|metric| WORK.contains(&metric));
        let values = self.old.zip(self.new).filter(|_| is_work);
        let judged = self.judgement.map(|found| found.ratio);
        judged.or(values.map(|(old, new)| new / old))
    }

    /// Returns true if the row is worth reading.
    ///
    /// Not unchanged, not a metric that neither side ever had, not the same failure as before.
    pub fn is_news(&self) -> bool {
        match self.outcome {
            Outcome::Same => false,
            Outcome::Unmeasured => self.old.is_some() || self.new.is_some(),
            Outcome::FailedInBoth => {
                self.new_status.is_failure() || self.old_status != self.new_status
            }
            _ => true,
        }
    }

    /// Worst first; among faster ones the one with the largest gain.
    pub fn order(&self, other: &JudgedRow) -> Ordering {
        let ratio = |row: &JudgedRow| row.ratio().unwrap_or(1.0);
        let by_ratio = match self.outcome {
            Outcome::Faster | Outcome::LessWork => ratio(self).total_cmp(&ratio(other)),
            _ => ratio(other).total_cmp(&ratio(self)),
        };
        self.outcome.cmp(&other.outcome).then(by_ratio)
    }
}

/// A counter that has changed.
#[derive(Clone, PartialEq, Debug, Serialize)]
pub struct WorkChange {
    /// The cell in both reports.
    #[serde(flatten)]
    pub cell: CellKey,
    /// Name of the metric, such as `items_tested`.
    pub counter: &'static str,
    /// Value in the old report.
    pub old: f64,
    /// Value in the new report.
    pub new: f64,
}

/// A cell that the other report does not have.
#[derive(Clone, PartialEq, Debug, Serialize)]
pub struct Unpaired {
    /// The cell in the report that has it.
    #[serde(flatten)]
    pub cell: CellKey,
    /// Its status.
    pub status: Status,
    /// Reason, unless the status is ok.
    pub reason: Option<String>,
}

/// Shift of all structures at once: the machine, or the program as a whole.
#[derive(Clone, PartialEq, Debug, Serialize)]
pub struct CommonShift {
    /// The only group concerned, relative to the others; `None` for all.
    pub group: Option<GroupKey>,
    /// Metric whose times are compared.
    pub metric: &'static str,
    /// new / old: above 1 is slower.
    pub ratio: f64,
    /// 95 % interval; `None` below three processes per side.
    pub lower: Option<f64>,
    /// Upper end of the interval.
    pub upper: Option<f64>,
    /// Number of cells it is computed from.
    pub cells: usize,
}

/// A comparison: every cell with its verdict, and further differences.
#[derive(Clone, Default, PartialEq, Debug, Serialize)]
pub struct Changes {
    /// Precision required for "same"; 0.05 is 5 %.
    pub threshold: f64,
    /// Cells that both reports have.
    pub cells_in_common: usize,
    /// Judged rows, worst first.
    pub rows: Vec<JudgedRow>,
    /// Differences of counters: exact, without a verdict.
    pub work_changed: Vec<WorkChange>,
    /// Cells that only the old report has.
    pub only_in_old: Vec<Unpaired>,
    /// Cells that only the new report has.
    pub only_in_new: Vec<Unpaired>,
    /// Shifts of each metric between two reports; empty for alternating programs.
    ///
    /// First that of all groups, then of each group proven to have moved relative to the others.
    pub common_shifts: Vec<CommonShift>,
}

impl Changes {
    /// Number of rows with this outcome.
    pub fn count(&self, outcome: Outcome) -> usize {
        let rows = self.rows.iter();
        rows.filter(|row| row.outcome == outcome).count()
    }

    /// The common shifts whose intervals lie beyond the threshold.
    pub fn proven_shifts(&self) -> Vec<&CommonShift> {
        let most = 1.0 + self.threshold;
        let is_faster = |upper: f64| upper * most < 1.0;
        let is_beyond = |s: &&CommonShift| s.lower > Some(most) || s.upper.is_some_and(is_faster);
        self.common_shifts.iter().filter(is_beyond).collect()
    }

    /// Returns true if NEW has a wrong answer, with or without a counterpart in OLD.
    pub fn is_wrong(&self) -> bool {
        let paired = self.rows.iter().map(|row| row.new_status);
        let alone = self.only_in_new.iter().map(|cell| cell.status);
        paired.chain(alone).any(Status::is_failure)
    }

    /// Returns true if a right answer takes longer or more work or is missing now.
    pub fn is_regression(&self) -> bool {
        let worse = [Outcome::Slower, Outcome::MoreWork, Outcome::Lost];
        self.rows.iter().any(|row| worse.contains(&row.outcome))
    }

    /// Returns true if no row could be judged, and nothing is wrong.
    pub fn judges_nothing(&self) -> bool {
        use Outcome::{Different, FailedInBoth, Unmeasured};
        let mut outcomes = self.rows.iter().map(|row| row.outcome);
        outcomes.all(|o| matches!(o, Different | Unmeasured | FailedInBoth)) && !self.is_wrong()
    }

    /// Number of further processes or pairs that would decide all inconclusive cells.
    ///
    /// The largest number that one of them needs, if known.
    pub fn more_pairs(&self) -> Option<usize> {
        let judged = self.rows.iter().filter_map(|row| row.judgement);
        judged.filter_map(|found| found.more_pairs).max()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::measure::METRICS;

    #[test]
    fn every_metric_and_counter_is_one_of_the_list() {
        for name in JUDGED_METRICS.iter().chain(COUNTERS).chain(WORK) {
            assert!(METRICS.iter().any(|info| info.name == *name), "{name}");
        }
    }

    #[test]
    fn outcomes_are_named_as_in_json_and_worst_first() {
        assert!(Outcome::ALL.is_sorted());
        for outcome in Outcome::ALL {
            assert_eq!(serde_json::to_value(outcome).unwrap(), outcome.name());
        }
        for change in [
            Change::Slower,
            Change::Faster,
            Change::Same,
            Change::Inconclusive,
        ] {
            assert_eq!(Outcome::from(change).name(), change.name());
            assert!(Outcome::from(change).is_judged());
        }
    }
}
