//! Pareto fronts: of error and time, and of any dimensions that are samples.

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

/// What keeps a point off the front.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct Dominated {
    /// A point of the front that is no worse in anything and better in something.
    pub by: usize,
    /// Whether the samples show it; otherwise it is a tie.
    pub is_shown: bool,
}

/// Dominance among points in `N` dimensions, less is better in each. The front is
/// that of the values: `None`, nothing is as good in all and better in one.
///
/// `is_less(a, b, k)` says whether the samples show `a` to be better than `b` in
/// dimension `k`; it is asked only where the values say so. That a point is
/// dominated is shown if a point that is no worse than it (itself, or one that is
/// as good or better by all values) is shown to be worse in some dimension than a
/// point that is no worse than that one. So dominance is transitive, as it is by
/// the values alone, and a point that is only known less well is protected by it
/// neither from the front's points nor from those that they dominate. O(n^2).
pub fn dominance<const N: usize>(
    values: &[[f64; N]],
    is_less: &dyn Fn(usize, usize, usize) -> bool,
) -> Vec<Option<Dominated>> {
    let all = 0..values.len();
    let no_worse = |a: usize, b: usize| (0..N).all(|k| values[a][k] <= values[b][k]);
    let better = |a: usize, b: usize| no_worse(a, b) && values[a] != values[b];
    let shown = |a: usize, b: usize| {
        better(a, b) && (0..N).any(|k| values[a][k] < values[b][k] && is_less(a, b, k))
    };
    let on_front = |&a: &usize| !all.clone().any(|b| better(b, a));
    let front: Vec<usize> = all.clone().filter(on_front).collect();
    // Those of the front first: they dominate most.
    let is_beaten = |b: usize| {
        let rivals = front.iter().copied().chain(all.clone());
        rivals.into_iter().any(|a| shown(a, b))
    };
    let beaten: Vec<usize> = all.clone().filter(|&b| is_beaten(b)).collect();
    let of = |c: usize| {
        let by = front.iter().copied().find(|&a| better(a, c))?;
        let is_shown = beaten.iter().any(|&b| no_worse(b, c));
        Some(Dominated { by, is_shown })
    };
    all.clone().map(of).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    #[test]
    fn a_noisy_point_is_a_tie_and_never_on_the_front() {
        // Error and time; the third is slower but too noisy to be told apart.
        let values = [[5.0, 10.0], [5.0, 12.0], [5.0, 11.0], [0.0, 30.0]];
        let told = |a: usize, b: usize, _: usize| a != 2 && b != 2;
        let found = dominance(&values, &told);
        let by = |is_shown| Some(Dominated { by: 0, is_shown });
        assert_eq!(found, [None, by(true), by(false), None]);
        // Worse than one that is shown to be worse.
        let values = [[5.0, 10.0], [5.0, 12.0], [5.0, 13.0]];
        assert_eq!(dominance(&values, &told), [None, by(true), by(true)]);
        // Equal points stand beside each other.
        assert_eq!(dominance(&[[1.0], [1.0]], &|_, _, _| true), [None, None]);
    }

    proptest! {
        #[test]
        fn dominance_is_transitive_whatever_the_samples_show(
            rows in prop::collection::vec([0..4u8, 0..4u8, 0..4u8], 1..12),
            told in prop::collection::vec(any::<bool>(), 12 * 12 * 3),
        ) {
            let values: Vec<[f64; 3]> = rows.iter().map(|r| r.map(f64::from)).collect();
            let is_less = |a: usize, b: usize, k: usize| told[(a * 12 + b) * 3 + k];
            let found = dominance(&values, &is_less);
            for (i, own) in found.iter().enumerate() {
                let better = |k: usize| (0..3).all(|d| values[k][d] <= values[i][d]) && values[k] != values[i];
                prop_assert_eq!(own.is_none(), !(0..values.len()).any(better));
                let Some(own) = own else { continue };
                prop_assert!(found[own.by].is_none() && better(own.by));
                // What is no better than something beaten is beaten.
                let beaten = |k: usize| found[k].is_some_and(|d| d.is_shown);
                let below_beaten = (0..values.len()).any(|k| better(k) && beaten(k));
                prop_assert!(own.is_shown || !below_beaten);
            }
        }
    }

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
