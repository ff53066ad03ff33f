//! Conclusions of a run in sentences.
//!
//! The winner, its lead over the next best and over the base, the queries that repay its build, and
//! the checks of its answers.

use std::borrow::Borrow;
use std::collections::{BTreeMap, BTreeSet};

use super::document::{Block, Table};
use super::text;
use crate::measure::{Machine, Status, YARDSTICK};
use crate::report::{Comparison, Mean, Overall, ReportCell, grouped, times_as_fast};

/// "a", "a and b", "a, b and c".
fn listed<N: Borrow<str> + ToString>(names: &[N], last: &str) -> String {
    match names.split_last() {
        Some((end, first @ [_, ..])) => {
            format!("{} {last} {}", first.join(", "), end.to_string())
        }
        _ => names.concat(),
    }
}

/// "linear, a flat scan".
fn described(base: &str) -> String {
    match base {
        YARDSTICK => format!("{base}, a flat scan"),
        _ => base.to_owned(),
    }
}

/// "1.62 x".
pub fn times(ratio: f64) -> String {
    format!("{} x", text::significant(ratio))
}

/// Conclusion of one or several scenes and paths in sentences.
pub fn conclusion(all: &[&Comparison], overall: &Overall) -> String {
    let base = overall.base;
    let is_blind = all.iter().any(|c| c.is_blind()) && !all.iter().any(|c| c.decides());
    let (first, is_alone) = match all {
        [one] => (ranking(one, base), one.sound().nth(1).is_none()),
        _ if is_blind => (BLIND.to_owned(), true),
        _ => (standing(all, overall), overall.standings.len() < 2),
    };
    let mut told = vec![first];
    // If it is not the usual one.
    if let Some(other) = base.filter(|base| *base != YARDSTICK && !is_alone) {
        told.push(format!(
            "Speed-ups refer to {other}, the slowest: {YARDSTICK} lacks times."
        ));
    }
    if let [one] = all {
        told.extend(repaid(one, base).filter(|_| !one.is_blind()));
    }
    told.extend(checked(all));
    told.extend(failed(all));
    told.extend(caveats(all));
    told.join(" ")
}

/// The oldest trees whose queries take over twice a fresh build's time.
///
/// Each with its worst scene, path and motion; of the others the tree that ages least.
fn ageing(all: &[&Comparison]) -> Option<String> {
    let (longest, mut aged) = ["1000", "100", "10"].into_iter().find_map(|frames| {
        let trees = all.iter().flat_map(|c| c.sound());
        let trees = trees.filter(|cell| !cell.structure.starts_with(YARDSTICK));
        let ratio = |cell: &ReportCell| cell.value(&format!("ageing_{frames}"));
        let aged = trees.filter_map(|cell| Some((ratio(cell)?, cell.structure.as_str())));
        let aged: Vec<(f64, &str)> = aged.collect();
        (!aged.is_empty()).then_some((frames, aged))
    })?;
    // The largest of each comes first.
    aged.sort_by(|a, b| b.0.total_cmp(&a.0).then(a.1.cmp(b.1)));
    let mut known = BTreeSet::new();
    aged.retain(|(_, name)| known.insert(*name));
    let (old, kept): (Vec<_>, Vec<_>) = aged.into_iter().partition(|(ratio, _)| *ratio > 2.0);
    let stays = |(ratio, name): &(f64, &str)| format!("; {name} stays at {}", times(*ratio));
    let kept = text::some(kept.last(), stays);
    let told = |(ratio, name): &(f64, &str)| format!("{} ({name})", times(*ratio));
    let old: Vec<String> = old.iter().take(4).map(told).collect();
    let most = ["up to ", ""][usize::from(all.len() == 1)].to_owned() + &listed(&old, "and");
    let told = format!("Queries age: after {longest} frames they take {most} as long as");
    (!old.is_empty()).then(|| format!("{told} on a fresh build{kept}."))
}

