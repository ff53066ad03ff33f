//! The Pareto front of error and time.

/// What something costs and how wrong it is; less is better in both.
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct Tradeoff {
    /// Any measure, the same for all.
    pub error: f64,
    /// Any unit, the same for all.
    pub time: f64,
}

impl Tradeoff {
    /// No worse in either and better in one (Pareto dominance).
    fn dominates(self, other: Tradeoff) -> bool {
        self.error <= other.error
            && self.time <= other.time
            && (self.error < other.error || self.time < other.time)
    }

    /// What cannot be told is the worst there is.
    fn known(self) -> Tradeoff {
        let known = |value: f64| if value.is_nan() { f64::INFINITY } else { value };
        Tradeoff {
            error: known(self.error),
            time: known(self.time),
        }
    }
}

/// For each point the point that dominates it: of those the most precise, of
/// these the fastest. `None` for the points of the Pareto front. Equal points
/// do not dominate each other; a NaN counts as infinite, and a point that is
/// infinite in both is dominated as soon as any other is not.
///
/// ```
/// use cullbench::statistics::{Tradeoff, dominated_by};
/// let point = |error, time| Tradeoff { error, time };
/// let points = [point(1e-3, 5.0), point(1e-9, 9.0), point(1e-3, 20.0)];
/// assert_eq!(dominated_by(&points), [None, None, Some(1)]);
/// ```
pub fn dominated_by(points: &[Tradeoff]) -> Vec<Option<usize>> {
    let points: Vec<Tradeoff> = points.iter().map(|p| p.known()).collect();
    let better = |point: &Tradeoff| {
        let rivals = points.iter().enumerate();
        let dominating = rivals.filter(|(_, rival)| rival.dominates(*point));
        // Among all that dominate, the first by error and time is itself
        // dominated by none.
        dominating
            .min_by(|(_, a), (_, b)| {
                let by_time = || a.time.total_cmp(&b.time);
                a.error.total_cmp(&b.error).then_with(by_time)
            })
            .map(|(i, _)| i)
    };
    points.iter().map(better).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn points(rows: &[(f64, f64)]) -> Vec<Tradeoff> {
        let point = |&(error, time): &(f64, f64)| Tradeoff { error, time };
        rows.iter().map(point).collect()
    }

    #[test]
    fn dominated_points_name_a_point_of_the_front() {
        let rows = [(4.0, 1.0), (2.0, 2.0), (1.0, 4.0), (3.0, 3.0), (4.0, 2.0)];
        assert_eq!(
            dominated_by(&points(&rows)),
            [None, None, None, Some(1), Some(1)]
        );
        // Twins stand beside each other; equal in one needs better in the other.
        let rows = [(1.0, 1.0), (1.0, 1.0), (1.0, 2.0)];
        assert_eq!(dominated_by(&points(&rows)), [None, None, Some(0)]);
        assert_eq!(dominated_by(&[]), []);
    }

    #[test]
    fn what_is_not_known_is_never_on_the_front() {
        let rows = [(f64::NAN, 1.0), (1.0, 1.0), (f64::INFINITY, f64::NAN)];
        assert_eq!(dominated_by(&points(&rows)), [Some(1), None, Some(1)]);
        assert_eq!(dominated_by(&points(&[(f64::NAN, f64::NAN)])), [None]);
    }

    proptest! {
        #[test]
        fn a_front_dominates_all_others_and_none_of_its_own(
            rows in prop::collection::vec((0..9u8, 0..9u8), 0..20)
        ) {
            let rows: Vec<_> = rows.iter().map(|&(e, t)| (f64::from(e), f64::from(t))).collect();
            let found = dominated_by(&points(&rows));
            let beats = |a: (f64, f64), b: (f64, f64)| a != b && a.0 <= b.0 && a.1 <= b.1;
            for (i, by) in found.iter().enumerate() {
                match by {
                    Some(by) => {
                        prop_assert!(beats(rows[*by], rows[i]));
                        prop_assert_eq!(found[*by], None, "{} is not on the front", by);
                    }
                    None => prop_assert!(!rows.iter().any(|&rival| beats(rival, rows[i]))),
                }
            }
        }
    }
}
