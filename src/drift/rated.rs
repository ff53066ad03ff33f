//! Methods as points of error against time, and which one to take.

use serde::Serialize;

use super::frames::QUERY_STEPS;
use super::rotation::{self, Method};
use crate::measure::OverProcesses;
use crate::statistics::{ALPHA, Estimate, flat, ranks};

/// A way to turn or carry as a point of error against time.
#[derive(Debug, Serialize)]
pub struct Rated {
    /// Name in tables and JSON.
    pub name: &'static str,
    /// One line about what it does.
    pub summary: &'static str,
    /// The way of this toolkit's camera.
    pub is_default: bool,
    /// Worst error after the most steps: of a frame the larger of angle and
    /// orthogonality, of an eye the distance in radii. `None` if it is not finite.
    pub error: Option<f64>,
    /// Thread CPU time with its 95 % interval, which needs three processes.
    #[serde(flatten, serialize_with = "flat::ns_per_step")]
    pub time_per_step: Option<Estimate>,
    /// Good enough to be recommended.
    pub qualifies: bool,
}

/// A method to take, and why.
#[derive(Default, Debug, Serialize)]
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

/// Rates methods by their errors and the times of the tasks from `first` on, and
/// recommends one within a tolerance after `steps` steps.
pub fn rated<'m>(
    rows: impl Iterator<Item = (&'m Method, Option<f64>)>,
    times: &OverProcesses,
    first: usize,
    (tolerance, steps): (f64, u64),
) -> (Vec<Rated>, Recommendation) {
    let (mut all, mut candidates) = (Vec::new(), Vec::new());
    for (task, (method, error)) in (first..).zip(rows) {
        let name = method.name;
        candidates.extend(error.map(|error| Candidate {
            name: name.to_owned(),
            error,
            ln_ns: times.ln_ns(task),
        }));
        all.push(Rated {
            name,
            summary: method.summary,
            is_default: [rotation::TOOLKIT, rotation::TOOLKIT_ORBIT].contains(&name),
            error,
            time_per_step: times.ns(task).map(|ns| ns.per(QUERY_STEPS as f64)),
            qualifies: error.is_some_and(|error| error <= tolerance),
        });
    }
    let rule = format!(
        "an error within {tolerance:e} after {:e} steps",
        steps as f64
    );
    (all, recommended(&candidates, tolerance, &rule))
}

/// Smaller margins, as a share of a limit, are reported.
const SMALL_MARGIN: f64 = 0.05;

/// Words for a figure near its limit; empty for others.
pub fn small_margin(figure: &str, limit: &str, margin: Option<f64>) -> String {
    match margin {
        Some(margin) if margin < SMALL_MARGIN => {
            format!("; {figure} is only {:.2} % below {limit}", 100.0 * margin)
        }
        _ => String::new(),
    }
}

/// Recommends the most precise of the fastest candidates within the tolerance, by a
/// paired test over the processes.
pub fn recommended(candidates: &[Candidate], tolerance: f64, rule: &str) -> Recommendation {
    let good = candidates.iter().filter(|c| c.error <= tolerance);
    let (good, ln_ns): (Vec<_>, Vec<_>) = good.map(|c| (c, c.ln_ns.clone())).unzip();
    let ranked = good.iter().zip(ranks(&ln_ns, ALPHA));
    let mut fastest: Vec<&Candidate> = ranked.filter(|c| c.1 == 1).map(|c| *c.0).collect();
    fastest.sort_by(|a, b| a.error.total_cmp(&b.error));
    let as_fast: Vec<String> = fastest.iter().skip(1).map(|c| c.name.clone()).collect();
    let nearest = candidates.iter().min_by(|a, b| a.error.total_cmp(&b.error));
    let (count, others) = (good.len(), as_fast.join(", "));
    let mut reason = match (fastest.len(), nearest) {
        (0, None) => format!("no method has {rule}"),
        (0, Some(near)) => format!("no method has {rule}: {} has {:.1e}", near.name, near.error),
        (1, _) => format!("the cheapest of {count} with {rule}"),
        _ => format!("the most precise of the cheapest (as fast: {others}) of {count} with {rule}"),
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

#[cfg(test)]
mod tests {
    use super::*;

    /// Rough and fast, precise, slower and less precise; the third is `noise` faster or
    /// slower in every other process.
    fn three(processes: i32, noise: f64) -> Vec<Candidate> {
        let row = |(name, error, ns): (&str, f64, f64)| Candidate {
            name: name.to_owned(),
            error,
            ln_ns: (0..processes)
                .map(|n| {
                    let noise = if name == "slow" { noise } else { 0.0 };
                    ns.ln() + 0.1 * f64::from(n % 3) + if n % 2 == 0 { noise } else { -noise }
                })
                .collect(),
        };
        [
            ("rough", 0.96e-3, 5.0),
            ("precise", 1e-12, 9.0),
            ("slow", 1e-9, 9.5),
        ]
        .map(row)
        .into()
    }

    #[test]
    fn the_cheapest_within_the_tolerance_is_recommended() {
        for processes in [1, 10] {
            let choose = |tolerance| recommended(&three(processes, 0.0), tolerance, "such errors");
            let rough = choose(1e-2);
            assert_eq!(rough.name.as_deref(), Some("rough"));
            assert_eq!(rough.reason, "the cheapest of 3 with such errors");
            assert_eq!(choose(1e-6).name.as_deref(), Some("precise"));
            let none = choose(1e-15);
            assert_eq!((none.name, none.margin), (None, None));
            assert_eq!(
                none.reason,
                "no method has such errors: precise has 1.0e-12"
            );
        }
        assert_eq!(recommended(&[], 1.0, "any").reason, "no method has any");
    }

    #[test]
    fn a_small_margin_is_said() {
        let near = recommended(&three(1, 0.0), 1e-3, "such errors");
        assert!((near.margin.unwrap_or(0.0) - 0.04).abs() < 1e-12);
        let said = "; its error is only 4.00 % below the limit";
        assert!(near.reason.ends_with(said), "{}", near.reason);
        assert_eq!(small_margin("its step", "the limit", Some(0.051)), "");
    }

    #[test]
    fn times_that_are_not_told_apart_leave_the_choice_to_the_error() {
        let choice = recommended(&three(10, 0.3), 1e-6, "such errors");
        assert_eq!(choice.name.as_deref(), Some("precise"));
        assert_eq!(choice.as_fast, ["slow"]);
    }
}
