//! Rules about stages beyond the frustum: one side removes something that the other
//! returns, so the drawing that this saves is weighed against the time that it takes.

use super::super::omission::Check;
use super::super::rule::{Draft, Finding};
use super::super::trials::{Sides, Trials};
use crate::visibility::SampleGrid;

/// Cameras that a prediction looks at, evenly spread, and rays of each.
pub const PROBED: usize = 8;
pub const PROBES: SampleGrid = SampleGrid::new(16, 9);
/// Most cameras on which items are counted, evenly spread.
const MOST_COUNTED: usize = 64;

/// Candidates that one side removes and the other returns.
pub struct Removal {
    /// Singular and plural.
    pub unit: [&'static str; 2],
    /// Left by the side that removes, per view.
    pub with: f64,
    /// Returned by the other, per view.
    pub without: f64,
    /// Cost of one that is not removed, ns.
    pub cost_ns: f64,
    /// Predicted share that is removed.
    pub predicted: f64,
}

impl Removal {
    /// Leaves out where removing takes longer than drawing the removed candidates.
    pub fn weigh(&self, check: &Check) -> Finding {
        let (with, without, cost_ns) = (self.with, self.without, self.cost_ns);
        let [one, many] = self.unit;
        if without == 0.0 {
            return Finding {
                reason: format!("no {one} is in any view that was looked at"),
                ..Finding::default()
            };
        }
        let removed = without - with;
        let testing = check.kept_ns - check.left_out_ns;
        let pays = (testing / (cost_ns * without)).max(0.0);
        let share = removed / without;
        let from = (testing > 0.0 && removed > 0.0).then_some(testing / removed);
        let told = |show: &dyn Fn(f64) -> String| from.map_or_else(String::new, show);
        let reason = format!(
            "{removed:.1} of {without:.1} {many} a view are removed ({:.1} %; predicted {:.1} %), \
             which saves {} ns each{}",
            share * 100.0,
            self.predicted * 100.0,
            (cost_ns * 1e3).round() / 1e3,
            told(&|ns| format!("; pays above {ns:.1} ns per {one}"))
        );
        let kept = check.kept_ns + with * cost_ns;
        let left_out = check.left_out_ns + without * cost_ns;
        let note = format!(
            "{} ns/{}{}",
            (cost_ns * 1e1).round() / 1e1,
            one.trim_start_matches("shaded "),
            told(&|ns| format!(", pays from {ns:.*}", if ns < 10.0 { 2 } else { 0 }))
        );
        let is_known = self.predicted.is_finite() && pays.is_finite();
        Finding {
            confirmed: is_known.then_some((self.predicted <= pays) == (share <= pays)),
            ..Finding::new(share, pays, reason)
                .noted(note)
                .costing([kept, left_out])
        }
    }
}

/// A rule of which one side removes something, counted after the times.
pub fn weighed(sides: Sides, removal: impl FnOnce() -> Removal + 'static) -> Draft {
    Draft::concluded(vec![sides], |facts| removal().weigh(&facts.checks[0]))
}

/// A rule about items, of which the kept side returns fewer.
pub fn of_items(trials: &Trials, sides: Sides, predicted: f64) -> Draft {
    let removal = Removal {
        unit: ["item", "items"],
        with: trials.mean_count(sides.kept, MOST_COUNTED),
        without: trials.mean_count(sides.left_out, MOST_COUNTED),
        cost_ns: trials.case.options.draw_ns,
        predicted,
    };
    weighed(sides, move || removal)
}

#[cfg(test)]
mod tests {
    use super::super::super::omission::{By, Decision, LeftOutIf, check};
    use super::super::super::rule::some_rule;
    use super::*;

    #[test]
    fn a_stage_is_left_out_where_it_takes_longer_than_what_it_saves() {
        let of = |with: f64, without: f64, cost_ns: f64, predicted: f64| {
            let mut check = check(3.0, None);
            check.same_expected = false;
            let removal = Removal {
                unit: ["thing", "things"],
                with,
                without,
                cost_ns,
                predicted,
            };
            let rule = some_rule(LeftOutIf::AtMost, By::Rule);
            rule.omission(removal.weigh(&check), vec![check])
        };
        // 200 ns for 40 of 50: pays above 5 ns each.
        let dear = of(10.0, 50.0, 5.1, 0.79);
        let found = (dear.decision, dear.confirmed);
        assert_eq!(found, (Decision::Keep, Some(true)));
        assert_eq!(dear.statistic, Some(0.8));
        assert!((dear.threshold.unwrap() - 200.0 / 255.0).abs() < 1e-12);
        for part in ["40.0 of 50.0 things", "above 5.0 ns per thing"] {
            assert!(dear.reason.contains(part), "{}", dear.reason);
        }
        let cheap = of(10.0, 50.0, 4.9, 0.9);
        let found = (cheap.decision, cheap.confirmed);
        assert_eq!(found, (Decision::LeaveOut, Some(false)));
        // It costs 300 + 49 with and 100 + 245 without.
        assert!((cheap.saving.unwrap() - (1.0 - 345.0 / 349.0)).abs() < 1e-12);
        assert_eq!(of(50.0, 50.0, 1e9, 0.0).decision, Decision::LeaveOut);
        let nothing = of(0.0, 0.0, 1.0, f64::NAN);
        assert_eq!((nothing.predicted, nothing.threshold), (None, None));
        assert!(nothing.reason.contains("no thing"), "{}", nothing.reason);
    }
}
