//! The Pareto front, of any dimensions that are samples.

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
}
