//! Cells compared with older ones: of two alternating programs, or two reports.
//!
//! Programs are judged pair by pair. A report's cell is judged by its times relative to the other
//! structures of its group, process by process: shifts of a whole process, and most differences
//! between two days, cancel.

use std::{fmt, slice};

use serde::Serialize;

use super::judging::{
    COUNTERS, Changes, CommonShift, JudgedRow, Outcome, Unpaired, WORK, WorkChange,
};
use super::ranking::{
    Pair, answer_difference, grouped, matched, query_difference, work_difference,
};
use super::{Report, ReportCell};
use crate::measure::{GroupKey, Machine, Status, Toolchain};
use crate::statistics::{Change, Judgement, judge, judge_unpaired, median, trimmed_mean};

/// Fewest other structures that show which of them moved.
///
/// The median of three is unchanged if one of them moves, that of two is not.
const LEAST_OTHERS: usize = 3;
/// Reason of a cell with fewer others.
pub const FEW_OTHERS: &str = "under three other structures with as many processes in both reports";
/// Fewest processes that give an interval.
const LEAST_PROCESSES: usize = 3;

/// Source of the times of both sides.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum Basis {
    /// Two stored reports.
    ///
    /// Per process, ln(time) of a structure minus the median of an odd number of the other
    /// structures that both reports have in the group, each about its mean in the old report; old
    /// and new are compared by an unpaired test. Shifts of everything at once are
    /// [`Changes::common_shifts`].
    Reports,
    /// Alternating pairs of processes: times as they are, by a paired test.
    Pairs,
}

