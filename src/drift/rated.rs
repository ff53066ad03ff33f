//! Methods as points of error against time, and which one to take.

use serde::Serialize;

use super::walk::QUERY_STEPS;
use super::{orbit, rotation};
use crate::measure::OverProcesses;
use crate::statistics::{ALPHA, ranks};

/// A way to turn or carry as a point of error against time.
#[derive(Debug, Serialize)]
pub struct Rated {
    /// As in tables and JSON.
    pub name: &'static str,
    /// What it does, in one line.
    pub summary: &'static str,
    /// What this toolkit's camera does.
    pub is_default: bool,
    /// Worst error after the most steps: of a frame the larger of angle and
    /// orthogonality, of an eye the distance in radii. `None` if it is not finite.
    pub error: Option<f64>,
    /// Thread CPU time with its 95 % interval, which needs three processes.
    pub ns_per_step: Option<f64>,
    /// Lower end of the interval.
    pub ns_per_step_lower: Option<f64>,
    /// Upper end of the interval.
    pub ns_per_step_upper: Option<f64>,
    /// Good enough to be recommended.
    pub qualifies: bool,
}

/// A method to take, and why.
#[derive(Debug, Serialize)]
pub struct Recommendation {
    /// `None` if nothing is good enough.
    pub name: Option<String>,
    /// Others that are good enough and that the processes do not show to be slower.
    pub as_fast: Vec<String>,
    /// Share of the largest allowed error that its own leaves free.
    pub margin: Option<f64>,
    /// The choice in a sentence.
    pub reason: String,
}

/// A method that has an error, with ln of its time in every process.
pub struct Candidate {
    pub name: String,
    pub error: f64,
    pub ln_ns: Vec<f64>,
}

/// Value and interval of a task's time per unit, in ns.
pub fn per_unit(times: &OverProcesses, task: usize, units: f64) -> [Option<f64>; 3] {
    let found = times.ns(task).map(|ns| [ns.value, ns.lower, ns.upper]);
    let finite = |ns: f64| Some(ns / units).filter(|ns| ns.is_finite());
    found.map_or([None; 3], |found| found.map(finite))
}

/// Names with summaries and errors, and the times of the tasks from `first` on; which of
/// those within the tolerance to take.
pub fn rated(
    rows: impl Iterator<Item = (&'static str, &'static str, Option<f64>)>,
    times: &OverProcesses,
    first: usize,
    tolerance: f64,
    rule: &str,
) -> (Vec<Rated>, Recommendation) {
    let mut candidates = Vec::new();
    let row = |(task, (name, summary, error)): (usize, (_, _, Option<f64>))| {
        candidates.extend(error.map(|error| Candidate {
            name: String::from(name),
            error,
            ln_ns: times.ln_ns(task),
        }));
        let [ns_per_step, ns_per_step_lower, ns_per_step_upper] =
            per_unit(times, task, QUERY_STEPS as f64);
        Rated {
            name,
            summary,
            is_default: [rotation::TOOLKIT, orbit::TOOLKIT].contains(&name),
            error,
            ns_per_step,
            ns_per_step_lower,
            ns_per_step_upper,
            qualifies: error.is_some_and(|error| error <= tolerance),
        }
    };
    let rows = (first..).zip(rows).map(row).collect();
    (rows, recommended(&candidates, tolerance, rule))
}

/// Margins below this share of a limit are said.
const SMALL_MARGIN: f64 = 0.05;

/// The words for a figure near its limit; nothing for others.
pub fn small_margin(figure: &str, limit: &str, margin: Option<f64>) -> String {
    match margin {
        Some(margin) if margin < SMALL_MARGIN => {
            format!("; {figure} is only {:.2} % below {limit}", 100.0 * margin)
        }
        _ => String::new(),
    }
}

/// Of the candidates within the tolerance that none is faster than, by a paired test
/// over the processes, the most precise.
pub fn recommended(candidates: &[Candidate], tolerance: f64, rule: &str) -> Recommendation {
    let good = candidates.iter().filter(|c| c.error <= tolerance);
    let (good, ln_ns): (Vec<_>, Vec<_>) = good.map(|c| (c, c.ln_ns.clone())).unzip();
    let ranked = good.iter().zip(ranks(&ln_ns, ALPHA));
    let mut fastest: Vec<&Candidate> = ranked.filter(|c| c.1 == 1).map(|c| *c.0).collect();
    fastest.sort_by(|a, b| a.error.total_cmp(&b.error));
    let as_fast: Vec<String> = fastest.iter().skip(1).map(|c| c.name.clone()).collect();
    let nearest = candidates.iter().min_by(|a, b| a.error.total_cmp(&b.error));
    let mut reason = match (fastest.len(), nearest) {
        (0, None) => format!("no method has {rule}"),
        (0, Some(near)) => format!("no method has {rule}: {} has {:.1e}", near.name, near.error),
        (1, _) => format!("the cheapest of {} with {rule}", good.len()),
        _ => format!(
            "the most precise of the cheapest (as fast: {}) of {} with {rule}",
            as_fast.join(", "),
            good.len()
        ),
    };
    let margin = fastest.first().map(|c| 1.0 - c.error / tolerance);
    reason += &small_margin("its error", "the limit", margin);
    Recommendation {
        name: fastest.first().map(|c| c.name.clone()),
        as_fast,
        margin,
        reason,
    }
}
