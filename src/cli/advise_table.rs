//! Advice on a terminal: structure, policy, test, features, and the evidence.

use super::document::Block;
use super::run_table::{heads, structures};
use super::run_verdict::{gains, times};
use super::table::{Column, Table};
use super::text::{self, significant, some, time, time_within};
use crate::advise::{Advice, Axis, Check, Omission, Side, TestRow, ns, policy_of};
use crate::measure::{ReportCell, SharedWork, YARDSTICK};
use crate::report::Comparison;

/// The advice, with the evidence if it is wanted.
pub fn blocks(advice: &Advice, all_columns: bool) -> Vec<Block> {
    let rows = &advice.structure.rows;
    let lines = heads(&compared(rows)).into_iter();
    let lines = lines.chain([text::over(advice.processes, advice.twin.as_ref())]);
    let mut blocks: Vec<Block> = lines.map(Block::Line).collect();
    if all_columns {
        blocks.extend(evidence(advice));
    }
    blocks.push(Block::line(""));
    let failed = rows.iter().filter_map(|row| {
        let (status, why) = (row.status.name(), row.reason.as_ref()?);
        Some(format!("{}: {status}: {why}", row.structure))
    });
    let threads = gains(&SharedWork::of(rows)).map(|gains| format!("Threads: {gains}"));
    let more = [in_motion(advice), threads].into_iter().flatten();
    let more = more.flat_map(|paragraph| [String::new(), paragraph]);
    let told = failed.chain([taken(advice)]).chain(more);
    blocks.extend(told.chain(changes(advice)).map(Block::Line));
    blocks.push(Block::Table(rule_table(&advice.omissions, all_columns)));
    blocks.extend(Block::more(all_columns, "evidence: --all-columns"));
    blocks
}

/// Cells of one scene and path, fastest first.
fn compared(rows: &[ReportCell]) -> Comparison<'_> {
    Comparison {
        cells: rows.iter().collect(),
        bounds: Vec::new(),
    }
}

/// Structure and test to take, in a sentence.
fn taken(advice: &Advice) -> String {
    let choice = &advice.structure;
    let Some(name) = &choice.name else {
        return "No structure answered right".to_owned();
    };
    let mut others = choice.rows[1..].iter().filter(|row| row.rank.is_some());
    let next = others.find(|row| !choice.ties.contains(&row.structure));
    let lead = next.and_then(|next| {
        let times = times(ns(next)? / ns(&choice.rows[0])?);
        Some(format!(" ({times} {}, the next)", next.structure))
    });
    let test = some(advice.test.name, |test| {
        format!(", test {test}{}", ties(&advice.test.ties))
    });
    let lead = lead.unwrap_or_default();
    format!("Take structure {name}{lead}{}{test}.", ties(&choice.ties))
}

/// Policy to update by, with the times of a frame.
fn in_motion(advice: &Advice) -> Option<String> {
    let motion = advice.motion.as_ref()?;
    let policy = motion.policy.as_ref()?;
    let (row, others) = motion.policies.split_first()?;
    let frame = ns(row)?;
    let longer = others.iter().filter_map(|row| {
        let (policy, longer) = (policy_of(&row.structure), times(ns(row)? / frame));
        Some(format!("{policy} takes {longer} as long"))
    });
    let ruled_out = motion
        .ruled_out
        .iter()
        .map(|(policy, frames)| format!("{policy} {} by its builds alone", times(*frames)));
    let others: Vec<String> = longer.chain(ruled_out).collect();
    let others = some(others.first(), |_| format!(" ({})", others.join("; ")));
    Some(format!(
        "In motion: {policy}{}{others}. A frame takes {}, of which the update {}. The rules below, \
         except those of the index and of rebuilds, are weighed on the still scene.",
        ties(&motion.policy_ties),
        time(frame),
        some(row.value("update_ns"), time),
    ))
}

/// From where on other structures are faster, a line per axis.
fn changes(advice: &Advice) -> Vec<String> {
    let told = advice.changes.iter().map(|change| {
        let (what, show): (_, fn(f64) -> String) = match change.axis {
            Axis::Items => ("number of items", |items| {
                text::count(items.round() as usize)
            }),
            Axis::ShareInView => ("share in view", text::short_percent),
            Axis::ShareMoved => ("share moved", text::short_percent),
        };
        let turns = [("below", &change.below), ("above", &change.above)];
        let turns = turns.into_iter().filter_map(|(side, turn)| {
            let turn = turn.as_ref()?;
            let [at, lower, upper] = [turn.at, turn.lower, turn.upper].map(show);
            let structure = &turn.structure;
            Some(format!("{side} {at} ({lower} to {upper}) {structure}"))
        });
        let [low, high] = change.measured.map(show);
        let turns = text::joined(turns);
        match turns.is_empty() {
            true => format!("  {what}: not shown within {low} to {high}, which were measured"),
            false => format!("  {what}: {turns}; measured from {low} to {high}"),
        }
    });
    let head = ["", "Another structure is faster"].map(str::to_owned);
    let head = advice.changes.first().map(|_| head);
    head.into_iter().flatten().chain(told).collect()
}

