//! The table of verdicts of a comparison, of two reports or of two programs.
//!
//! For a terminal, as Markdown or as JSON; the verdicts come from `report` and `statistics`.

use std::io::{self, Write};

use serde_json::{Value, json};

use super::command_args::{CompareArgs, Gate};
use super::document::{Block, Table, folded, to_markdown, to_terminal};
use super::run_table::{distinct, name, place, question, short, short_structure};
use super::shared_args::TableFormat;
use super::{Ending, print_json, program, text};
use crate::measure::{GroupKey, METRICS};
use crate::report::{
    Basis, Changes, CommonShift, FEW_OTHERS, JudgedRow, Outcome, Setting, Unpaired, WORK,
    WorkChange, grouped, unique,
};
use crate::statistics::{Change, Judgement, median};

/// Most counters that are listed without `--all`.
const LISTED: usize = 20;

/// Most further processes of a run that are worth suggesting.
const MOST_MORE: usize = 100;

/// OLD or NEW.
pub struct Side {
    pub line: String,
    pub json: Value,
}

/// A comparison with its notes.
pub struct CompareTable<'a> {
    pub args: &'a CompareArgs,
    pub old: Side,
    pub new: Side,
    pub basis: Basis,
    /// "14 pairs × 100 rounds × 128 cameras", "10 vs 10 processes".
    pub head: String,
    /// Lines before the figures.
    pub notes: Vec<String>,
    pub settings: Vec<Setting>,
    pub changes: Changes,
}