/// Remarks about missing rebuilds, and about dropped contacts.
fn caveats(all: &[&Comparison]) -> Vec<String> {
    let late = all.iter().flat_map(|c| &c.cells).filter_map(|cell| {
        let (_, every) = cell.structure.split_once("@every=")?;
        let frames = cell.times.cameras_checked / cell.path.views_per_frame.max(1);
        let is_late = frames > 0 && every.parse::<usize>().ok()? > frames;
        let frames = text::counted(frames, "frame");
        is_late.then(|| format!("@every={every}: no rebuild in {frames}."))
    });
    let mut told: Vec<String> = late.collect::<BTreeSet<_>>().into_iter().collect();
    told.extend(ageing(all));
    let dropped = all.iter().filter_map(|c| c.of_any("touch_dropped_count"));
    let dropped = dropped.fold(0.0, f64::max);
    if dropped > 0.0 {
        let dropped = text::significant(dropped);
        let what = "boxes per checked query only touch the view and are not returned";
        told.push(format!("{dropped} {what}."));
    }
    told
}

/// Wall and CPU time of work that at most `threads` share, and its gain.
///
/// `None` if no work is shared.
pub fn sharing<'c>(
    cells: impl IntoIterator<Item = &'c ReportCell>,
    threads: usize,
    machine: &Machine,
) -> Option<[Block; 3]> {
    let cells: Vec<&ReportCell> = cells.into_iter().collect();
    let mut table =
        Table::of("structure | threads share | > wall per query | > speed-up | > CPU time");
    let mut gains = Vec::new();
    for cell in &cells {
        let own = on_one_thread(&cell.structure);
        let is_alone = |cell: &&&ReportCell| Some(&cell.structure) == own.as_ref();
        let queries = ["query_wall_ns", "query_ns"];
        let (what, alone, [wall, cpu]) = match &own {
            Some(_) => ("each query", cells.iter().find(is_alone), queries),
            None => ("the views", Some(cell), ["views_wall_ns", "views_ns"]),
        };
        let [one_wall, one_cpu] = queries.map(|metric| alone.and_then(|cell| cell.value(metric)));
        let Some((wall, one_wall)) = cell.value(wall).zip(one_wall) else {
            continue;
        };
        let cpu = text::some(cell.value(cpu).zip(one_cpu), |(all, one)| times(all / one));
        let (name, gain) = (cell.structure.as_str(), one_wall / wall);
        table.add_row([name, what, &text::time(wall), &times(gain), &cpu]);
        gains.push((what, (gain, name)));
    }
    gains.first()?;
    let gains = grouped(gains.into_iter()).into_iter().map(|(what, own)| {
        let own = own.into_iter().filter(|(gain, _)| *gain > LEAST_GAIN);
        let gain = match own.max_by(|a, b| a.0.total_cmp(&b.0)) {
            Some((gain, name)) => format!("at most {} ({name})", times(gain)),
            None => "no gain".to_owned(),
        };
        format!("{gain} from sharing {what}")
    });
    let busy = text::some(machine.busy(), |busy| format!("; {busy}"));
    let told = format!(
        "{threads} threads: {}{busy}. CPU time ranks.",
        text::joined(gains)
    );
    Some([Block::Table(table), Block::line(""), Block::Line(told)])
}

/// Label without its threads: `linear@rebuild` of `linear:threads=2@rebuild`.
fn on_one_thread(label: &str) -> Option<String> {
    let (before, after) = label.rsplit_once("threads=")?;
    let after = after.trim_start_matches(|c: char| c.is_ascii_digit());
    Some(before.strip_suffix([':', ','])?.to_owned() + after)
}

/// Least ratio of wall times that counts; smaller ones are due to memory layout.
const LEAST_GAIN: f64 = 1.05;

/// Conclusion if no camera sees an item.
pub const BLIND: &str = "Nothing is to be taken: no camera sees an item (see the warnings).";

