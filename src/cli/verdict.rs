//! The conclusion of a run in sentences, with its figures.

use super::text;
use crate::report::{Comparison, Report, Standing, base_of, comparisons, standings};

/// Structure to take, what it is worth, and how far the answers can be trusted.
pub fn verdict(report: &Report) -> String {
    let all = comparisons(report);
    let mut sentences = Vec::new();
    let ranked: Vec<Comparison> = (all.into_iter())
        .filter(|comparison| comparison.sound().next().is_some())
        .collect();
    match &ranked[..] {
        [] => sentences.push("Nothing was ranked.".to_owned()),
        [one] => sentences.extend(of_one(one)),
        many => sentences.extend(of_many(many)),
    }
    sentences.push(of_answers(report));
    sentences.join(" ")
}

/// "1.62 x".
pub fn times(ratio: f64) -> String {
    format!("{} x", text::significant(ratio))
}

/// "a", "a or b", "a, b or c".
fn any_of(names: &[&str]) -> String {
    match names {
        [] => String::new(),
        [one] => (*one).to_owned(),
        [others @ .., last] => format!("{} or {last}", others.join(", ")),
    }
}

fn of_one(comparison: &Comparison) -> Vec<String> {
    let winners: Vec<_> = comparison.winners().collect();
    let Some(best) = winners.first() else {
        return vec!["Nothing was ranked.".to_owned()];
    };
    let base = base_of(std::slice::from_ref(comparison));
    let names: Vec<&str> = winners.iter().map(|c| c.structure.as_str()).collect();
    let ratio = |name: &str| Some(comparison.speedup(name, best)?.0);
    let mut reasons: Vec<String> = Vec::new();
    let next = comparison.sound().nth(winners.len());
    if let Some((next, ratio)) = next.and_then(|cell| {
        let name = cell.structure.as_str();
        Some((name, cell.value("query_ns")? / best.value("query_ns")?))
    }) {
        reasons.push(format!("{} as fast as {next}, the next best", times(ratio)));
    }
    let next = next.map(|cell| cell.structure.as_str());
    if let Some((base, ratio)) = base.and_then(|base| Some((base, ratio(base)?)))
        && !names.contains(&base)
        && Some(base) != next
    {
        reasons.push(format!("{} as fast as {base}", times(ratio)));
    }
    let tie = match names.len() {
        1 => "",
        _ => " (a tie)",
    };
    let mut told = format!("Take {}{tie}", any_of(&names));
    if !reasons.is_empty() {
        told += &format!(": {}", reasons.join(", and "));
    }
    let mut sentences = vec![told + "."];
    if let Some(queries) = best.value("break_even_queries") {
        let queries = text::counted(queries as usize, "query");
        sentences.push(format!(
            "The build of {} is repaid after {queries}.",
            best.structure
        ));
    }
    sentences
}

fn of_many(comparisons: &[Comparison]) -> Vec<String> {
    let Some(base) = base_of(comparisons) else {
        return Vec::new();
    };
    let all = standings(comparisons, base);
    let Some(best) = all.first() else {
        return vec![format!("No structure has a speed-up over {base}.")];
    };
    let count = comparisons.len();
    let mut told = format!(
        "Take {}: {} as fast as {base} in the geometric mean over {} comparisons",
        best.structure,
        times(best.speedup),
        text::count(best.cells)
    );
    let next = all.get(1).filter(|next| next.structure != base);
    if let Some(Standing {
        structure, speedup, ..
    }) = next
    {
        told += &format!("; the next best is {structure} with {}", times(*speedup));
    }
    let mut sentences = vec![told + "."];
    let elsewhere = match best.first == count {
        true => String::new(),
        false => format!(
            "; elsewhere it takes at most {} as long as the best",
            times(best.worst)
        ),
    };
    sentences.push(format!(
        "It is first or tied in {} of {count}{elsewhere}.",
        text::count(best.first)
    ));
    sentences
}

/// "All answers are right ..." or the number of cells that are not ok.
fn of_answers(report: &Report) -> String {
    let cells = &report.cells;
    let failed = cells.iter().filter(|cell| cell.status.is_failure()).count();
    let checked = cells.iter().map(|cell| cell.times.cameras_checked).max();
    let of = text::counted(cells.len(), "cell");
    match failed {
        0 => format!(
            "No wrong answer in {of}, each checked in up to {} against the others.",
            text::counted(checked.unwrap_or(0), "view")
        ),
        1 => format!("1 of {of} is wrong: see Statuses."),
        _ => format!("{} of {of} are wrong: see Statuses.", text::count(failed)),
    }
}