impl CompareTable<'_> {
    /// 1 for a wrong answer, else 3 for a regression; and its name in JSON.
    pub fn verdict(&self) -> (Ending, &'static str) {
        let open = [Outcome::Inconclusive, Outcome::Different];
        let is_undecided = open.iter().any(|open| self.changes.count(*open) > 0)
            || !self.changes.proven_shifts().is_empty();
        match (self.changes.is_wrong(), self.changes.is_regression()) {
            (true, _) => (Ending::WrongAnswer, "wrong_answer"),
            (false, true) => (Ending::Regression, "regression"),
            _ if self.args.fail_inconclusive && is_undecided => {
                (Ending::Regression, "inconclusive")
            }
            (false, false) => {
                let outcomes = self.changes.rows.iter().map(|row| row.outcome);
                let mut judged = outcomes.filter(|outcome| outcome.is_judged()).peekable();
                let is_open = judged.peek().is_some() && judged.all(|o| o == Outcome::Inconclusive);
                let name = if is_open { "nothing_was_decided" } else { "ok" };
                (Ending::Ok, name)
            }
        }
    }

    /// The verdict, the counts and the worst cell, in a sentence.
    fn summary(&self) -> String {
        let verdict = match self.verdict().1 {
            "ok" => "no regression".to_owned(),
            other => other.replace('_', " "),
        };
        let shifts = self.changes.proven_shifts();
        let shift = text::some(shifts.first(), |_| {
            // Only the shift may be undecided.
            let is_open = verdict == "inconclusive";
            let among = match is_open && self.changes.count(Outcome::Inconclusive) == 0 {
                true => ";",
                false => " among the structures;",
            };
            let of = |(n, shift): (usize, &&CommonShift)| {
                let of = match &shift.group {
                    Some(group) => format!("of {}", place(group, usize::MAX, text::plain)),
                    None => "as a whole".to_owned(),
                };
                let changed = ["", " changed"][usize::from(n == 0)];
                let change = change_of(shift.ratio, None);
                format!("{} {of}{changed} by {change}", shift.metric)
            };
            let all: Vec<String> = shifts.iter().enumerate().map(of).collect();
            let all = all.join(" and ");
            format!("{among} {all}, which is not judged here (use compare --against)")
        });
        let worst = self.changes.rows.first();
        let worst = worst.filter(|_| self.verdict().0 != Ending::Ok);
        let worst = worst.filter(|row| row.outcome < Outcome::Different);
        let worst = text::some(worst, |row| {
            let ratio = row.ratio().filter(|ratio| ratio.is_finite());
            let change = text::some(row.metric.zip(ratio), |(metric, ratio)| {
                format!(": {metric} {}", change_of(ratio, None))
            });
            format!("; worst: {}{change}", name(&row.cell))
        });
        format!("{verdict}{shift}: {}{worst}", self.counts_line())
    }

    /// Prints the comparison in the chosen format.
    pub fn print(&self) -> io::Result<()> {
        let args = self.args;
        let text = match (args.markdown, args.format) {
            (true, _) => {
                let line = format!("{}: {}", program::name(), self.summary());
                folded(&line, &to_markdown(&self.blocks(args.all, None)))
            }
            (false, TableFormat::Table) => {
                let width = text::width();
                to_terminal(&self.blocks(args.all, Some(width)), width)
            }
            (false, TableFormat::Json) => return self.json(),
        };
        io::stdout().lock().write_all(text.as_bytes())
    }

    fn json(&self) -> io::Result<()> {
        let mut document = serde_json::to_value(&self.changes)?;
        document["old"] = self.old.json.clone();
        document["new"] = self.new.json.clone();
        document["verdict"] = json!(self.verdict().1);
        document["gate"] = json!(self.args.gate);
        for outcome in Outcome::ALL {
            document["counts"][outcome.name()] = json!(self.changes.count(outcome));
        }
        document["head"] = json!(self.head());
        document["notes"] = json!(self.notes);
        document["settings"] = json!(self.settings);
        document["advice"] = json!(self.advice());
        print_json(&document)
    }

    /// The change that half of the cells would show, for the line on the threshold.
    fn resolves(&self) -> String {
        let judged = self.changes.rows.iter().filter_map(|row| row.judgement);
        let found: Vec<f64> = judged.filter_map(|found| found.resolution).collect();
        text::some(median(&found), |share| {
            let percent = text::significant(share * 100.0);
            format!("; finds changes from about {percent} %")
        })
    }

    fn head(&self) -> &str {
        match self.args.gate {
            Gate::Time => &self.head,
            Gate::Work => "nodes, items and planes tested per query, bounds per region search",
        }
    }

    /// The document for Markdown, or for a terminal with `room` for a table.
    pub fn blocks(&self, all: bool, room: Option<usize>) -> Vec<Block> {
        let changes = &self.changes;
        let (head, threshold) = (self.head(), text::significant(changes.threshold * 100.0));
        let mut lines = vec![
            format!("OLD  {}", self.old.line),
            format!("NEW  {}", self.new.line),
            format!("{head}, threshold {threshold} %{}", self.resolves()),
        ];
        lines.extend(self.notes.iter().map(|note| format!("note: {note}")));
        lines.extend(changes.common_shifts.iter().map(shift_line));
        let mut blocks: Vec<Block> = lines.drain(..).map(Block::Line).collect();
        let shown = changes.rows.iter().filter(|row| all || row.is_news());
        let rows: Vec<&JudgedRow> = shown.collect();
        if !rows.is_empty() {
            blocks.push(Block::Table(self.table(&rows, room)));
            if room.is_some() {
                blocks.push(Block::Line(String::new()));
                blocks.extend(reasons(&rows).into_iter().map(Block::Line));
            }
        }
        let listed = if all { usize::MAX } else { LISTED };
        let most = 1.0 + changes.threshold;
        let is_listed = |work: &&WorkChange| {
            // Counters of the gate have rows.
            let is_beyond = work.new > work.old * most || work.old > work.new * most;
            all || self.args.gate == Gate::Time || (is_beyond && !WORK.contains(&work.counter))
        };
        let work: Vec<_> = changes.work_changed.iter().filter(is_listed).collect();
        lines.extend(work.iter().take(listed).map(|work| work_line(work)));
        let more = work.len().saturating_sub(listed);
        if more > 0 {
            let more = text::counted(more, "further counter");
            lines.push(format!("work changed: {more} (--all lists them)"));
        }
        lines.extend(lone_lines("OLD", &changes.only_in_old));
        lines.extend(lone_lines("NEW", &changes.only_in_new));
        let mut lone = changes.only_in_old.iter().chain(&changes.only_in_new);
        let is_company = |cell: &Unpaired| {
            let mut rows = changes.rows.iter();
            rows.any(|row| row.cell.group == cell.cell.group)
        };
        if self.args.gate == Gate::Time && lone.any(is_company) {
            let other = "beside other structures, those in both may take other times";
            lines.push(other.to_owned());
        }
        lines.extend(self.advice());
        if rows.is_empty() && !all && room.is_some() {
            lines.push("every cell with its change: --all".to_owned());
        }
        let summary = self.summary();
        lines.push(match room {
            // The summary is above the fold.
            None => self.counts_line(),
            Some(_) => summary[..1].to_uppercase() + &summary[1..],
        });
        blocks.extend(lines.into_iter().map(Block::Line));
        blocks
    }

    /// The judged change, in the words of a caption.
    pub fn measure(&self) -> &'static str {
        match (self.args.gate, self.basis) {
            (Gate::Time, Basis::Reports) => {
                "Change from OLD to NEW relative to the other structures"
            }
            _ => "Change from OLD to NEW",
        }
    }

    /// One row per figure; for a terminal, the columns that fit into `room`.
    fn table(&self, rows: &[&JudgedRow], room: Option<usize>) -> Table {
        let (change, processes) = match (self.args.gate, self.basis) {
            (Gate::Work, _) => ("change", "processes"),
            (Gate::Time, Basis::Reports) if room.is_none() => {
                ("change vs the others [95 %]", "processes")
            }
            (Gate::Time, Basis::Reports) => ("vs the others [95 %]", "processes"),
            (Gate::Time, Basis::Pairs) => ("change [95 %]", "pairs"),
        };
        let places = match room {
            None => "scene | path, test | structure",
            Some(_) => "structure | scene and path",
        };
        let mut table = Table::of(&format!(
            "{places} | metric | >old | >new | >{change} | >resolves | >{processes} | verdict | why"
        ));
        // Next to the widest other column, "vs the others [95 %]", and three gaps.
        let widest = |of: &dyn Fn(&JudgedRow) -> usize| rows.iter().map(|row| of(row)).max();
        let structure = widest(&|row| short_structure(&row.cell.structure).chars().count());
        let metric = widest(&|row| row.metric.map_or(0, str::len));
        let left = match room {
            Some(usize::MAX) => usize::MAX,
            _ => 54_usize.saturating_sub(structure.unwrap_or(0) + metric.unwrap_or(0)),
        };
        let changes = &self.changes;
        let groups = unique(changes.rows.iter().map(|row| &row.cell.group));
        let short = |group: &&GroupKey| place(group, left, short);
        let full = |group: &&GroupKey| place(group, usize::MAX, text::plain);
        let places = distinct(&groups, short, full);
        // With a common shift a verdict is only relative to the others.
        let shifts = changes.proven_shifts();
        for row in rows {
            let at = groups.iter().position(|group| **group == row.cell.group);
            let place = text::some(at, |at| places[at].clone());
            let metric = row.metric.unwrap_or_default();
            let judged = row.judgement.as_ref();
            let resolution = judged.and_then(|found| found.resolution);
            let (scene, structure) = (&row.cell.group.scene, &row.cell.structure);
            let places = match room {
                None => vec![scene.clone(), question(&row.cell.group), structure.clone()],
                Some(usize::MAX) => vec![structure.clone(), place],
                Some(_) => vec![short_structure(structure), place],
            };
            let is_shifted = shifts.iter().any(|shift| {
                let is_of = |group: &GroupKey| *group == row.cell.group;
                Some(shift.metric) == row.metric && shift.group.as_ref().is_none_or(is_of)
            });
            let than_what = match row.outcome {
                Outcome::Slower | Outcome::Faster if is_shifted => " than the others",
                _ => "",
            };
            let figures = [
                metric.to_owned(),
                text::some(row.old, |value| shown(metric, value)),
                text::some(row.new, |value| shown(metric, value)),
                text::some(row.ratio().filter(|ratio| ratio.is_finite()), |ratio| {
                    change_of(ratio, judged.and_then(|found| found.lower.zip(found.upper)))
                }),
                text::some(resolution, |share| format!("{:.1} %", share * 100.0)),
                match (self.basis, row.processes) {
                    (_, [0, 0]) => String::new(),
                    (Basis::Pairs, [pairs, _]) => pairs.to_string(),
                    (Basis::Reports, [old, new]) => format!("{old} vs {new}"),
                },
                row.outcome.name().replace('_', " ") + than_what,
                text::some(room.is_none().then_some(row), |row| reason(row)),
            ];
            table.add_row(places.into_iter().chain(figures));
        }
        let table = table.without_empty_columns();
        let Some(room) = room.filter(|room| *room < usize::MAX && !self.args.all) else {
            return table;
        };
        let mut first_to_go = vec!["metric", "resolves", processes, "old", "new"];
        // Rows without a verdict on times have none.
        let metric = rows.iter().find_map(|row| row.metric);
        let is_of_metric = |row: &&JudgedRow| row.metric.is_none() || row.metric == metric;
        first_to_go.retain(|name| *name != "metric" || rows.iter().all(is_of_metric));
        let table = table.within(room, &first_to_go);
        // One value alone is not informative.
        match table.header.iter().any(|name| name == "old") {
            true => table,
            false => table.within(0, &["new"]),
        }
    }

    /// "2 slower, 3 inconclusive, 1 faster, 92 same of 98 cells".
    fn counts_line(&self) -> String {
        let changes = &self.changes;
        // The verdicts of the gate are always shown.
        let of_work = [Outcome::MoreWork, Outcome::LessWork, Outcome::Same];
        let is_of_gate = |outcome: Outcome| match self.args.gate {
            Gate::Time => outcome.is_judged(),
            Gate::Work => of_work.contains(&outcome),
        };
        let outcomes = Outcome::ALL.into_iter();
        let shown = outcomes.filter(|outcome| is_of_gate(*outcome) || changes.count(*outcome) > 0);
        let counts = shown.map(|outcome| {
            let count = text::count(changes.count(outcome));
            format!("{count} {}", outcome.name().replace('_', " "))
        });
        let cells = text::counted(changes.cells_in_common, "cell");
        let rows = match changes.rows.len() {
            rows if rows == changes.cells_in_common => cells,
            rows => format!("{} of {cells}", text::counted(rows, "figure")),
        };
        let alone = changes.only_in_new.iter();
        let wrong = alone.filter(|cell| cell.status.is_failure()).count();
        let alone = text::any(wrong, "wrong answer", |wrong| {
            format!("; {wrong} only in NEW")
        });
        format!("{} of {rows}{alone}", text::joined(counts))
    }

    /// Advice on inconclusive cells, if there are any.
    fn advice(&self) -> Option<String> {
        let undecided = self.changes.count(Outcome::Inconclusive);
        if undecided == 0 {
            return None;
        }
        let more = self.changes.more_pairs();
        let inconclusive = text::count(undecided);
        let mut rows = self.changes.rows.iter();
        let lacks_others = rows.any(|row| row.reason.iter().any(|why| why.contains(FEW_OTHERS)));
        let judged = self.changes.rows.iter().filter_map(|row| row.judgement);
        let undecided = judged.filter(|found| found.change == Change::Inconclusive);
        let undecided: Vec<Judgement> = undecided.collect();
        let is_hopeless = |found: &&Judgement| found.lower.is_some() && found.more_pairs.is_none();
        let hopeless = undecided.iter().filter(is_hopeless).count();
        let is_stopped = |side: &Side| side.json.get("finished_at") == Some(&Value::Null);
        let told = match (self.basis, more) {
            _ if is_stopped(&self.old) || is_stopped(&self.new) => {
                "finish the run that was stopped (run --resume)".to_owned()
            }
            (Basis::Pairs, Some(more)) => {
                format!("about {} would decide", text::counted(more, "more pair"))
            }
            (Basis::Pairs, None) => "more pairs would not decide".to_owned(),
            (Basis::Reports, _) if hopeless > 0 && hopeless == undecided.len() => {
                "more processes would not decide: run both again, or compare --against BINARY"
                    .to_owned()
            }
            (Basis::Reports, _) => {
                let runs = match more {
                    None if lacks_others => {
                        "runs of ten processes with the same four structures or more".to_owned()
                    }
                    Some(more) if more <= MOST_MORE => {
                        let more = text::counted(more, "more process");
                        format!("about {more} in each run (run --processes)")
                    }
                    _ => "finer runs, perhaps with --processes 20,".to_owned(),
                };
                let of_them = text::count(undecided.len() - hopeless) + " of them";
                let of_them = text::some((hopeless > 0).then_some(of_them), |n| format!(" {n}"));
                format!(
                    "{runs} would decide{of_them}, or compare --against BINARY, which runs both \
                     programs in turns"
                )
            }
        };
        let most = Some(1.0 + self.changes.threshold);
        let why = match undecided.iter().any(|found| found.lower > most) {
            true => " (an interval is of one cell, a verdict allows for all of them)",
            false => "",
        };
        Some(format!("{inconclusive} inconclusive{why}: {told}"))
    }
}

