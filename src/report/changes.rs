//! One report compared with an older one. Every cell is judged by its times
//! relative to the other structures of its group, process by process: what moves
//! a whole process, and most of what tells two days apart, drops out.

use std::collections::BTreeMap;

use serde::Serialize;

use super::judging::{Changes, CommonShift, JudgedRow, Lone, Outcome, WORK, work_changes};
use super::ranking::{Pair, asked_otherwise, grouped, matched, timed_otherwise};
use super::{Report, ReportCell};
use crate::measure::{CellKey, GroupKey, Machine, Status, Toolchain};
use crate::shown::number;
use crate::statistics::{Judgement, judge_unpaired, median, trimmed_mean};

/// Fewer other structures cannot tell which of them moved: the median of three
/// stays where it is when one of them moves, that of two does not.
const LEAST_OTHERS: usize = 3;
/// Reason of a cell that has fewer others.
pub const FEW_OTHERS: &str = "under three other structures in both reports to compare with";
/// Fewer processes have no interval.
const LEAST_PROCESSES: usize = 3;

/// Compares a report with an older one by these metrics of
/// [`JUDGED_METRICS`](super::JUDGED_METRICS) or of [`WORK`]. `threshold` 0.05 is 5 %.
///
/// Per process, ln(time) of a structure minus the median of the other
/// structures that both reports have in the group, each about its mean in the
/// old report; old and new by [`judge_unpaired`], with Holm's correction over the cells of a metric. What
/// moved everything at once is [`Changes::common_shift`].
pub fn changes(old: &Report, new: &Report, threshold: f64, metrics: &[&'static str]) -> Changes {
    let matched = matched(&old.cells, &new.cells);
    let mut found = Changes {
        threshold,
        cells_in_common: matched.pairs.len(),
        only_in_old: matched.only_old.into_iter().map(lone).collect(),
        only_in_new: matched.only_new.into_iter().map(lone).collect(),
        ..Changes::default()
    };
    let mut comparable = Vec::new();
    for &pair in &matched.pairs {
        let is_asked_alike = asked_otherwise(pair).is_none();
        if is_asked_alike {
            let counts = |cell: &ReportCell| -> BTreeMap<String, f64> {
                let metrics = cell.metrics.iter();
                metrics.map(|(name, m)| (name.clone(), m.value)).collect()
            };
            let (was, is) = (counts(pair.0), counts(pair.1));
            found
                .work_changed
                .extend(work_changes(&pair.0.key(), &was, &is));
        }
        match as_a_whole(pair) {
            Some(row) => found.rows.push(row),
            None => comparable.push(pair),
        }
    }
    for &metric in metrics {
        found.rows.extend(match WORK.contains(&metric) {
            true => by_work(&comparable, metric, threshold),
            false => by_metric(&comparable, metric, threshold),
        });
    }
    if metrics.iter().any(|metric| !WORK.contains(metric)) {
        found.common_shift = common_shift(&comparable);
    }
    found.rows.sort_by(JudgedRow::order);
    found
}

fn lone(cell: &ReportCell) -> Lone {
    Lone {
        cell: cell.key(),
        status: cell.status,
        reason: cell.reason.clone(),
    }
}

/// Outcome of a pair by its statuses and questions alone; `None` if times decide.
fn as_a_whole(pair: Pair) -> Option<JudgedRow> {
    let (old, new) = pair;
    let by_status = JudgedRow::of_statuses(new.key(), &old.verdict(), &new.verdict());
    // Wrong is wrong, whatever the question was.
    let is_broken = by_status.as_ref().map(|row| row.outcome) == Some(Outcome::Broken);
    let different = |reason: String| JudgedRow {
        old_status: old.status,
        new_status: new.status,
        ..JudgedRow::unjudged(new.key(), Outcome::Different, Some(reason))
    };
    match asked_otherwise(pair) {
        Some(reason) if !is_broken => Some(different(reason)),
        _ if by_status.is_some() => by_status,
        _ => answered_otherwise(pair).map(different),
    }
}

/// Right answers to one question have the same length.
fn answered_otherwise((old, new): Pair) -> Option<String> {
    let counts = old.value("visible_count").zip(new.value("visible_count"));
    let (was, is) = counts.filter(|(was, is)| was != is)?;
    Some(format!("visible_count {} and {}", number(was), number(is)))
}

/// ln(time) in each process, old and new.
type Logs = [Vec<f64>; 2];

/// ln(time) about its mean in the old report: what is left is how the processes
/// differ, and how new differs from old. Medians over structures are taken of
/// this; a median of the times as they are is one structure's, and another's as
/// soon as one of them has moved past it.
fn centred(logs: &Logs) -> Logs {
    let old = &logs[0];
    let mean = trimmed_mean(old).map(|found| found.mean);
    let mean = mean.or_else(|| median(old)).unwrap_or_default();
    [0, 1].map(|side| logs[side].iter().map(|ln| ln - mean).collect())
}

/// Only what is above zero is a time.
fn is_sound(value: f64) -> bool {
    value.is_finite() && value > 0.0
}

fn logs((old, new): Pair, metric: &str) -> Option<Logs> {
    let of = |cell: &ReportCell| {
        // Nothing is slower or faster among no items.
        let has_items = cell.scene.total_count > 0;
        let times = cell.times.by_process.get(metric).filter(|_| has_items)?;
        let sound = !times.is_empty() && times.iter().all(|time| is_sound(*time));
        sound.then(|| times.iter().map(|time| time.ln()).collect::<Vec<f64>>())
    };
    Some([of(old)?, of(new)?])
}

/// A cell on its way to a verdict.
struct Candidate {
    key: CellKey,
    logs: Logs,
    centred: Logs,
}

/// The rows of one metric, in the order of the pairs.
fn by_metric(pairs: &[Pair], metric: &'static str, threshold: f64) -> Vec<JudgedRow> {
    let mut rows = Vec::new();
    let mut candidates: Vec<(usize, Candidate)> = Vec::new();
    let is_of_frames = ["frame_ns", "update_ns"].contains(&metric);
    let moves = |pair: &&Pair| !pair.1.path.motion.is_empty();
    for &pair in pairs.iter().filter(|pair| !is_of_frames || moves(pair)) {
        let value = |cell: &ReportCell| cell.value(metric);
        let values = (value(pair.0), value(pair.1));
        let sound = |value: Option<f64>| value.is_some_and(is_sound);
        let key = pair.1.key();
        let mut row = JudgedRow::by_times(key.clone(), metric, values, None, [0; 2]);
        match logs(pair, metric).filter(|_| sound(values.0) && sound(values.1)) {
            None => row.reason = Some(why_unmeasured(values)),
            Some(logs) => {
                row.processes = [logs[0].len(), logs[1].len()];
                // A build is not of cameras.
                match timed_otherwise(pair).filter(|_| metric != "build_ms") {
                    Some(reason) => {
                        (row.outcome, row.reason) = (Outcome::Different, Some(reason));
                    }
                    None => {
                        let centred = centred(&logs);
                        candidates.push((rows.len(), Candidate { key, logs, centred }));
                    }
                }
            }
        }
        rows.push(row);
    }
    let relative: Vec<Option<Logs>> = candidates
        .iter()
        .map(|(_, own)| relative(own, candidates.iter().map(|(_, other)| other)))
        .collect();
    let [was, is] = [0, 1].map(|side| -> Vec<Vec<f64>> {
        let known = relative.iter().flatten();
        known.map(|logs| logs[side].clone()).collect()
    });
    let with_others = candidates.iter().zip(&relative);
    let structures: Vec<&str> = with_others
        .filter(|(_, relative)| relative.is_some())
        .map(|((_, own), _)| own.key.structure.as_str())
        .collect();
    let mut judged = judge_unpaired(&was, &is, &structures, threshold).into_iter();
    for ((at, _), relative) in candidates.iter().zip(&relative) {
        let row = &mut rows[*at];
        let judgement = relative.as_ref().and_then(|_| judged.next().flatten());
        row.reason = why_inconclusive(relative.is_some(), row.processes);
        row.judgement = judgement.or_else(|| by_values(row));
        row.outcome = row
            .judgement
            .map_or(Outcome::Unmeasured, |j| j.change.into());
    }
    rows
}

/// The rows of one counter, in the order of the pairs.
fn by_work(pairs: &[Pair], counter: &'static str, threshold: f64) -> Vec<JudgedRow> {
    let rows = pairs.iter().map(|(old, new)| {
        let values = (old.value(counter), new.value(counter));
        let mut row = JudgedRow::by_work(new.key(), counter, values, threshold);
        if row.outcome == Outcome::Unmeasured {
            row.reason = Some(why_unmeasured(values));
        }
        row
    });
    rows.collect()
}

/// ln(time) less what moved the median of the others, process by process;
/// `None` with too few others.
fn relative<'c>(own: &Candidate, all: impl Iterator<Item = &'c Candidate>) -> Option<Logs> {
    let others = all.filter(|other| {
        let same = |side: usize| other.logs[side].len() == own.logs[side].len();
        let (key, own) = (&other.key, &own.key);
        key.group == own.group && key.structure != own.structure && same(0) && same(1)
    });
    let others: Vec<&Candidate> = others.collect();
    if others.len() < LEAST_OTHERS {
        return None;
    }
    let side = |side: usize| -> Vec<f64> {
        let own = own.logs[side].iter().enumerate();
        own.filter_map(|(process, ln)| {
            let others: Vec<f64> = others.iter().map(|o| o.centred[side][process]).collect();
            Some(ln - median(&others)?)
        })
        .collect()
    };
    Some([side(0), side(1)])
}