fn ranking(comparison: &Comparison, base: Option<&str>) -> String {
    let winners: Vec<&ReportCell> = comparison.winners().collect();
    let Some(best) = winners.first() else {
        let scene = &comparison.about().scene;
        let why = match scene.total_count {
            0 if scene.digest.is_empty() => "no process finished a measurement",
            0 => "the scene has no items",
            _ => "no structure has times of right answers",
        };
        return format!("Nothing is ranked: {why}.");
    };
    if comparison.is_blind() {
        return BLIND.to_owned();
    }
    let next = comparison.sound().nth(winners.len());
    // Noise alone may tie the fastest with one slower than the next best.
    let is_ahead =
        |cell: &&&ReportCell| next.and_then(|next| times_as_fast(next, cell)) >= next.map(|_| 1.0);
    let ahead = winners.iter().filter(is_ahead);
    let names: Vec<&str> = ahead.map(|cell| cell.structure.as_str()).collect();
    let time = text::some(best.time(), |time| text::time(time.value));
    let per = ["query", "frame"][usize::from(!best.path.motion.is_empty())];
    let lead = |cell: &ReportCell| text::some(times_as_fast(cell, best), times);
    let Some(next) = next else {
        return match names[..] {
            [one] => format!("{one} takes {time} per {per}; no other structure has a time."),
            _ => format!(
                "A tie: no test tells {} apart. The fastest takes {time} per {per}.",
                listed(&names, "and")
            ),
        };
    };
    let base = base.filter(|base| !names.contains(base) && *base != next.structure);
    let of_base = base.and_then(|base| comparison.sound_cell(base));
    let other = described(&next.structure);
    let is_proven = best.time().is_none_or(|time| time.upper.is_some());
    let leads = format!("{} as fast as {other}, the next best", lead(next));
    let said = match names[..] {
        // Prints as 1.01 x at most.
        [one] if !is_proven && times_as_fast(next, best).is_some_and(|ratio| ratio < 1.015) => {
            format!(
                "{one} or {other}: {one} is less than 2 % ahead, unproven (--processes 10 tells)"
            )
        }
        [one] => format!("{}: {leads}", described(one)),
        _ => format!("{} (a tie): {} is {leads}", listed(&names, "or"), names[0]),
    };
    let of_base = text::some(of_base, |cell| {
        let (lead, base) = (lead(cell), described(&cell.structure));
        format!(", and {lead} as fast as {base}")
    });
    format!("Take {said}{of_base}.")
}

/// Number of queries after which the build of the fastest has paid off.
///
/// `None` if the base is not proven slower.
fn repaid(comparison: &Comparison, base: Option<&str>) -> Option<String> {
    let best = comparison.winners().next()?;
    let mut winners = comparison.winners();
    let is_slower = winners.all(|cell| Some(cell.structure.as_str()) != base);
    let queries = best.value("break_even_queries").filter(|n| *n > 0.0)? as usize;
    let whose = match comparison.winners().count() {
        1 => "Its build".to_owned(),
        _ => format!("The build of {}", best.structure),
    };
    let queries = match queries {
        1 => "one query".to_owned(),
        _ => format!("{} queries", text::count(queries)),
    };
    is_slower.then(|| format!("{whose} is repaid after {queries}."))
}

/// Checks of the answers: by the reference scan, and in exact arithmetic.
fn checked(all: &[&Comparison]) -> Option<String> {
    let cells = || all.iter().flat_map(|c| &c.cells);
    let tried = cells().filter(|c| c.status != Status::LeftOut).count();
    let right = cells().filter(|cell| cell.status == Status::Ok).count();
    let most = |of: fn(&ReportCell) -> usize| {
        let of_each = all.iter().filter_map(|c| c.timed(of).max());
        of_each.sum::<usize>()
    };
    let views = most(|cell| cell.times.cameras_checked);
    let timed = most(|cell| cell.times.cameras_timed);
    let judged = all.iter().filter_map(|c| c.of_any("judged_queries"));
    let who = match right {
        1 if tried == 1 => "The structure".to_owned(),
        _ if right == tried => "All structures".to_owned(),
        _ if all.len() == 1 => format!("{right} of {tried} structures"),
        _ => format!("{} of {} cells", text::count(right), text::count(tried)),
    };
    let of_frames = all.iter().any(|c| !c.about().path.motion.is_empty());
    let asked = match views {
        1 if !of_frames => "the only view".to_owned(),
        1 => "the query of the only frame".to_owned(),
        _ if of_frames => format!("all {} queries of the frames", text::count(views)),
        _ => format!("all {} views", text::count(views)),
    };
    let (timed, judged) = (were(timed), were(judged.sum::<f64>() as usize));
    (right > 0 && views > 0).then(|| {
        format!(
            "{who} returned the sets of the reference scan in {asked}, of which {timed} timed \
             and {judged} checked in exact arithmetic."
        )
    })
}