/// "+6.8 % [+5.2, +8.4]" of a ratio new / old.
pub fn change_of(ratio: f64, interval: Option<(f64, f64)>) -> String {
    let change = |ratio: f64| match (ratio - 1.0) * 100.0 {
        percent if percent.abs() < 1e6 => format!("{percent:+.1}"),
        percent => format!("{percent:+.2e}"),
    };
    let interval = interval.map(|(lower, upper)| [lower, upper].map(change).join(", "));
    let interval = text::some(interval, |ends| format!(" [{ends}]"));
    format!("{} %{interval}", change(ratio))
}

/// A line about the change that all cells share.
fn shift_line(shift: &CommonShift) -> String {
    let percent = |ratio: f64| format!("{:.1}", ratio * 100.0);
    let interval = text::some(shift.lower.zip(shift.upper), |(lower, upper)| {
        format!(" [{}, {}]", percent(lower), percent(upper))
    });
    let (metric, ratio) = (shift.metric, percent(shift.ratio));
    let cells = text::counted(shift.cells, "cell");
    let is_open = shift.lower <= Some(1.0) && shift.upper >= Some(1.0);
    let unknown = "; this comparison cannot tell the machine from the program";
    let why = if is_open { "" } else { unknown };
    match &shift.group {
        Some(group) => format!(
            "{}: beside the others {metric} of NEW is {ratio} %{interval} of OLD ({cells}){why}",
            place(group, usize::MAX, text::plain)
        ),
        None => format!("as a whole {metric} of NEW is {ratio} %{interval} of OLD ({cells}){why}"),
    }
}