/// Compares cells with older ones by some metrics.
///
/// The metrics are of [`JUDGED_METRICS`](super::JUDGED_METRICS) or are work counters, with Holm's
/// correction over the cells of a metric. `threshold` 0.05 is 5 %.
pub fn changes(
    basis: Basis,
    [old, new]: [&[ReportCell]; 2],
    threshold: f64,
    metrics: &[&'static str],
) -> Changes {
    let (pairs, alone) = matched(old, new);
    let [only_in_old, only_in_new] = alone.map(|cells| cells.into_iter().map(lone).collect());
    let mut found = Changes {
        threshold,
        cells_in_common: pairs.len(),
        only_in_old,
        only_in_new,
        ..Changes::default()
    };
    let (mut counted, mut timed) = (Vec::new(), Vec::new());
    for pair in pairs {
        if query_difference(pair).is_none() {
            found.work_changed.extend(work_changes(pair));
        }
        if let Some(row) = as_a_whole(pair) {
            found.rows.push(row);
            continue;
        }
        counted.push(pair);
        let different = answer_difference(pair);
        // Two programs may round planes differently.
        if basis == Basis::Pairs || different.is_none() {
            timed.push(pair);
        }
        let different = different.map(|why| row(pair, Outcome::Different, Some(why)));
        found.rows.extend(different);
    }
    for &metric in metrics {
        let is_work = WORK.contains(&metric);
        let own = of_metric(if is_work { &counted } else { &timed }, metric);
        found.rows.extend(match is_work {
            true => by_work(&own, metric, threshold),
            false => by_metric(basis, &own, metric, threshold),
        });
        if basis == Basis::Reports {
            let shifts = common_shifts(&own, metric, threshold);
            found.common_shifts.extend(shifts);
        }
    }
    found.rows.sort_by(JudgedRow::order);
    found
}

/// The counters that differ, among those that both sides have.
fn work_changes((old, new): Pair) -> impl Iterator<Item = WorkChange> {
    COUNTERS.iter().filter_map(move |&counter| {
        let (was, is) = (old.value(counter)?, new.value(counter)?);
        (was != is).then(|| WorkChange {
            cell: new.key(),
            counter,
            old: was,
            new: is,
        })
    })
}

fn lone(cell: &ReportCell) -> Unpaired {
    Unpaired {
        cell: cell.key(),
        status: cell.status,
        reason: cell.reason.clone(),
    }
}

/// A pair without figures.
fn row((old, new): Pair, outcome: Outcome, reason: Option<String>) -> JudgedRow {
    JudgedRow {
        outcome,
        cell: new.key(),
        old_status: old.status,
        new_status: new.status,
        reason,
        ..JudgedRow::default()
    }
}

/// Outcome of a pair by its statuses and questions alone; `None` if figures decide.
fn as_a_whole(pair: Pair) -> Option<JudgedRow> {
    let (old, new) = pair;
    let by_status = Outcome::of_statuses(old.status, new.status);
    // Wrong is wrong, whatever the question was.
    if by_status != Some(Outcome::Broken)
        && let Some(reason) = query_difference(pair)
    {
        return Some(row(pair, Outcome::Different, Some(reason)));
    }
    let outcome = by_status?;
    let of = if outcome == Outcome::Gained { old } else { new };
    Some(row(pair, outcome, of.reason.clone()))
}

/// A pair with both values of a metric, not yet judged.
fn valued(pair: Pair, metric: &'static str) -> JudgedRow {
    let mut row = row(pair, Outcome::Unmeasured, None);
    row.metric = Some(metric);
    (row.old, row.new) = (pair.0.value(metric), pair.1.value(metric));
    row
}

/// ln(time) in each process, old and new.
type Logs = [Vec<f64>; 2];

/// ln(time) about its mean in the old report.
///
/// It shows how the processes differ, and how new differs from old. Medians over structures are
/// taken of these: a median of plain times is that of one structure, and jumps to another one's as
/// soon as this moves past it.
fn centred(logs: &Logs) -> Logs {
    let old = mean(&logs[0]);
    [0, 1].map(|side| logs[side].iter().map(|ln| ln - old).collect())
}

fn mean(logs: &[f64]) -> f64 {
    let mean = trimmed_mean(logs).map(|found| found.mean);
    mean.or_else(|| median(logs)).unwrap_or_default()
}

/// Only positive values are times.
fn is_sound(value: f64) -> bool {
    value.is_finite() && value > 0.0
}

fn logs((old, new): Pair, metric: &str) -> Option<Logs> {
    let of = |cell: &ReportCell| {
        let logs = cell.ln_ns(metric);
        let is_sound = !logs.is_empty() && logs.iter().all(|ln| ln.is_finite());
        // Without items no structure is slower or faster.
        (is_sound && cell.scene.total_count > 0).then_some(logs)
    };
    Some([of(old)?, of(new)?])
}

/// A cell to be judged: its row and its times.
type Candidate<'r> = (&'r mut JudgedRow, Logs);

/// The pairs with independent figures.
///
/// Only motions have frames, and all paths of a scene share one build.
fn of_metric<'r>(pairs: &[Pair<'r>], metric: &str) -> Vec<Pair<'r>> {
    let all = pairs.iter().copied();
    let times = |cell: &'r ReportCell| cell.times.by_process.get(metric);
    match metric {
        "frame_ns" | "update_ns" => all.filter(|(_, new)| !new.path.motion.is_empty()).collect(),
        "build_ms" => {
            let of =
                |(old, new): Pair<'r>| (&new.scene.name, &new.structure, times(old), times(new));
            let builds = grouped(all.map(|pair| (of(pair), pair)));
            builds.iter().map(|(_, same)| same[0]).collect()
        }
        _ => all.collect(),
    }
}

/// The rows of one metric, in the order of the pairs.
fn by_metric(basis: Basis, pairs: &[Pair], metric: &'static str, threshold: f64) -> Vec<JudgedRow> {
    let (mut rows, mut timed) = (Vec::new(), Vec::new());
    for &pair in pairs {
        let sound = |value: Option<f64>| value.is_some_and(is_sound);
        let mut row = valued(pair, metric);
        let mut own = logs(pair, metric).filter(|_| sound(row.old) && sound(row.new));
        match &own {
            None => row.reason = Some(why_unmeasured(row.old, row.new)),
            Some(logs) => row.processes = logs.each_ref().map(Vec::len),
        }
        // A build does not depend on cameras.
        let differs = work_difference(pair).filter(|_| own.is_some() && metric != "build_ms");
        if let Some(reason) = differs {
            (row.outcome, row.reason, own) = (Outcome::Different, Some(reason), None);
        }
        rows.push(row);
        timed.push(own);
    }
    let timed = rows.iter_mut().zip(timed);
    let timed = timed.filter_map(|(row, logs)| Some((row, logs?)));
    match basis {
        Basis::Reports => judge_reports(timed.collect(), threshold),
        Basis::Pairs => judge_pairs(timed.collect(), threshold),
    }
    rows
}

