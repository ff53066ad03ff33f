//! Methods as points of error against time: who dominates whom, and which one to take.
//! Times that the processes do not tell apart are ties.

use serde::Serialize;

use super::walk::QUERY_STEPS;
use super::{orbit, rotation};
use crate::measure::OverProcesses;
use crate::statistics::{ALPHA, Standing, dominance, is_less, ranks};

/// A way to turn or carry as a point of error against time.
#[derive(Clone, PartialEq, Debug, Serialize)]
pub struct Rated {
    /// As in tables and JSON.
    pub name: &'static str,
    /// What it does, in one line.
    pub summary: &'static str,
    /// What this toolkit's camera does.
    pub is_default: bool,
    /// A frame's or an eye's worst error after the most steps: the larger of
    /// angle and orthogonality, or the distance in radii. `None` where it has
    /// none that is finite.
    pub error: Option<f64>,
    /// Thread CPU time with its 95 % interval, which needs three processes.
    pub ns_per_step: f64,
    /// Lower end of the interval.
    pub ns_per_step_lower: Option<f64>,
    /// Upper end of the interval.
    pub ns_per_step_upper: Option<f64>,
    /// Good enough to be recommended.
    pub qualifies: bool,
    /// Another that is shown to be no worse in error or time and better in one.
    pub dominated_by: Option<&'static str>,
    /// It is dominated, but by times that the processes do not tell apart.
    pub is_tie: bool,
    /// Has an error, and nothing is shown to dominate it.
    pub on_front: bool,
}

/// A choice, and why.
#[derive(Clone, PartialEq, Debug, Serialize)]
pub struct Recommendation {
    /// `None` if nothing is good enough.
    pub name: Option<&'static str>,
    /// Others that are good enough and that the processes do not show to be slower.
    pub as_fast: Vec<&'static str>,
    /// The choice in a sentence.
    pub reason: String,
}

/// A point with ln of its time in every process.
pub struct Row {
    pub rated: Rated,
    ln_ns: Vec<f64>,
}

/// Names with summaries and errors, and the times of the tasks from `first` on: good
/// enough below the tolerance.
pub fn rated(
    rows: impl Iterator<Item = (&'static str, &'static str, Option<f64>)>,
    times: &OverProcesses,
    first: usize,
    tolerance: f64,
) -> Vec<Row> {
    let row = |(task, (name, summary, error)): (usize, (_, _, Option<f64>))| {
        let per_step = |ns: f64| ns / QUERY_STEPS as f64;
        let ns = times.ns(task);
        let end = |end: Option<f64>| end.filter(|end| end.is_finite()).map(per_step);
        Row {
            ln_ns: times.ln_ns(task),
            rated: Rated {
                name,
                summary,
                is_default: [rotation::TOOLKIT, orbit::TOOLKIT].contains(&name),
                error,
                ns_per_step: ns.map_or(f64::NAN, |ns| per_step(ns.value)),
                ns_per_step_lower: end(ns.map(|ns| ns.lower)),
                ns_per_step_upper: end(ns.map(|ns| ns.upper)),
                qualifies: error.is_some_and(|error| error < tolerance),
                dominated_by: None,
                is_tie: false,
                on_front: false,
            },
        }
    };
    with_front((first..).zip(rows).map(row).collect())
}

/// The rows that none is faster than by a paired test over the processes, the most
/// precise first.
pub fn fastest<'r, R>(
    rows: &[&'r R],
    ln_ns: fn(&R) -> &Vec<f64>,
    error: fn(&R) -> f64,
) -> Vec<&'r R> {
    let values: Vec<Vec<f64>> = rows.iter().map(|row| ln_ns(row).clone()).collect();
    let placed = ranks(&values, ALPHA).into_iter().zip(rows);
    let first = placed.filter(|(rank, _)| *rank == 1);
    let mut fastest: Vec<&R> = first.map(|(_, row)| *row).collect();
    fastest.sort_by(|a, b| error(a).total_cmp(&error(b)));
    fastest
}

/// Fills in who dominates whom. What has no error that is finite is left out:
/// being the fastest does not put it on the front.
fn with_front(mut rows: Vec<Row>) -> Vec<Row> {
    let rated: Vec<usize> = (0..rows.len())
        .filter(|&i| rows[i].rated.error.is_some())
        .collect();
    let values: Vec<[f64; 2]> = rated
        .iter()
        .map(|&i| {
            let own = &rows[i].rated;
            [own.error.unwrap_or(f64::INFINITY), own.ns_per_step]
        })
        .collect();
    let logs: Vec<&[f64]> = rated.iter().map(|&i| &*rows[i].ln_ns).collect();
    for (&i, found) in rated.iter().zip(front(&values, &logs)) {
        let by = found.dominated_by.map(|by| rows[rated[by]].rated.name);
        let own = &mut rows[i].rated;
        own.dominated_by = by;
        own.on_front = by.is_none();
        own.is_tie = found.is_tie;
    }
    rows
}

