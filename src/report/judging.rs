//! What became of one cell from one report to another: by its status, by
//! whether it was asked the same, and by a metric and the bar for it. It owns
//! the list of metrics that may judge; which cells belong together is `matching`'s.

use std::cmp::Ordering;

use serde::Serialize;

use super::matching::{CellName, Pair};
use super::{Report, ReportCell};
use crate::measure::Status;

/// A metric that two runs can be held against each other by: less is better.
#[derive(PartialEq, Debug)]
pub struct Tracked {
    pub name: &'static str,
    /// Counted and not timed: noise has no part in it.
    pub is_exact: bool,
}

const fn timed(name: &'static str) -> Tracked {
    Tracked {
        name,
        is_exact: false,
    }
}

/// All such metrics; the first is the one that structures are ranked by.
pub static TRACKED: &[Tracked] = &[
    timed("query_ns"),
    timed("query_ns_p95"),
    timed("query_ns_p99"),
    timed("query_wall_ns"),
    timed("ns_per_visible"),
    timed("times_read"),
    timed("times_memcpy"),
    timed("times_replay"),
    timed("build_ms"),
    timed("update_ms"),
    Tracked {
        name: "memory_bytes_per_item",
        is_exact: true,
    },
    timed("locate_ns"),
    timed("locate_batched_ns"),
];

impl Tracked {
    pub fn named(name: &str) -> Option<&'static Tracked> {
        TRACKED.iter().find(|metric| metric.name == name)
    }
}

/// What became of a cell, worst first.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Debug, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Outcome {
    /// Was right and is wrong, unsafe or panics.
    Broken,
    /// Was right and is not answered any more.
    Lost,
    Slower,
    /// Not asked the same question: not judged.
    Different,
    /// No sound figure on one side at least: not judged.
    Unmeasured,
    FailedInBoth,
    /// Was not right and is.
    Gained,
    Faster,
    Tie,
}

impl Outcome {
    pub const ALL: [Outcome; 9] = [
        Outcome::Broken,
        Outcome::Lost,
        Outcome::Slower,
        Outcome::Different,
        Outcome::Unmeasured,
        Outcome::FailedInBoth,
        Outcome::Gained,
        Outcome::Faster,
        Outcome::Tie,
    ];

    /// As JSON has it.
    pub fn name(self) -> &'static str {
        match self {
            Outcome::Broken => "broken",
            Outcome::Lost => "lost",
            Outcome::Slower => "slower",
            Outcome::Different => "different",
            Outcome::Unmeasured => "unmeasured",
            Outcome::FailedInBoth => "failed_in_both",
            Outcome::Gained => "gained",
            Outcome::Faster => "faster",
            Outcome::Tie => "tie",
        }
    }

    /// Both sides had a figure, and the ratio decided.
    pub fn is_judged(self) -> bool {
        matches!(self, Outcome::Slower | Outcome::Faster | Outcome::Tie)
    }
}

/// A metric's value in one report, with its 95 % interval where it has one.
#[derive(Clone, Copy, PartialEq, Debug, Serialize)]
pub struct Figure {
    pub value: f64,
    pub lower: Option<f64>,
    pub upper: Option<f64>,
}

fn figure(cell: &ReportCell, metric: &str) -> Option<Figure> {
    cell.metrics.get(metric).map(|found| Figure {
        value: found.value,
        lower: found.lower,
        upper: found.upper,
    })
}

/// Only what is above zero can be divided by, or be a time.
pub(super) fn is_sound(value: f64) -> bool {
    value.is_finite() && value > 0.0
}

/// From where on a difference counts.
#[derive(Clone, Copy, PartialEq, Debug, Serialize)]
pub struct Bar {
    pub metric: &'static str,
    /// Slower above 1 + bar, faster below 1 / (1 + bar).
    pub bar: f64,
    pub decided_by: Decider,
}

/// What was larger: the threshold, or what a run cannot tell apart.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Decider {
    Threshold,
    OldNoiseFloor,
    NewNoiseFloor,
}

impl Bar {
    pub(super) fn of(metric: &Tracked, threshold: f64, old: &Report, new: &Report) -> Bar {
        let mut bar = Bar {
            metric: metric.name,
            bar: threshold,
            decided_by: Decider::Threshold,
        };
        let floors = [(old, Decider::OldNoiseFloor), (new, Decider::NewNoiseFloor)];
        for (report, decider) in floors {
            let floor = report.noise.aa_floor.unwrap_or(0.0);
            if floor > bar.bar && !metric.is_exact {
                (bar.bar, bar.decided_by) = (floor, decider);
            }
        }
        bar
    }

    fn outcome(&self, ratio: f64) -> Outcome {
        let most = 1.0 + self.bar;
        match ratio {
            r if r > most => Outcome::Slower,
            r if r < 1.0 / most => Outcome::Faster,
            _ => Outcome::Tie,
        }
    }
}

/// What became of one cell by one metric, or of the cell as a whole.
#[derive(Clone, PartialEq, Debug, Serialize)]
pub struct Change<'r> {
    #[serde(rename = "status")]
    pub outcome: Outcome,
    #[serde(flatten)]
    pub cell: CellName<'r>,
    /// None where no metric was looked at.
    pub metric: Option<&'static str>,
    /// new / old: above 1 is slower.
    pub ratio: Option<f64>,
    pub old: Option<Figure>,
    pub new: Option<Figure>,
    pub bar: Option<f64>,
    pub old_status: Status,
    pub new_status: Status,
    pub reason: Option<String>,
}