/// "work changed: bvh on city, ...: items_tested 1200 to 1111 (-7.4 %)".
fn work_line(work: &WorkChange) -> String {
    let short = |value: f64| (value * 1e3).round() / 1e3;
    let shown = match [work.old, work.new].map(short) {
        [old, new] if old != new && old.is_finite() && new.is_finite() => [old, new],
        _ => [work.old, work.new],
    };
    let [old, new] = shown.map(text::number);
    let ratio = Some(work.new / work.old).filter(|_| work.old != 0.0);
    let much = text::some(ratio, |ratio| format!(" ({})", change_of(ratio, None)));
    let (name, counter) = (name(&work.cell), work.counter);
    format!("work changed: {name}: {counter} {old} to {new}{much}")
}

/// The reason for a row's outcome, unless the figures show it.
pub fn reason(row: &JudgedRow) -> String {
    let (old, new) = (row.old_status, row.new_status);
    let became = match row.outcome == Outcome::FailedInBoth {
        true if old == new => Some(new.name().to_owned()),
        _ => (old != new).then(|| format!("{} to {}", old.name(), new.name())),
    };
    text::joined(became.into_iter().chain(row.reason.clone()))
}

/// Every reason once, with its only cell or the number of its cells.
fn reasons(rows: &[&JudgedRow]) -> Vec<String> {
    let told = rows.iter().filter(|row| !reason(row).is_empty());
    let told = told.map(|row| {
        let why = format!("{}: {}", row.outcome.name().replace('_', " "), reason(row));
        (why, &row.cell)
    });
    let lines = grouped(told).into_iter();
    let lines = lines.map(|(why, cells)| match cells[..] {
        [one] => format!("{why} ({})", name(one)),
        _ => format!("{why} ({})", text::counted(cells.len(), "cell")),
    });
    lines.collect()
}

