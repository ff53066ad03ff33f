//! `run --why STRUCTURE`: tests and time per test beside the best structure's.

use super::document::{Block, Table};
use super::run_table::{distinct, groups, labels};
use super::run_verdict::times;
use super::text::{self, shortened, some};
use crate::report::{Comparison, Report, ReportCell, comparisons};
use crate::statistics::geometric_mean;

/// Counters of a query, and their rows.
const COUNTERS: [(&str, &str); 4] = [
    ("nodes_tested", "nodes tested"),
    ("items_tested", "items tested"),
    ("planes_tested", "planes tested"),
    ("items_accepted_untested", "items returned untested"),
];

/// A structure and the best of the others.
struct Pair<'r> {
    own: &'r ReportCell,
    other: &'r ReportCell,
}

/// A table and a sentence for each cache state and culling test.
pub fn blocks(report: &Report, structure: &str) -> Vec<Block> {
    let (all, mut blocks) = (comparisons(report), Vec::new());
    for (of, group) in groups(&all) {
        let pairs = group.iter().map(|comparison| pair(comparison, structure));
        let pairs: Vec<Result<Pair, String>> = pairs.collect();
        let (table, sentence) = match &pairs[..] {
            [Ok(one)] => (of_one(one), one.sentence()),
            _ => of_many(&labels(&group), &pairs, structure),
        };
        if !table.rows.is_empty() {
            blocks.extend([Block::Table(table), Block::line("")]);
        }
        blocks.push(Block::Line(text::labelled(&of, &sentence)));
    }
    if blocks.is_empty() {
        blocks.push(Block::Line(format!("{structure} was not measured.")));
    }
    blocks
}

/// Returns true for a structure by its label, or by its name without parameters.
pub fn is_named(label: &str, name: &str) -> bool {
    label == name || label.split([':', '@']).next() == Some(name)
}

/// The structure with that label, or with that name without parameters.
fn pair<'r>(comparison: &Comparison<'r>, structure: &str) -> Result<Pair<'r>, String> {
    let cells = || comparison.cells.iter().copied();
    let labelled = cells().find(|cell| cell.structure == structure);
    let Some(own) = labelled.or_else(|| cells().find(|c| is_named(&c.structure, structure))) else {
        return Err(format!("{structure} was not measured."));
    };
    if query_ns(own).is_none() {
        let status = own.status.name();
        let reason = some(own.reason.as_ref(), |reason| format!(": {reason}"));
        return Err(format!("{structure} has no times: {status}{reason}."));
    }
    let is_other = |cell: &&ReportCell| {
        cell.structure != own.structure && !is_named(&cell.structure, structure)
    };
    let is_variant = |cell: &&ReportCell| cell.structure != own.structure;
    let other = comparison.sound().find(is_other);
    let other = other.or_else(|| comparison.sound().find(is_variant));
    let other = other.ok_or_else(|| "No other structure has a time.".to_owned())?;
    Ok(Pair { own, other })
}

impl Pair<'_> {
    /// Ratio of own and other value.
    fn ratio(&self, of: impl Fn(&ReportCell) -> Option<f64>) -> Option<f64> {
        let ratio = of(self.own)? / of(self.other)?;
        ratio.is_finite().then_some(ratio)
    }

    /// "bvh takes 1.20 x the time of wide, the best."
    fn sentence(&self) -> String {
        let (own, other) = (&self.own.structure, &self.other.structure);
        let ratios = [query_ns, frame_ns, update_ns].map(|of| self.ratio(of));
        let [time, frame, update] = ratios.map(|ratio| some(ratio, times));
        if frame.is_empty() {
            let is_faster = ratios[0].is_some_and(|time| time < 1.0);
            let others = ["", " of the others"][usize::from(is_faster)];
            return format!("{own} takes {time} the time of {other}, the best{others}.");
        }
        format!(
            "A frame by {own} takes {frame} the time of one by {other}: {update} in updates and \
             {time} in queries."
        )
    }
}

fn frame_ns(cell: &ReportCell) -> Option<f64> {
    cell.value("frame_ns")
}

fn update_ns(cell: &ReportCell) -> Option<f64> {
    cell.value("frame_ns").and_then(|_| cell.value("update_ns"))
}

/// Time per query; for frames with several views the mean of all, like counters.
fn query_ns(cell: &ReportCell) -> Option<f64> {
    let first = cell.value("query_ns")?;
    let further = cell.path.views_per_frame.saturating_sub(1) as f64;
    let rest = further * cell.value("further_query_ns").unwrap_or(first);
    Some((first + rest) / (1.0 + further))
}

/// Nodes and items tested per query.
fn tests(cell: &ReportCell) -> Option<f64> {
    Some(cell.value("nodes_tested")? + cell.value("items_tested")?)
}

fn ns_per_test(cell: &ReportCell) -> Option<f64> {
    Some(query_ns(cell)? / tests(cell)?)
}

fn of_one(pair: &Pair) -> Table {
    let [own, other] = [pair.own, pair.other].map(|cell| shortened(&cell.structure, 24));
    let mut table = Table::of_numbers(["per query", &own, &other, "ratio"]);
    let mut row = |name: &str, of: &dyn Fn(&ReportCell) -> Option<f64>, show: fn(f64) -> String| {
        let [own, other] = [pair.own, pair.other].map(|cell| some(of(cell), show));
        table.add_row([name.to_owned(), own, other, some(pair.ratio(of), times)]);
    };
    if frame_ns(pair.own).is_some() {
        row("frame", &frame_ns, text::time);
        row("update", &update_ns, text::time);
    }
    row("time", &query_ns, text::time);
    for (counter, name) in COUNTERS {
        row(name, &|cell| cell.value(counter), text::significant);
    }
    row("nodes and items tested", &tests, text::significant);
    row("time per node or item tested", &ns_per_test, text::time);
    table
}

/// A row per scene and path, and the geometric means.
fn of_many(labels: &[String], pairs: &[Result<Pair, String>], structure: &str) -> (Table, String) {
    let mut table = Table::of(
        "| best other | >frame | >update | >time | >tests | >time per test | >nodes | >items",
    );
    let (mut frames, mut queries) = (Vec::new(), Vec::new());
    let short = distinct(labels, |label| shortened(label, 28), String::clone);
    for (label, pair) in short.into_iter().zip(pairs) {
        let Ok(pair) = pair else { continue };
        let own = [query_ns, tests, ns_per_test].map(|of| pair.ratio(of));
        let counter = |name| pair.ratio(|cell: &ReportCell| cell.value(name));
        let counters = ["nodes_tested", "items_tested"].map(counter);
        let frame = [frame_ns, update_ns].map(|of| pair.ratio(of));
        frames.extend(frame[0]);
        queries.extend(own[0]);
        let figures = frame.into_iter().chain(own).chain(counters);
        let figures = figures.map(|ratio| some(ratio, times));
        let names = [label, shortened(&pair.other.structure, 24)];
        table.add_row(names.into_iter().chain(figures));
    }
    let means = [&queries, &frames].map(|ratios| geometric_mean(ratios).map(times));
    let sentence = match means {
        [Some(time), None] => format!(
            "{structure} takes {time} the time of the best other structure in the geometric mean."
        ),
        [Some(time), Some(frame)] => format!(
            "{structure} takes {frame} the time of the best other structure in the geometric mean \
             of the frames, and {time} in queries."
        ),
        [None, _] => {
            let failed = pairs.iter().find_map(|pair| pair.as_ref().err());
            failed.cloned().unwrap_or_default()
        }
    };
    (table.without_empty_columns(), sentence)
}