impl<'r> Change<'r> {
    /// Of the cell as a whole.
    fn of_cell((old, new): Pair<'r>, outcome: Outcome, reason: Option<String>) -> Change<'r> {
        Change {
            outcome,
            cell: CellName::of(new),
            metric: None,
            ratio: None,
            old: None,
            new: None,
            bar: None,
            old_status: old.status,
            new_status: new.status,
            reason,
        }
    }

    pub(super) fn by_metric(pair: Pair<'r>, bar: &Bar) -> Change<'r> {
        let (old, new) = (figure(pair.0, bar.metric), figure(pair.1, bar.metric));
        let ratio = match (old, new) {
            (Some(old), Some(new)) if is_sound(old.value) && is_sound(new.value) => {
                Some(new.value / old.value).filter(|ratio| is_sound(*ratio))
            }
            _ => None,
        };
        let reason = match (ratio, old, new) {
            (Some(_), ..) => None,
            (None, None, None) => Some("in neither report".to_owned()),
            (None, Some(_), None) => Some("only in OLD".to_owned()),
            (None, None, Some(_)) => Some("only in NEW".to_owned()),
            (None, Some(old), Some(new)) => {
                Some(format!("{} and {} have no ratio", old.value, new.value))
            }
        };
        let outcome = ratio.map_or(Outcome::Unmeasured, |ratio| bar.outcome(ratio));
        Change {
            metric: Some(bar.metric),
            ratio,
            old,
            new,
            bar: Some(bar.bar),
            ..Change::of_cell(pair, outcome, reason)
        }
    }

    /// Whether somebody who asks for changes wants to see it: no tie, no metric
    /// that neither side ever had, no refusal as before.
    pub fn is_news(&self) -> bool {
        match self.outcome {
            Outcome::Tie => false,
            Outcome::Unmeasured => self.old.is_some() || self.new.is_some(),
            Outcome::FailedInBoth => {
                self.new_status.is_failure() || self.old_status != self.new_status
            }
            _ => true,
        }
    }

    /// Worst first; among the faster ones the one that gained most.
    pub(super) fn order(&self, other: &Change) -> Ordering {
        let ratio = |change: &Change| change.ratio.unwrap_or(1.0);
        let by_ratio = match self.outcome {
            Outcome::Faster => ratio(self).total_cmp(&ratio(other)),
            _ => ratio(other).total_cmp(&ratio(self)),
        };
        self.outcome.cmp(&other.outcome).then(by_ratio)
    }
}

/// Why the two answers do not belong to one question, if they do not.
pub(super) fn asked_otherwise((old, new): Pair) -> Option<String> {
    let digests = |what: &str, old: &str, new: &str| {
        let short = |digest: &str| digest.chars().take(8).collect::<String>();
        (old != new).then(|| format!("{what}: digest {} and {}", short(old), short(new)))
    };
    if let Some(reason) = digests("other items", &old.scene.digest, &new.scene.digest) {
        return Some(reason);
    }
    let cameras = (old.path.camera_count, new.path.camera_count);
    if cameras.0 != cameras.1 {
        return Some(format!("{} cameras and {}", cameras.0, cameras.1));
    }
    // Older reports do not know theirs.
    let (was, is) = (old.path.digest.as_ref(), new.path.digest.as_ref());
    was.zip(is)
        .and_then(|(was, is)| digests("other cameras", was, is))
}

/// As many items a query, where both say so: right answers to one question
/// have the same length.
fn answered_otherwise((old, new): Pair) -> Option<String> {
    let counts = old.value("visible_count").zip(new.value("visible_count"));
    let (was, is) = counts.filter(|(was, is)| was != is)?;
    Some(format!("visible_count {was} and {is}"))
}

/// What became of a pair by its statuses and questions alone; none if it is
/// to be judged by its figures.
pub(super) fn as_a_whole(pair: Pair<'_>) -> Option<Change<'_>> {
    let (old, new) = pair;
    let (was_ok, is_ok) = (old.status == Status::Ok, new.status == Status::Ok);
    let of_cell = |outcome, reason| Some(Change::of_cell(pair, outcome, reason));
    // Wrong is wrong, whatever was asked.
    if was_ok && new.status.is_failure() {
        return of_cell(Outcome::Broken, new.reason.clone());
    }
    if let Some(reason) = asked_otherwise(pair) {
        return of_cell(Outcome::Different, Some(reason));
    }
    match (was_ok, is_ok) {
        (true, false) => of_cell(Outcome::Lost, new.reason.clone()),
        (false, true) => of_cell(Outcome::Gained, old.reason.clone()),
        (false, false) => of_cell(Outcome::FailedInBoth, new.reason.clone()),
        (true, true) => {
            let reason = answered_otherwise(pair)?;
            of_cell(Outcome::Different, Some(reason))
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::measure::METRICS;

    #[test]
    fn every_tracked_metric_is_one_of_the_list() {
        for metric in TRACKED {
            let known = METRICS.iter().any(|info| info.name == metric.name);
            assert!(known, "{}", metric.name);
            assert_eq!(Tracked::named(metric.name), Some(metric));
        }
    }

    #[test]
    fn outcomes_are_named_as_in_json_and_worst_first() {
        assert!(Outcome::ALL.is_sorted());
        for outcome in Outcome::ALL {
            assert_eq!(serde_json::to_value(outcome).unwrap(), outcome.name());
        }
    }
}
