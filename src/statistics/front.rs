//! The Pareto front, of any dimensions that are samples.

/// How a point stands to the front.
#[derive(Clone, Copy, PartialEq, Eq, Default, Debug)]
pub struct Standing {
    /// A point of the front that is no worse in anything and better in something,
    /// where the samples show that the point is dominated; `None` on the front.
    pub dominated_by: Option<usize>,
    /// Dominated by the values, which the samples do not show: it shares the front.
    pub is_tie: bool,
}

/// Dominance among points by their values, as many for each; less is better. The
/// front is what nothing is shown to dominate: which of two equals came out ahead is luck.
///
/// `is_less(a, b, k)` says whether the samples show `a` to be better than `b` in
/// dimension `k`; it is called only where the values say so. That a point is
/// dominated is shown if a point that is no worse than it (itself, or one that is
/// as good or better by all values) is shown to be worse in some dimension than a
/// point that is no worse than that one. So dominance is transitive, as it is by
/// the values alone, and a point that is only known less well is protected by it
/// neither from the front's points nor from those that they dominate. O(n^2).
pub fn dominance<V: AsRef<[f64]>>(
    values: &[V],
    is_less: &dyn Fn(usize, usize, usize) -> bool,
) -> Vec<Standing> {
    let all = 0..values.len();
    let pairs = |a: usize, b: usize| values[a].as_ref().iter().zip(values[b].as_ref());
    let no_worse = |a: usize, b: usize| pairs(a, b).all(|(a, b)| a <= b);
    let less = |a: usize, b: usize| pairs(a, b).map(|(a, b)| a < b).enumerate();
    let better = |a: usize, b: usize| no_worse(a, b) && less(a, b).any(|(_, is_less)| is_less);
    let shown =
        |a: usize, b: usize| better(a, b) && less(a, b).any(|(k, less)| less && is_less(a, b, k));
    let on_front = |&a: &usize| !all.clone().any(|b| better(b, a));
    let front: Vec<usize> = all.clone().filter(on_front).collect();
    // Those of the front first: they dominate most.
    let is_beaten = |b: usize| {
        let rivals = front.iter().copied().chain(all.clone());
        rivals.into_iter().any(|a| shown(a, b))
    };
    let beaten: Vec<usize> = all.clone().filter(|&b| is_beaten(b)).collect();
    let of = |c: usize| {
        let by = front.iter().copied().find(|&a| better(a, c));
        let is_shown = beaten.iter().any(|&b| no_worse(b, c));
        Standing {
            dominated_by: by.filter(|_| is_shown),
            is_tie: by.is_some() && !is_shown,
        }
    };
    all.clone().map(of).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    #[test]
    fn what_is_not_told_apart_shares_the_front() {
        // Error and time; the third is slower but too noisy to be told apart.
        let values = [[5.0, 10.0], [5.0, 12.0], [5.0, 11.0], [0.0, 30.0]];
        let told = |a: usize, b: usize, _: usize| a != 2 && b != 2;
        let found = dominance(&values, &told);
        let front = Standing::default();
        let tie = Standing {
            is_tie: true,
            ..front
        };
        let beaten = Standing {
            dominated_by: Some(0),
            ..front
        };
        assert_eq!(found, [front, beaten, tie, front]);
        // Worse than one that is shown to be worse.
        let values = [[5.0, 10.0], [5.0, 12.0], [5.0, 13.0]];
        assert_eq!(dominance(&values, &told), [front, beaten, beaten]);
        // Equal points stand beside each other.
        assert_eq!(dominance(&[[1.0], [1.0]], &|_, _, _| true), [front; 2]);
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
                let by_values = own.is_tie || own.dominated_by.is_some();
                prop_assert_eq!(by_values, (0..values.len()).any(better));
                if let Some(by) = own.dominated_by {
                    prop_assert!(found[by] == Standing::default() && better(by));
                }
                // What is no better than something beaten is beaten.
                let beaten = |k: usize| found[k].dominated_by.is_some();
                let below_beaten = (0..values.len()).any(|k| better(k) && beaten(k));
                prop_assert!(beaten(i) || !below_beaten);
            }
        }
    }
}