/// A figure with the unit of its metric.
fn shown(metric: &str, value: f64) -> String {
    let info = METRICS.iter().find(|info| info.name == metric);
    match info.map(|info| info.unit) {
        Some("ns") => text::time(value),
        Some("ms") => text::time(value * 1e6),
        _ => text::significant(value),
    }
}

/// "3 cells (bvh on city, orbit, six-plane, ...)".
pub fn counted(cells: &[Unpaired]) -> String {
    let Some(first) = cells.first() else {
        return "no cells".to_owned();
    };
    let more = if cells.len() == 1 { "" } else { ", ..." };
    let name = text::plain(&name(&first.cell));
    format!("{} ({name}{more})", text::counted(cells.len(), "cell"))
}

/// Number of cells of only one side; wrong ones each by name.
fn lone_lines(side: &str, cells: &[Unpaired]) -> Vec<String> {
    let all = (!cells.is_empty()).then(|| format!("only in {side}: {}", counted(cells)));
    let wrong = cells.iter().filter(|cell| cell.status.is_failure());
    let wrong = wrong.map(|cell| {
        let (name, status) = (name(&cell.cell), cell.status.name());
        let why = text::some(cell.reason.as_ref(), |reason| format!(": {reason}"));
        format!("only in {side}: {name}: {status}{why}")
    });
    all.into_iter().chain(wrong).collect()
}