/// Cells without a right answer, by their status.
fn failed(all: &[&Comparison]) -> Option<String> {
    let statuses = || all.iter().flat_map(|c| &c.cells).map(|cell| cell.status);
    let mut failed = BTreeMap::<&str, usize>::new();
    for status in statuses().filter(|s| !matches!(s, Status::Ok | Status::LeftOut)) {
        *failed.entry(status.name()).or_default() += 1;
    }
    let each: Vec<String> = failed.iter().map(|(s, n)| format!("{n} {s}")).collect();
    let cells = text::counted(statuses().count(), "cell");
    (!each.is_empty()).then(|| format!("Not ok, of {cells}: {}.", each.join(", ")))
}

fn were(count: usize) -> String {
    match count {
        0 => "none was".to_owned(),
        1 => "one was".to_owned(),
        _ => format!("{} were", text::count(count)),
    }
}

fn standing(all: &[&Comparison], overall: &Overall) -> String {
    let mut ranked = overall.standings.iter().filter(|s| s.speedup.is_some());
    let (Some(base), Some(best)) = (overall.base, ranked.next()) else {
        return "No structure has times everywhere, so there are no means.".to_owned();
    };
    if let [one] = &overall.standings[..] {
        return format!("{} is the only structure.", one.structure);
    }
    let tied = ranked.clone().take_while(|s| s.ties_with(best));
    let tied: Vec<&Mean> = [best].into_iter().chain(tied).collect();
    let next = ranked.nth(tied.len() - 1);
    let lead = best.speedup.unwrap_or(1.0);
    let names: Vec<&str> = tied.iter().map(|s| s.structure).collect();
    let mut told = match &names[..] {
        [one] => format!("{one} is the fastest on the whole"),
        _ => format!("{} tie on the whole", listed(&names, "and")),
    };
    // The base is not compared with itself.
    let of_base = !names.contains(&base);
    let of_base = of_base.then(|| format!("{} {base} in the geometric mean", times(lead)));
    let next = next.filter(|next| next.structure != base || of_base.is_none());
    let of_next = next.map(|next| {
        let ratio = lead / next.speedup.unwrap_or(lead);
        format!("{} {}, the next best", times(ratio), next.structure)
    });
    let leads: Vec<String> = of_base.into_iter().chain(of_next).collect();
    if !leads.is_empty() {
        let whose = match tied.len() {
            1 => ":".to_owned(),
            _ => format!("; {} is", names[0]),
        };
        told += &format!("{whose} {}", leads.join(", "));
    }
    let firsts: Vec<String> = tied.iter().map(|s| s.first_in.to_string()).collect();
    let of = all.iter().filter(|c| c.decides()).count();
    told += &format!("; first or tied in {} of {of}.", listed(&firsts, "and"));
    let blind = all.iter().filter(|c| c.is_blind()).count();
    told += &text::any(blind, "row", |rows| {
        format!(" {rows} left out: no camera sees an item.")
    });
    let apart = overall.standings.iter();
    let apart = apart.filter(|s| s.speedup.is_none() && s.first_in > 0);
    let apart = apart.map(|s| format!("{} (first or tied in {})", s.structure, s.first_in));
    let apart = text::joined(apart);
    if !apart.is_empty() {
        told += &format!(" Without a mean, as without times somewhere: {apart}.");
    }
    told
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_partner_has_the_policy_and_no_threads() {
        for (label, wanted) in [
            ("linear:threads=2", Some("linear")),
            ("linear:leaf=4,threads=16", Some("linear:leaf=4")),
            ("linear:threads=2@rebuild", Some("linear@rebuild")),
            ("threads=2", None),
            ("\u{e9}threads=2", None),
        ] {
            assert_eq!(on_one_thread(label).as_deref(), wanted, "{label}");
        }
    }
}
