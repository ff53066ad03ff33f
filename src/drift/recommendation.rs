//! Recommendation of a method, by error and time.

use serde::Serialize;

use crate::statistics::{ALPHA, ranks};

/// A recommended method, with the reason.
#[derive(Default, Debug, Serialize)]
pub struct Recommendation {
    /// `None` if no method is accurate enough.
    pub name: Option<String>,
    /// Other accurate methods that are not significantly slower.
    pub as_fast: Vec<String>,
    /// Reason in a sentence.
    pub reason: String,
}

/// A method: its name, error (NaN if lost), and ln of its time in every process.
pub type Candidate = (String, f64, Vec<f64>);

/// Recommends the most accurate of the fastest candidates within the tolerance.
///
/// Uses a paired test over the processes.
pub fn recommended(candidates: &[Candidate], tolerance: f64, rule: &str) -> Recommendation {
    let good: Vec<_> = candidates.iter().filter(|c| c.1 <= tolerance).collect();
    let ln_ns: Vec<_> = good.iter().map(|c| c.2.clone()).collect();
    let ranked = good.iter().zip(ranks(&ln_ns, ALPHA));
    let mut fastest: Vec<_> = ranked.filter(|c| c.1 == 1).map(|c| *c.0).collect();
    fastest.sort_by(|a, b| a.1.total_cmp(&b.1));
    let as_fast: Vec<String> = fastest.iter().skip(1).map(|c| c.0.clone()).collect();
    let (count, others) = (good.len(), as_fast.join(", "));
    let reason = match fastest.len() {
        0 => format!("no method has {rule}"),
        1 => format!("the cheapest of {count} with {rule}"),
        _ => format!("the most precise of the cheapest (as fast: {others}) of {count} with {rule}"),
    };
    Recommendation {
        name: fastest.first().map(|c| c.0.clone()),
        as_fast,
        reason,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A fast inaccurate method, an accurate one, and a slower, less accurate one.
    ///
    /// The time of the third varies by the factor `noise` from process to process.
    fn three(processes: i32, noise: f64) -> Vec<Candidate> {
        let row = |(name, error, ns): (&str, f64, f64)| {
            let noise = if name == "slow" { noise } else { 0.0 };
            let ln_ns =
                |n: i32| ns.ln() + 0.1 * f64::from(n % 3) + if n % 2 == 0 { noise } else { -noise };
            (name.to_owned(), error, (0..processes).map(ln_ns).collect())
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
            assert_eq!(none.name, None);
            assert_eq!(none.reason, "no method has such errors");
        }
        assert_eq!(recommended(&[], 1.0, "any").reason, "no method has any");
    }

    #[test]
    fn times_that_are_not_told_apart_leave_the_choice_to_the_error() {
        let choice = recommended(&three(10, 0.3), 1e-6, "such errors");
        assert_eq!(choice.name.as_deref(), Some("precise"));
        assert_eq!(choice.as_fast, ["slow"]);
    }
}