fn judge_reports(timed: Vec<Candidate>, threshold: f64) {
    let centred: Vec<Logs> = timed.iter().map(|(_, logs)| centred(logs)).collect();
    let relative = (0..timed.len()).map(|own| relative(own, &timed, &centred));
    let (was, is): (Vec<_>, Vec<_>) = relative.map(<(_, _)>::from).unzip();
    let cells = timed.iter().map(|(row, _)| &row.cell);
    let names = cells.map(|cell| (cell.structure.as_str(), cell.group.id()));
    let judged = judge_unpaired(&was, &is, &names.collect::<Vec<_>>(), threshold);
    for ((row, _), judgement) in timed.into_iter().zip(judged) {
        row.reason = why_inconclusive(judgement.is_some(), row.processes);
        conclude(row, judgement);
    }
}

/// Judges pairs: the old time as it is, the new one from the ratio of the pairs.
///
/// Too few pairs give a ratio without a verdict.
fn judge_pairs(timed: Vec<Candidate>, threshold: f64) {
    let differences = timed.iter().map(|(_, [old, new])| -> Vec<f64> {
        old.iter().zip(new).map(|(old, new)| new - old).collect()
    });
    let judged = judge(&differences.collect::<Vec<_>>(), threshold);
    for ((row, logs), judgement) in timed.into_iter().zip(judged) {
        let ratio = judgement.map(|found| found.ratio);
        row.old = trimmed_mean(&logs[0]).map(|old| old.mean.exp()).or(row.old);
        let new = row.old.zip(ratio).map(|(old, ratio)| old * ratio);
        row.new = new.or(row.new);
        row.reason = why_inconclusive(true, row.processes);
        row.pairs_ln_ns = Some(logs);
        let pairs = row.processes[0].min(row.processes[1]);
        let plain = || Some(Judgement::without_interval(row.new? / row.old?, pairs));
        let judgement = judgement.or_else(plain);
        conclude(row, judgement);
    }
}

fn conclude(row: &mut JudgedRow, judgement: Option<Judgement>) {
    row.judgement = judgement;
    let change = judgement.map(|found| found.change.into());
    row.outcome = change.unwrap_or(Outcome::Inconclusive);
}

/// The rows of one counter, which is exact, if a side has it.
///
/// Growth by more than `threshold` is more work.
fn by_work(pairs: &[Pair], counter: &'static str, threshold: f64) -> Vec<JudgedRow> {
    let most = 1.0 + threshold;
    let rows = pairs.iter().map(|&pair| valued(pair, counter));
    let rows = rows.filter(|row| row.old.or(row.new).is_some());
    let rows = rows.map(|mut row| {
        (row.outcome, row.reason) = match (row.old, row.new) {
            (Some(old), Some(new)) if new > old * most => (Outcome::MoreWork, None),
            (Some(old), Some(new)) if old > new * most => (Outcome::LessWork, None),
            (Some(_), Some(_)) => (Outcome::Same, None),
            (old, new) => (Outcome::Unmeasured, Some(why_unmeasured(old, new))),
        };
        row
    });
    rows.collect()
}