/// Dominance of points of error and time with ln of their times in every process: an
/// error is what it is, a time what a paired test over the processes shows.
pub fn front(values: &[[f64; 2]], ln_ns: &[&[f64]]) -> Vec<Standing> {
    dominance(values, &|a, b, dimension| {
        dimension == 0 || is_less(ln_ns[a], ln_ns[b], ALPHA)
    })
}

/// Of the methods that are good enough and that none is faster than, the most precise.
pub fn cheapest(rows: &[Row], rule: &str) -> Recommendation {
    let good: Vec<&Row> = rows.iter().filter(|row| row.rated.qualifies).collect();
    let error = |row: &Row| row.rated.error.unwrap_or(f64::INFINITY);
    let fastest = fastest(&good, |row| &row.ln_ns, error);
    let as_fast: Vec<&str> = fastest.iter().skip(1).map(|row| row.rated.name).collect();
    let reason = match (fastest.len(), good.len()) {
        (0, _) => format!("no method has {rule}"),
        (1, good) => format!("the cheapest of {good} methods with {rule}"),
        (_, good) => format!(
            "the most precise of the cheapest (as fast: {}) of {good} methods with {rule}",
            as_fast.join(", ")
        ),
    };
    Recommendation {
        name: fastest.first().map(|row| row.rated.name),
        as_fast,
        reason,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::measure::ProcessTimes;

    const ROWS: [(&str, &str, Option<f64>); 4] = [
        ("lost", "", None),
        ("rough", "", Some(1e-3)),
        ("precise", "", Some(1e-12)),
        ("slow", "", Some(1e-9)),
    ];

    /// Fast and rough, slow and precise, slower and no better, faster and lost; in
    /// each process all times change by the same factor but for `noise` of the third.
    fn four(tolerance: f64, processes: i32, noise: f64) -> Vec<Row> {
        let process = |n: i32| {
            let common = 0.1 * f64::from(n % 3);
            let swing = if n % 2 == 0 { noise } else { -noise };
            let ln = [1.0f64, 5.0, 9.0, 9.5].map(|ns| ns.ln() + common);
            let ln = [ln[0], ln[1], ln[2] + swing, ln[3]];
            ProcessTimes {
                ln_ns: ln.map(|ln| Ok(Some(ln))).into(),
                ..ProcessTimes::default()
            }
        };
        let processes: Vec<ProcessTimes> = (0..processes).map(process).collect();
        rated(
            ROWS.into_iter(),
            &OverProcesses::of(&processes),
            0,
            tolerance,
        )
    }

    #[test]
    fn the_cheapest_within_the_tolerance_is_recommended() {
        for processes in [1, 10] {
            let choose = |tolerance| cheapest(&four(tolerance, processes, 0.0), "such errors");
            assert_eq!(choose(1e-2).name, Some("rough"));
            assert_eq!(choose(1e-6).name, Some("precise"));
            assert!(choose(1e-6).reason.contains("of 2 methods"));
            let none = choose(1e-15);
            assert_eq!(
                (none.name, &*none.reason),
                (None, "no method has such errors")
            );
        }
    }

    #[test]
    fn what_is_lost_is_neither_on_the_front_nor_recommended() {
        let rows = four(1.0, 10, 0.0);
        let dominated: Vec<_> = rows
            .iter()
            .map(|r| (r.rated.dominated_by, r.rated.on_front))
            .collect();
        let front = (None, true);
        assert_eq!(
            dominated,
            [(None, false), front, front, (Some("precise"), false)]
        );
        assert!(rows[1].rated.ns_per_step_lower < Some(rows[1].rated.ns_per_step));
        assert_eq!(four(1.0, 1, 0.0)[1].rated.ns_per_step_lower, None);
    }

    #[test]
    fn times_that_are_not_told_apart_leave_the_choice_to_the_error() {
        // On the mean the noisy one is 5 % faster than the one that is less precise,
        // and that is not shown.
        let rows = four(1e-6, 10, 0.3);
        let choice = cheapest(&rows, "such errors");
        assert_eq!(
            (choice.name, &*choice.as_fast),
            (Some("precise"), &["slow"][..])
        );
        assert_eq!(rows[3].rated.dominated_by, Some("precise"));
        assert!(!rows[3].rated.is_tie, "its error is larger");
        // The other way round: the slower one is the more precise.
        let swapped = ROWS.map(|(name, summary, error)| match name {
            "precise" => (name, summary, Some(1e-9)),
            "slow" => (name, summary, Some(1e-12)),
            _ => (name, summary, error),
        });
        let times: Vec<ProcessTimes> = (0..10)
            .map(|n| {
                let swing = if n % 2 == 0 { 0.3 } else { -0.3 };
                ProcessTimes {
                    ln_ns: [0.0, 1.6, 2.2 + swing, 2.25].map(|ln| Ok(Some(ln))).into(),
                    ..ProcessTimes::default()
                }
            })
            .collect();
        let rows = rated(swapped.into_iter(), &OverProcesses::of(&times), 0, 1e-6);
        assert_eq!(cheapest(&rows, "such errors").name, Some("slow"));
        assert!(rows[2].rated.on_front && rows[3].rated.on_front);
    }
}