/// The quotient of the two values, which decides nothing.
fn by_values(row: &JudgedRow) -> Option<Judgement> {
    let ratio = Some(row.new? / row.old?).filter(|ratio| is_sound(*ratio))?;
    let pairs = row.processes[0].min(row.processes[1]);
    Some(Judgement::without_interval(ratio, pairs))
}

fn why_unmeasured(values: (Option<f64>, Option<f64>)) -> String {
    match values {
        (None, None) => "in neither report".to_owned(),
        (Some(_), None) => "only in OLD".to_owned(),
        (None, Some(_)) => "only in NEW".to_owned(),
        (Some(old), Some(new)) if is_sound(old) && is_sound(new) => {
            "no time of each process".to_owned()
        }
        (Some(old), Some(new)) => format!("{old} and {new} have no ratio"),
    }
}

fn why_inconclusive(has_others: bool, processes: [usize; 2]) -> Option<String> {
    if processes[0].min(processes[1]) < LEAST_PROCESSES {
        return Some("under three processes on a side".to_owned());
    }
    (!has_others).then(|| FEW_OTHERS.to_owned())
}

/// Per process, the mean over the groups of the median over the structures, by
/// the first metric; `None` without a cell that both have timed.
fn common_shift(pairs: &[Pair]) -> Option<CommonShift> {
    let timed = pairs.iter().filter_map(|&pair| {
        let is_ok = pair.0.status == Status::Ok && timed_otherwise(pair).is_none();
        let logs = logs(pair, super::JUDGED_METRICS[0]).filter(|_| is_ok)?;
        Some((pair.1.key().group, centred(&logs)))
    });
    let groups: Vec<(GroupKey, Vec<Logs>)> = grouped(timed);
    // What is not there in every process is paired with nothing.
    let all = || groups.iter().flat_map(|group| &group.1);
    let counts = [0, 1].map(|side| all().map(|logs| logs[side].len()).max().unwrap_or(0));
    let is_whole = |logs: &&Logs| [0, 1].iter().all(|&s| logs[s].len() == counts[s]);
    let whole: Vec<Vec<&Logs>> = groups
        .iter()
        .map(|group| group.1.iter().filter(is_whole).collect::<Vec<_>>())
        .filter(|cells| !cells.is_empty())
        .collect();
    let of = |side: usize| -> Vec<f64> {
        let process = |process: usize| -> f64 {
            let medians = whole.iter().filter_map(|cells| {
                let logs = cells.iter().map(|logs| logs[side][process]);
                median(&logs.collect::<Vec<f64>>())
            });
            medians.sum::<f64>() / whole.len() as f64
        };
        (0..counts[side]).map(process).collect()
    };
    let found = judge_unpaired(&[of(0)], &[of(1)], &["all"], 0.0)[0]?;
    Some(CommonShift {
        ratio: found.ratio,
        lower: found.lower,
        upper: found.upper,
        cells: whole.iter().map(Vec::len).sum(),
    })
}