/// ln(time) minus the shift of the others' median, process by process.
///
/// Empty with too few others. If the number of others is even, the one that moved farthest from the
/// median of all is dropped: the median of four moves with two of them, but of the remaining three
/// only one has moved.
fn relative(own: usize, timed: &[Candidate], centred: &[Logs]) -> Logs {
    let (row, logs) = &timed[own];
    let others = timed.iter().zip(centred).filter(|((other, _), _)| {
        let (key, own) = (&other.cell, &row.cell);
        key.group == own.group && key.structure != own.structure && other.processes == row.processes
    });
    let mut others: Vec<&Logs> = others.map(|(_, centred)| centred).collect();
    if others.len() < LEAST_OTHERS {
        return Logs::default();
    }
    if others.len().is_multiple_of(2) {
        let moved = |logs: &Logs| median(&logs[1]).unwrap_or_default();
        let all = others.iter().copied().chain([&centred[own]]);
        let middle = median(&all.map(moved).collect::<Vec<_>>()).unwrap_or_default();
        let far = |logs: &Logs| (moved(logs) - middle).abs();
        others.sort_by(|a, b| far(a).total_cmp(&far(b)));
        others.pop();
    }
    let side = |side: usize| -> Vec<f64> {
        let relative = logs[side].iter().enumerate().filter_map(|(process, ln)| {
            let others: Vec<f64> = others.iter().map(|o| o[side][process]).collect();
            Some(ln - median(&others)?)
        });
        relative.collect()
    };
    [0, 1].map(side)
}

fn why_unmeasured(old: Option<f64>, new: Option<f64>) -> String {
    match (old, new) {
        (None, None) => "on neither side".to_owned(),
        (Some(_), None) => "only in OLD".to_owned(),
        (None, Some(_)) => "only in NEW".to_owned(),
        (Some(old), Some(new)) if is_sound(old) && is_sound(new) => {
            "no time of each process".to_owned()
        }
        (Some(old), Some(new)) => format!("{old} and {new} have no ratio"),
    }
}

fn why_inconclusive(has_others: bool, processes: [usize; 2]) -> Option<String> {
    let is_short = processes[0].min(processes[1]) < LEAST_PROCESSES;
    let few = is_short.then_some("under three processes on a side");
    let whys = few.into_iter().chain((!has_others).then_some(FEW_OTHERS));
    let whys: Vec<&str> = whys.collect();
    (!whys.is_empty()).then(|| whys.join(", "))
}

/// Medians over the groups of their medians over the structures.
///
/// Then the groups that moved relative to it. Empty without a cell that both have timed.
fn common_shifts(pairs: &[Pair], metric: &'static str, threshold: f64) -> Vec<CommonShift> {
    let timed = pairs.iter().filter_map(|&pair| {
        let is_ok = pair.0.status == Status::Ok && work_difference(pair).is_none();
        let logs = logs(pair, metric).filter(|_| is_ok)?;
        Some((pair.1.key().group, centred(&logs)))
    });
    let groups: Vec<(GroupKey, Vec<Logs>)> = grouped(timed);
    // A cell that is missing in a process cannot be paired.
    let all = || groups.iter().flat_map(|group| &group.1);
    let counts = [0, 1].map(|side| all().map(|logs| logs[side].len()).max().unwrap_or(0));
    let is_whole = |logs: &&Logs| [0, 1].iter().all(|&s| logs[s].len() == counts[s]);
    let whole = groups.iter();
    let whole = whole.map(|(key, cells)| (key, Vec::from_iter(cells.iter().filter(is_whole))));
    let whole: Vec<(&GroupKey, Vec<&Logs>)> = whole.filter(|group| !group.1.is_empty()).collect();
    // Means and what processes add to them apart: once some have moved, the median of all in a
    // process is an upper or lower one of the others.
    let middle = |cells: &[&Logs]| {
        [0, 1].map(|side| {
            let means = Vec::from_iter(cells.iter().map(|c| mean(&c[side])));
            let shift = median(&means).unwrap_or_default();
            let process = |process| {
                let own = cells.iter().zip(&means);
                let own = own.map(|(c, mean)| c[side][process] - mean);
                Some(shift + median(&Vec::from_iter(own))?)
            };
            (0..counts[side]).filter_map(process).collect()
        })
    };
    let own: Vec<Logs> = whole.iter().map(|(_, cells)| middle(cells)).collect();
    let common: Logs = middle(&Vec::from_iter(&own));
    let judged = |shifts: &[Logs], threshold| {
        let [was, is] = [0, 1].map(|side| Vec::from_iter(shifts.iter().map(|s| s[side].clone())));
        judge_unpaired(&was, &is, &vec![((), ()); shifts.len()], threshold)
    };
    let shift = |group: Option<&GroupKey>, found: Judgement, cells| CommonShift {
        group: group.cloned(),
        metric,
        ratio: found.ratio,
        lower: found.lower,
        upper: found.upper,
        cells,
    };
    let cells = whole.iter().map(|group| group.1.len()).sum();
    let of_all = judged(slice::from_ref(&common), 0.0)[0];
    let as_a_whole = of_all.map(|found| shift(None, found, cells));
    let relative = own.iter().map(|own| {
        [0, 1].map(|side| {
            let both = own[side].iter().zip(&common[side]);
            both.map(|(own, all)| own - all).collect()
        })
    });
    // The median of two moves with either.
    let relative = relative.filter(|_| whole.len() >= LEAST_OTHERS);
    let judged = judged(&relative.collect::<Vec<_>>(), threshold);
    let moved = whole.iter().zip(judged);
    let moved = moved.filter_map(|((group, cells), found)| {
        let found = found.filter(|f| matches!(f.change, Change::Slower | Change::Faster))?;
        Some(shift(Some(group), found, cells.len())).filter(|_| cells.len() >= LEAST_OTHERS)
    });
    as_a_whole.into_iter().chain(moved).collect()
}

