//! `run --why STRUCTURE`: tests and time per test beside the best structure's.
//!
//! Their two ratios multiply to the ratio of the times.

use super::document::Block;
use super::run_table::{distinct, groups, labels, settings};
use super::run_verdict::times;
use super::table::Table;
use super::text::{self, some};
use crate::report::{Comparison, Report, ReportCell, comparisons};
use crate::shown::shortened;
use crate::statistics::{Estimate, geometric_mean};

/// Counters of a query, and their rows.
const COUNTERS: [(&str, &str); 4] = [
    ("nodes_tested", "nodes tested"),
    ("items_tested", "items tested"),
    ("planes_tested", "planes tested"),
    ("items_accepted_untested", "items returned untested"),
];

/// A structure, and beside it the best of the others.
struct Pair<'r> {
    own: &'r ReportCell,
    other: &'r ReportCell,
    /// Half of the interval of ln(own time / other time) of queries; 0 without one.
    margin: f64,
}

/// A table and a sentence for each cache state and culling test.
pub fn blocks(report: &Report, structure: &str) -> Vec<Block> {
    let (all, mut blocks) = (comparisons(report), Vec::new());
    let groups = groups(&all);
    for (group, of) in groups.iter().zip(settings(&groups)) {
        let pairs = group.iter().map(|comparison| pair(comparison, structure));
        let pairs: Vec<Result<Pair, String>> = pairs.collect();
        let (table, sentence) = match &pairs[..] {
            [Ok(one)] => (of_one(one), one.sentence()),
            _ => of_many(&labels(group), &pairs, structure),
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

/// The structure with that label, or without parameters that name.
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
    let speedup = comparison.speedup(&other.structure, own);
    let ends = speedup.and_then(Estimate::ends);
    let margin = ends.map_or(0.0, |[lower, upper]| (upper / lower).ln() / 2.0);
    // As if the whole interval of a frame were that of its queries.
    let frame = frame_ns(own).zip(queries_ns(own));
    let margin = margin * frame.map_or(1.0, |(frame, queries)| frame / queries);
    Ok(Pair { own, other, margin })
}

impl Pair<'_> {
    /// Quotient of own and other.
    fn ratio(&self, of: impl Fn(&ReportCell) -> Option<f64>) -> Option<f64> {
        let ratio = of(self.own)? / of(self.other)?;
        ratio.is_finite().then_some(ratio)
    }

    /// Differences of updates and of queries of a frame / time of a frame of the other.
    fn differences(&self) -> [f64; 2] {
        [update_ns, queries_ns].map(|of| {
            let difference = || Some((of(self.own)? - of(self.other)?) / frame_ns(self.other)?);
            difference().unwrap_or(0.0)
        })
    }

    /// "bvh takes 1.20 x the time of wide, the best: it tests 4.01 x as many .."
    fn sentence(&self) -> String {
        let ratios = [query_ns, tests, ns_per_test].map(|of| self.ratio(of));
        let [Some(time), Some(tests), Some(per_test)] = ratios else {
            return "A query without tests cannot be explained by their number.".to_owned();
        };
        let others = if time < 1.0 { " of the others" } else { "" };
        let (own, other) = (&self.own.structure, &self.other.structure);
        let parts = parts(tests, per_test, self.margin, self.differences());
        let time = times(time);
        let Some(frame) = self.ratio(frame_ns).map(times) else {
            return format!("{own} takes {time} the time of {other}, the best{others}: {parts}.");
        };
        let update = some(self.ratio(update_ns), times);
        format!(
            "A frame by {own} takes {frame} the time of one by {other}: {update} in updates and \
             {time} in queries, where {parts}."
        )
    }
}

fn frame_ns(cell: &ReportCell) -> Option<f64> {
    cell.value("frame_ns")
}

fn update_ns(cell: &ReportCell) -> Option<f64> {
    cell.value("frame_ns").and_then(|_| cell.value("update_ns"))
}

/// Time of a frame but for its update.
fn queries_ns(cell: &ReportCell) -> Option<f64> {
    Some(frame_ns(cell)? - update_ns(cell)?)
}

/// Time per query; of frames with several views the mean of all, as counters are.
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

/// The two factors of a query's time, and which of them decides.
///
/// Neither does where they differ by less than the interval of the time. The updates do where
/// they make the larger difference of frames.
fn parts(tests: f64, per_test: f64, margin: f64, [updates, queries]: [f64; 2]) -> String {
    let decides = match tests.ln().abs() - per_test.ln().abs() {
        _ if updates.abs() > queries.abs() => "the updates decide",
        more if more.abs() <= margin => "neither decides",
        more if more > 0.0 => "the number of tests decides",
        _ => "the time per test decides",
    };
    let (tests, long) = (times(tests), times(per_test));
    format!(
        "it tests {tests} as many nodes and items, and a test takes {long} as long, so {decides}"
    )
}

fn of_one(pair: &Pair) -> Table {
    let names = [pair.own, pair.other].map(|cell| shortened(&cell.structure, 24));
    let [own, other] = names;
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
    let (mut frames, mut ratios) = (Vec::new(), <[Vec<f64>; 3]>::default());
    let short = distinct(labels, |label| shortened(label, 28), String::clone);
    for (label, pair) in short.into_iter().zip(pairs) {
        let Ok(pair) = pair else { continue };
        let own = [query_ns, tests, ns_per_test].map(|of| pair.ratio(of));
        for (all, own) in ratios.iter_mut().zip(own) {
            all.extend(own);
        }
        let counter = |name| pair.ratio(|cell: &ReportCell| cell.value(name));
        let counters = ["nodes_tested", "items_tested"].map(counter);
        let frame = [frame_ns, update_ns].map(|of| pair.ratio(of));
        frames.extend(frame[0]);
        let figures = frame.into_iter().chain(own).chain(counters);
        let figures = figures.map(|ratio| some(ratio, times));
        let names = [label, shortened(&pair.other.structure, 24)];
        table.add_row(names.into_iter().chain(figures));
    }
    let margins = pairs.iter().flatten().map(|pair| pair.margin);
    let margin = margins.sum::<f64>() / ratios[0].len() as f64;
    let differences = pairs.iter().flatten().map(Pair::differences);
    let differences = differences.fold([0.0; 2], |sum, of| [sum[0] + of[0], sum[1] + of[1]]);
    let means = ratios.each_ref().map(|all| geometric_mean(all));
    let failed = pairs.iter().find_map(|pair| pair.as_ref().err());
    let sentence = match means {
        [Some(time), Some(tests), Some(per_test)] => format!(
            "{structure} takes {} the time of the best other structure in the geometric mean{}: {}.",
            times(geometric_mean(&frames).unwrap_or(time)),
            some(geometric_mean(&frames), |_| {
                format!(" of the frames, and {} in queries", times(time))
            }),
            parts(tests, per_test, margin, differences)
        ),
        _ => failed.cloned().unwrap_or_default(),
    };
    (table.without_empty_columns(), sentence)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_larger_factor_decides() {
        assert_eq!(
            parts(4.0, 0.5, 0.1, [0.0; 2]),
            "it tests 4.00 x as many nodes and items, and a test takes 0.500 x as long, so the \
             number of tests decides"
        );
        let ends = |tests, per_test, margin, differences, wanted| {
            let parts = parts(tests, per_test, margin, differences);
            assert!(parts.ends_with(wanted), "{parts}");
        };
        ends(1.32, 1.35, 0.1, [0.0; 2], "so neither decides");
        ends(1.32, 1.35, 0.0, [0.0; 2], "so the time per test decides");
        ends(1.1, 3.0, 0.1, [0.1, 0.2], "so the time per test decides");
        ends(0.2, 3.0, 0.1, [0.1, -0.2], "so the number of tests decides");
        ends(0.2, 3.0, 0.1, [0.3, -0.2], "so the updates decide");
    }
}