#[cfg(test)]
mod tests;

/// A fact that differs.
#[derive(Clone, PartialEq, Eq, Debug, Serialize)]
pub struct Setting {
    /// "machine" or "toolchain"; between shards "program" or "plan" as well.
    pub of: &'static str,
    /// Name of the fact.
    pub what: &'static str,
    /// In the old report.
    pub old: String,
    /// In the new report.
    pub new: String,
    /// True if it is another machine: absolute times do not compare.
    pub is_machine: bool,
}

/// Whose, name, whether it tells two machines apart, and the fact itself.
pub(super) type Fact = (&'static str, &'static str, bool, String);

pub(super) fn known(fact: Option<&str>) -> String {
    fact.unwrap_or("unknown").to_owned()
}

pub(super) fn facts(machine: &Machine, tools: &Toolchain) -> Vec<Fact> {
    let (of_machine, of_tools) = ("machine", "toolchain");
    let (vectors, locked) = (machine.instruction_set.clone(), tools.lock_digest.clone());
    let known = |fact: &Option<String>| known(fact.as_deref());
    let caches = machine.caches.iter();
    let caches = caches.map(|cache| format!("L{} {} KiB", cache.level, cache.bytes >> 10));
    let caches = caches.collect::<Vec<_>>().join(" ");
    vec![
        (of_machine, "cpu", true, known(&machine.cpu)),
        (of_machine, "cores", true, machine.cores.to_string()),
        (of_machine, "caches", true, caches),
        (of_machine, "instruction set", true, vectors),
        (of_machine, "os kernel", false, known(&machine.kernel)),
        (of_tools, "rustc", false, known(&tools.rustc)),
        (of_tools, "target", false, known(&tools.target)),
        (of_tools, "flags", false, tools.flags.clone()),
        (of_tools, "profile", false, known(&tools.profile)),
        (of_tools, "opt-level", false, known(&tools.opt_level)),
        (of_tools, "features", false, tools.features.join(",")),
        (of_tools, "dependencies", false, locked),
    ]
}

/// Differing facts of two lists of the same names, in their order.
pub(super) fn differences(old: Vec<Fact>, new: Vec<Fact>) -> impl Iterator<Item = Setting> {
    let differing = old.into_iter().zip(new).filter(|(old, new)| old.3 != new.3);
    differing.map(|((of, what, is_machine, old), (.., new))| Setting {
        of,
        what,
        old,
        new,
        is_machine,
    })
}

/// Differing facts, in the order of the report.
pub fn settings(old: &Report, new: &Report) -> Vec<Setting> {
    let [old, new] = [old, new].map(|report| facts(&report.machine, &report.toolchain));
    differences(old, new).collect()
}