#[cfg(test)]
mod tests;

/// A fact that differs.
#[derive(Clone, PartialEq, Eq, Debug, Serialize)]
pub struct Setting {
    /// "machine", "toolchain" or "run"; between shards also "program" or "plan".
    pub of: &'static str,
    /// Name of the fact.
    pub what: &'static str,
    /// Value in the old report.
    pub old: String,
    /// Value in the new report.
    pub new: String,
    /// True if it shows another machine: absolute times are not comparable.
    pub is_machine: bool,
}

impl fmt::Display for Setting {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let (of, what, old, new) = (self.of, self.what, &self.old, &self.new);
        write!(f, "{of} differs: {what} '{old}' and '{new}'")
    }
}

/// Owner, name, whether it distinguishes two machines, and the value.
pub(super) type Fact = (&'static str, &'static str, bool, String);

pub(super) fn known(fact: &Option<String>) -> String {
    fact.as_deref().unwrap_or("unknown").to_owned()
}

pub(super) fn facts(machine: &Machine, tools: &Toolchain) -> Vec<Fact> {
    let (of_machine, of_tools) = ("machine", "toolchain");
    let (vectors, locked) = (machine.instruction_set.clone(), tools.lock_digest.clone());
    let caches = machine.caches.iter();
    let caches = caches.map(|cache| format!("L{} {} KiB", cache.level, cache.bytes >> 10));
    let caches = caches.collect::<Vec<_>>().join(" ");
    vec![
        (of_machine, "cpu", true, known(&machine.cpu)),
        (of_machine, "cores", true, machine.cores.to_string()),
        (of_machine, "caches", true, caches),
        ("run", "instruction set", false, vectors),
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

/// Differing facts of two lists with the same names, in their order.
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

/// Differing facts of two programs on this machine.
pub fn built_differently(old: &Toolchain, new: &Toolchain) -> Vec<Setting> {
    let machine = Machine::capture();
    differences(facts(&machine, old), facts(&machine, new)).collect()
}

/// Differing facts, in the order of the report.
pub fn settings(old: &Report, new: &Report) -> Vec<Setting> {
    let [old, new] = [old, new].map(|report| {
        let threads = ("run", "threads", false, report.run.threads.to_string());
        [facts(&report.machine, &report.toolchain), vec![threads]].concat()
    });
    differences(old, new).collect()
}
