//! Advice on a terminal: structure, policy, test, features, and the evidence.

use super::document::Block;
use super::run_verdict::{gains, is_fat, times};
use super::table::{Column, Table};
use super::text::{self, significant, some, time, time_within};
use crate::advise::{Advice, Axis, Check, Omission, TestChoice, TestRow, ns, policy_of};
use crate::measure::{ReportCell, YARDSTICK};
use crate::statistics::Estimate;

/// The advice, with the evidence if it is wanted, for `width` characters.
pub fn blocks(advice: &Advice, all_columns: bool, width: usize) -> Vec<Block> {
    let items = text::items(advice.items, advice.skipped_items);
    let cameras = text::counted(advice.cameras, "camera");
    let (scene, path) = (&advice.scene, &advice.path);
    let mut blocks = vec![
        Block::Line(format!("{scene}: {items}; {path}: {cameras}")),
        Block::Line(text::over(advice.processes, advice.twin.as_ref())),
    ];
    if all_columns {
        blocks.extend(evidence(advice));
    }
    blocks.push(Block::line(""));
    let failed = advice.structure.rows.iter();
    let failed = failed.filter_map(|row| Some((row, row.reason.as_ref()?)));
    let failed =
        failed.map(|(row, why)| format!("{}: {}: {why}", row.structure, row.status.name()));
    let threads = gains(&advice.threads).map(|gains| format!("Threads: {gains}"));
    let more = [in_motion(advice), threads].into_iter().flatten();
    let told = failed.chain([taken(advice)]);
    let told = told.chain(more.flat_map(|paragraph| [String::new(), paragraph]));
    blocks.extend(told.chain(changes(advice)).map(Block::Line));
    let rules = rule_table(advice);
    blocks.push(Block::Table(match rules.wrapped_last(width) {
        Some(_) => rules,
        None => rules.within(width, &["gain", "cost", ""]),
    }));
    let no = |rule: &Omission| not_for(advice, rule);
    type Holds<'h> = &'h dyn Fn(&Omission) -> bool;
    let lines: [(&str, Holds); 4] = [
        ("Does not apply, or was not measured: ", &|rule| {
            no(rule).is_some()
        }),
        (
            "Gains and pays from: each stage beside all others, needed or not, as in funnel: ",
            &|rule| rule.note.contains("pays from"),
        ),
        ("WRONG: answers with and without differ: ", &|rule| {
            rule.checks.iter().any(Check::is_wrong)
        }),
        ("Estimated otherwise; the measurement decides: ", &|rule| {
            rule.confirmed == Some(false) && !rule.is_chosen && no(rule).is_none()
        }),
    ];
    for (what, is_in) in lines {
        let named = advice.omissions.iter().filter(|rule| is_in(rule));
        let why = |rule: &Omission| some(no(rule), |why| format!(" ({why})"));
        let names = named.map(|rule| rule.rule.feature.to_owned() + &why(rule));
        let names = text::joined(names);
        blocks.extend((!names.is_empty()).then(|| Block::Line(what.to_owned() + &names)));
    }
    blocks.extend(Block::more(all_columns, "evidence: --all-columns"));
    blocks
}

/// Structure and test to take, in a sentence.
fn taken(advice: &Advice) -> String {
    let choice = &advice.structure;
    let Some(name) = &choice.name else {
        let why = match choice.rows.iter().any(|row| is_fat(&row)) {
            true => "No structure with exact bounds was measured",
            false => "No structure answered right",
        };
        return why.to_owned();
    };
    let row = choice.rows.iter().find(|row| row.structure == *name);
    let next = choice.rows.iter().find(|row| {
        row.rank.is_some() && row.structure != *name && !choice.ties.contains(&row.structure)
    });
    let faster = next.and_then(|next| {
        let times = times(ns(next)? / ns(row?)?);
        Some(format!("{times} {}, the next", next.structure))
    });
    let is_next = next.is_some_and(|next| next.structure == YARDSTICK);
    let linear = row.and_then(|row| row.value("speedup"));
    let linear = linear.filter(|_| !choice.is_scan && !is_next);
    let linear = linear.map(|speedup| format!("{} linear", times(speedup)));
    let figures = bracketed(linear.into_iter().chain(faster), ", ");
    let test = some(advice.test.name, |test| {
        format!(", test {test}{}", ties(&advice.test.ties))
    });
    let repaid = row.and_then(|row| row.value("break_even_queries"));
    let is_tied = choice.ties.iter().any(|tie| tie == YARDSTICK);
    let repaid = some(repaid.filter(|n| *n > 0.0 && !is_tied), |n| {
        let queries = text::counted(n as usize, "query");
        format!(" Its build is repaid after {queries}.")
    });
    let search = some(choice.region_search.as_ref(), |name| {
        let ties = ties(&choice.region_search_ties);
        format!(" For region search: {name}{ties}.")
    });
    let ties = ties(&choice.ties);
    format!("Take structure {name}{figures}{ties}{test}.{repaid}{search}")
}