/// Every structure, policy and test with its times.
fn evidence(advice: &Advice) -> Vec<Block> {
    let table = |rows| structures(&compared(rows), Some(YARDSTICK), true);
    let rows = &advice.structure.rows;
    let structures = Block::section("Structures, all answers checked:", table(rows));
    let mut blocks = Vec::from(structures);
    let motion = advice.motion.as_ref().map(|motion| &motion.policies);
    if let Some(policies) = motion.filter(|policies| !policies.is_empty()) {
        blocks.extend(Block::section(
            "Update policies, side by side:",
            table(policies),
        ));
    }
    let (on, ns) = (&advice.test.structure, advice.draw_ns);
    let tests = format!("Culling tests on {on}, with {ns} ns to draw an item that cannot be seen:");
    let columns: &[Column<&TestRow>] = &[
        ("test", |r| r.test.to_owned()),
        (">query", |r| some(r.query_ns, time_within)),
        (">false positives %", |r| text::rate(r.excess, 100.0)),
        (">missed ppm", |r| text::rate(r.false_negative_ppm, 1.0)),
        (">false positives per query", |r| {
            some(r.false_positives_per_query, significant)
        }),
        (">query and drawing", |r| some(r.total_ns, time)),
    ];
    let tests_measured = Table::with(&advice.test.rows, columns);
    blocks.extend(Block::section(tests, tests_measured));
    blocks
}

fn ties(names: &[impl AsRef<str>]) -> String {
    let tied = |_| format!(" (a tie with {})", text::joined(names));
    some(names.first(), tied)
}

/// Columns of features; those from the sixth on are evidence.
fn features<'o>() -> [Column<&'o Omission>; 12] {
    [
        ("feature", |rule| rule.rule.left_out.to_owned()),
        ("needed", |rule| {
            some(rule.is_needed(), |is| {
                ["no", "yes"][usize::from(is)].to_owned()
            })
        }),
        (">with", |rule| some(rule.cost_ns, |[with, _]| cost(with))),
        (">without", |rule| {
            some(rule.cost_ns, |[_, without]| cost(without))
        }),
        (">ratio", |rule| match rule.cost_ns {
            Some(_) if rule.is_tie => "tie".to_owned(),
            Some([with, without]) if (with / without).is_finite() => times(with / without),
            _ => String::new(),
        }),
        (">statistic", |rule| some(rule.statistic, significant)),
        (">needed above", |rule| some(rule.threshold, significant)),
        ("measured on", |rule| {
            some(rule.check.as_ref(), |check| check.on.clone())
        }),
        (">with / without", |rule| {
            let ratio = rule.check.as_ref().and_then(|check| check.ratio);
            some(ratio, text::within)
        }),
        (">false pos. %, both", |rule| {
            let both = rule.check.as_ref();
            let both = both.and_then(|check| check.kept.excess.zip(check.left_out.excess));
            some(both, |(with, without)| {
                format!("{:.3} / {:.3}", with * 100.0, without * 100.0)
            })
        }),
        ("answers", |rule| {
            let misses = |side: &Side| side.false_negative_ppm > Some(0.0);
            let answers = |check: &Check| match check.same_answers {
                _ if rule.is_wrong() => "WRONG: not the same",
                _ if misses(&check.kept) || misses(&check.left_out) => "some missed",
                true => "the same",
                false => "other extras",
            };
            some(rule.check.as_ref(), |check| answers(check).to_owned())
        }),
        ("what it counts", |rule| rule.rule.statistic_name.to_owned()),
    ]
}

/// A time, or nothing where there is none.
fn cost(ns: f64) -> String {
    some(Some(ns).filter(|ns| ns.is_finite()), time)
}

/// Features that are needed, those that are not, and those that do not apply.
fn rule_table(rules: &[Omission], all_columns: bool) -> Table {
    let mut rules: Vec<&Omission> = rules.iter().collect();
    rules.sort_by_key(|rule| rule.is_needed().map_or(2, |is| u8::from(!is)));
    let features = features();
    let mut columns = features[..5].to_vec();
    columns.push(("", |rule| rule.reason.clone()));
    if all_columns {
        columns.extend(&features[5..]);
    }
    Table::with(rules, &columns)
}