/// Policy to update by, with the times of a frame.
fn in_motion(advice: &Advice) -> Option<String> {
    let motion = advice.motion.as_ref()?;
    let policy = motion.policy.as_ref()?;
    let (row, others) = motion.policies.split_first()?;
    let frame = ns(row)?;
    let longer = others.iter().filter_map(|row| {
        let (policy, longer) = (policy_of(&row.structure), times(ns(row)? / frame));
        let more = ["", " and returns more"][usize::from(is_fat(&row))];
        Some(format!("{policy} takes {longer} as long{more}"))
    });
    let ruled_out = motion.ruled_out.iter().map(|(policy, builds)| {
        let longer = times(builds / frame);
        format!("{policy} at least {longer}, its builds alone")
    });
    let others = bracketed(longer.chain(ruled_out), "; ");
    Some(format!(
        "In motion, {} of the items and {} per frame: {policy}{}{others}. A frame takes {}, of which \
         the update {}; the worst one {}. The rules below, except that of the index, are weighed on the \
         still scene.",
        text::short_percent(motion.share_moved),
        text::counted(motion.views, "query"),
        ties(&motion.policy_ties),
        text::time(frame),
        some(row.value("update_ns"), text::time),
        (row.value("worst_frame_ns")).map_or("unknown".to_owned(), text::time),
    ))
}

/// From where on other structures are faster, a line per axis.
fn changes(advice: &Advice) -> Vec<String> {
    if advice.changes.is_empty() {
        return Vec::new();
    }
    let mut told = vec![String::new(), "Another structure is faster".to_owned()];
    for change in &advice.changes {
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
        told.push(match turns.is_empty() {
            true if low == high => format!("  {what}: only {low} was measured"),
            true => format!("  {what}: not shown within {low} to {high}, which were measured"),
            false => format!("  {what}: {turns}; measured from {low} to {high}"),
        });
    }
    told
}

/// Reason for which a feature is neither needed nor not needed.
fn not_for(advice: &Advice, omission: &Omission) -> Option<String> {
    let of_nodes = ["plane-masks", "third-dimension", "rebuild"].contains(&omission.rule.name);
    let taken = &advice.structure;
    let scan = taken.name.as_ref().filter(|_| of_nodes && taken.is_scan);
    match omission.is_needed() {
        None => Some(omission.reason.clone()),
        Some(_) => scan.map(|name| format!("{name} has no nodes")),
    }
}

/// Features that are needed and those that are not, with the cost of both.
fn rule_table(advice: &Advice) -> Table {
    let mut table = Table::of("Rule | >with | >without | >x | ");
    for (needed, title, ratio) in [(true, "Needed", "gain"), (false, "Not needed", "cost")] {
        let is_there =
            |rule: &&Omission| rule.is_needed() == Some(needed) && not_for(advice, rule).is_none();
        for (n, rule) in advice.omissions.iter().filter(is_there).enumerate() {
            if n == 0 {
                table.add_row([title, "with", "without", ratio, ""]);
            }
            let [with, without] = rule.sides_ns();
            let ratio = [with / without, without / with][usize::from(needed)];
            let finite = |x: f64| Some(x).filter(|x| x.is_finite());
            let shown = |ns| some(finite(ns), text::time);
            let note = match rule.note.as_str() {
                _ if rule.is_chosen && ratio < 1.0 => "the choice above decides",
                "" if rule.is_tie => "its statistic decides",
                note => note,
            };
            let ratio = match rule.is_tie {
                true => "tie".to_owned(),
                false => some(finite(ratio), times),
            };
            let feature = format!("  {}", rule.rule.feature);
            table.add_row([feature, shown(with), shown(without), ratio, note.to_owned()]);
        }
    }
    if !table.rows.is_empty() {
        table.header = table.rows.remove(0);
    }
    table
}

/// Every structure, test and feature with its times.
fn evidence(advice: &Advice) -> Vec<Block> {
    let columns: [Column<&Omission>; 2] = [
        ("feature", |feature| format!("  {}", feature.rule.feature)),
        ("why", |feature| {
            let is_otherwise = feature.confirmed == Some(false);
            feature.reason.clone() + ["", " (predicted otherwise)"][usize::from(is_otherwise)]
        }),
    ];
    let (on, ns) = (&advice.test.structure, advice.options.draw_ns);
    let tests = format!("Culling tests on {on}, with {ns} ns to draw an item that cannot be seen:");
    let note = "The statistic decides; where both sides answer the same, the clock does if a \
                paired test over the processes tells them apart.";
    let structures = structure_table(&advice.structure.rows);
    let mut blocks = Vec::new();
    blocks.extend(Block::section(
        "Structures, all answers checked:",
        structures,
    ));
    let motion = advice.motion.as_ref();
    if let Some(motion) = motion.filter(|motion| !motion.policies.is_empty()) {
        let policies = structure_table(&motion.policies);
        blocks.extend(Block::section("Update policies, side by side:", policies));
    }
    blocks.extend(Block::section(tests, test_table(&advice.test)));
    let scene = some(motion, |_| " on the still scene".to_owned());
    let features = format!("Features, measured with and without{scene}:");
    blocks.extend(Block::section(features, check_table(&advice.omissions)));
    let reasons = Table::with(&advice.omissions, &columns);
    blocks.extend([Block::line(note), Block::Table(reasons)]);
    blocks
}

fn ties(names: &[impl AsRef<str>]) -> String {
    let tied = |_| format!(" (a tie with {})", text::joined(names));
    some(names.first(), tied)
}

/// Texts in brackets, if there are any.
fn bracketed(texts: impl Iterator<Item = String>, between: &str) -> String {
    let texts: Vec<String> = texts.collect();
    some(texts.first(), |_| format!(" ({})", texts.join(between)))
}

fn within(cell: &ReportCell, metric: &str) -> String {
    some(cell.metrics.get(metric), |ns| time_within(ns.estimate()))
}

fn structure_table(rows: &[ReportCell]) -> Table {
    let columns: &[Column<&ReportCell>] = &[
        ("structure", |r| r.structure.clone()),
        (">query [95 % interval]", |r| within(r, "query_ns")),
        (">speed-up", |r| some(r.value("speedup"), significant)),
        (">build", |r| some(r.value("build_ms"), |ms| time(ms * 1e6))),
        (">B/item", |r| {
            some(r.value("memory_bytes_per_item"), text::tenths)
        }),
        (">break-even queries", |r| {
            some(r.value("break_even_queries"), |n| text::count(n as usize))
        }),
        (">locate", |r| some(r.value("locate_ns"), time)),
        (">frame", |r| within(r, "frame_ns")),
        (">update", |r| some(r.value("update_ns"), time)),
        (">worst frame", |r| some(r.value("worst_frame_ns"), time)),
        ("status", |r| r.status.name().to_owned()),
    ];
    let mut table = Table::with(rows, columns);
    if rows.iter().any(|row| row.value("frame_ns").is_some()) {
        table.header[2] = "speed-up of frames".to_owned();
    }
    table.without_empty_columns()
}

fn test_table(choice: &TestChoice) -> Table {
    let columns: &[Column<(&TestChoice, &TestRow)>] = &[
        ("", |(choice, r)| {
            let is_taken = choice.name == Some(r.test);
            ["", "*"][usize::from(is_taken)].to_owned()
        }),
        ("test", |(_, r)| r.test.to_owned()),
        (">query [95 % interval]", |(_, r)| {
            some(r.query_ns, time_within)
        }),
        (">false positives %", |(_, r)| text::rate(r.excess, 100.0)),
        (">missed ppm", |(_, r)| {
            text::rate(r.false_negative_ppm, 1.0)
        }),
        (">false positives per query", |(_, r)| {
            some(r.false_positives_per_query, significant)
        }),
        (">query and drawing", |(_, r)| some(r.total_ns, time)),
    ];
    Table::with(choice.rows.iter().map(|row| (choice, row)), columns)
}

/// Every measurement with and without a feature.
fn check_table(features: &[Omission]) -> Table {
    let columns: &[Column<(&Omission, &Check)>] = &[
        ("feature", |(rule, _)| rule.rule.feature.to_owned()),
        ("measured on", |(_, check)| check.on.clone()),
        (">with / without", |(rule, check)| {
            let inverse = |ratio: Estimate| Estimate {
                value: ratio.value.recip(),
                lower: ratio.upper.map(f64::recip),
                upper: ratio.lower.map(f64::recip),
            };
            match rule.rule.is_saving {
                true => some(check.ratio.map(inverse), text::within),
                false => some(check.ratio, text::within),
            }
        }),
        (">false pos. %, both", |(rule, check)| {
            let mut both = [check.kept_excess, check.left_out_excess];
            if rule.rule.is_saving {
                both.reverse();
            }
            let percent = |share: f64| format!("{:.3}", share * 100.0);
            some(both[0].zip(both[1]), |(with, without)| {
                format!("{} / {}", percent(with), percent(without))
            })
        }),
        ("answers", |(_, check)| {
            let missed = check.kept_false_negative_ppm > Some(0.0)
                || check.left_out_false_negative_ppm > Some(0.0);
            match (check.same_answers, check.is_wrong(), missed) {
                (_, true, _) => "WRONG: not the same",
                (_, _, true) => "some missed",
                (true, ..) => "the same",
                (false, ..) => "other extras",
            }
            .to_owned()
        }),
    ];
    let rules = features.iter();
    let checks = rules.flat_map(|rule| rule.checks.iter().map(move |check| (rule, check)));
    Table::with(checks, columns)
}
