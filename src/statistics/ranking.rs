//! Ranks of structures that ran in the same processes, and Pareto fronts.

use super::one_run::paired_difference;
use super::trimmed::centre;

/// Level at which two structures differ significantly.
pub const ALPHA: f64 = 0.05;

/// Ranks structures by their trimmed means, 1 for the smallest.
///
/// Two structures that share rank 1 are followed by rank 3. Per structure: one value per process,
/// all from the same processes, paired by index.
///
/// A structure shares the first rank whose fastest member does not differ from it significantly, in
/// a paired test over the processes with the error of the reported intervals (two-sided, `alpha`).
/// Below three processes nothing can be tested, and ranks follow the order. Equal means are ordered
/// by index; a structure without values, or with one that is not finite, comes last. Ranks are
/// deterministic.
pub fn ranks(values: &[Vec<f64>], alpha: f64) -> Vec<usize> {
    let mean = |values: &Vec<f64>| centre(values).unwrap_or(f64::INFINITY);
    let means: Vec<f64> = values.iter().map(mean).collect();
    let mut order: Vec<usize> = (0..values.len()).collect();
    order.sort_by(|&a, &b| means[a].total_cmp(&means[b]));
    // The fastest of each rank first, followed by those that share the rank.
    let mut shared: Vec<Vec<usize>> = Vec::new();
    for i in order {
        let is_tied = |group: &&mut Vec<usize>| !told_apart(&values[group[0]], &values[i], alpha);
        match shared.iter_mut().find(is_tied) {
            Some(group) => group.push(i),
            None => shared.push(vec![i]),
        }
    }
    let (mut ranks, mut rank) = (vec![0; values.len()], 1);
    for group in shared {
        group.iter().for_each(|&i| ranks[i] = rank);
        rank += group.len();
    }
    ranks
}

/// Returns true if a paired test over the processes finds `a` less than `b`.
///
/// Two-sided at `alpha`; below three processes, if its trimmed mean is less.
pub fn is_less(a: &[f64], b: &[f64], alpha: f64) -> bool {
    let means = centre(a).zip(centre(b));
    means.is_some_and(|(a, b)| a < b) && told_apart(a, b, alpha)
}

fn told_apart(leader: &[f64], other: &[f64], alpha: f64) -> bool {
    let difference = paired_difference(other, leader);
    difference.is_none_or(|found| found.p_above(0.0) <= alpha / 2.0)
}

/// Relation of a point to the front.
#[derive(Clone, Copy, PartialEq, Eq, Default, Debug)]
pub struct Standing {
    /// A point of the front that dominates this one; `None` on the front.
    ///
    /// No worse in any dimension and better in one, as the samples show.
    pub dominated_by: Option<usize>,
    /// Dominated by value, but not shown by the samples: shares the front.
    pub is_tie: bool,
}

/// Dominance among points by their values; less is better.
///
/// All points have the same number of values. The front is what nothing is shown to dominate, since
/// the order of two equals is chance.
///
/// `is_less(a, b, k)` tests whether the samples show `a` to be better than `b` in dimension `k`; it
/// is called only if the values say so. Let A be dominated, by its values, by a point of the front.
/// A is shown to be dominated if some point B, no worse than A by all values (A itself included),
/// is dominated by a third one and shown to be worse than it in some dimension. So dominance is
/// transitive, as it is by the values alone, and a point with noisy samples protects itself neither
/// from the front's points nor from those that they dominate. O(n^2).
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
    // Points of the front first: they dominate most.
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
    use super::super::one_run::ratio;
    use super::*;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn a_rank_of_its_own_is_where_the_interval_shown_leaves_out_1(
            rows in prop::collection::vec((0.0..1.0f64, -0.1..0.1f64, -0.1..0.1f64), 3..20),
            shift in 0.0..0.2f64,
        ) {
            let of = |own: fn(&(f64, f64, f64)) -> f64| rows.iter().map(own).collect::<Vec<f64>>();
            let base = of(|row| row.0);
            let (mut a, mut b) = (of(|row| row.0 + row.1), of(|row| row.0 + row.2));
            b.iter_mut().for_each(|b| *b += shift);
            if centre(&a) > centre(&b) {
                std::mem::swap(&mut a, &mut b);
            }
            let less = |own: &[f64]| own.iter().zip(&base).map(|(own, base)| own - base).collect();
            let shown = ratio(&base, &a, &b).unwrap();
            let relative: [Vec<f64>; 2] = [less(&a), less(&b)];
            // The reported ratio is that of the trimmed means relative to the base.
            let order = [centre(&relative[0]), centre(&relative[1])];
            prop_assume!(order[0] < order[1]);
            let is_apart = ranks(&relative, ALPHA) == [1, 2];
            prop_assert_eq!(is_apart, shown.upper.unwrap() < 1.0);
        }
    }

    #[test]
    fn ranks_are_shared_unless_the_processes_tell_them_apart() {
        // Processes differ far more than the structures within them.
        let base: Vec<f64> = (0..10).map(|p| f64::from(p * p)).collect();
        let noisy = |shift: f64, swing: f64| -> Vec<f64> {
            let swing = |p: usize| if p.is_multiple_of(2) { swing } else { -swing };
            let values = base.iter().enumerate();
            values.map(|(p, b)| b + shift + swing(p)).collect()
        };
        let values = [noisy(0.5, 0.0), base.clone(), noisy(0.01, 0.3)];
        assert_eq!(ranks(&values, 0.05), [3, 1, 1]);
        // One process: by order. A structure that did not run comes last.
        let values = [vec![2.0], vec![1.0], vec![], vec![1.0]];
        assert_eq!(ranks(&values, 0.05), [3, 1, 4, 2]);
        assert_eq!(ranks(&[], 0.05), [0; 0]);
    }

    #[test]
    fn what_is_not_told_apart_from_the_fastest_shares_its_rank() {
        let steady = |shift: f64| vec![shift; 10];
        let unsteady: Vec<f64> = (0..10).map(|p| f64::from(p % 2) * 4.0 - 1.8).collect();
        let values = [steady(0.0), steady(0.1), unsteady];
        assert_eq!(ranks(&values, 0.05), [1, 3, 1]);
    }

    #[test]
    fn less_is_what_a_test_finds_and_order_where_none_is_possible() {
        let level = |shift: f64| vec![shift, shift + 0.1, shift - 0.1, shift];
        assert!(is_less(&level(1.0), &level(2.0), 0.05));
        assert!(!is_less(&level(2.0), &level(1.0), 0.05));
        // Equal on average, in a different order in each process.
        let swinging = [1.4, 0.7, 0.8, 1.2];
        assert!(!is_less(&level(1.0), &swinging, 0.05) && !is_less(&swinging, &level(1.0), 0.05));
        assert!(is_less(&[1.0], &[1.1], 0.05) && !is_less(&[1.0], &[1.0], 0.05));
        assert!(!is_less(&[], &[1.0], 0.05) && !is_less(&[1.0], &[], 0.05));
    }

    proptest! {
        #[test]
        fn ranks_are_total_and_keep_the_order(
            rows in prop::collection::vec(prop::collection::vec(-3.0..3.0f64, 6), 1..9)
        ) {
            let placed = ranks(&rows, 0.05);
            let means: Vec<f64> = rows.iter().map(|row| centre(row).unwrap()).collect();
            for a in &placed {
                let before = placed.iter().filter(|b| *b < a).count();
                prop_assert_eq!(*a, before + 1);
                // The fastest of a rank precedes all of later ranks.
                let own = (0..rows.len()).filter(|k| placed[*k] == *a);
                let fastest = own.map(|k| means[k]).fold(f64::INFINITY, f64::min);
                let mut later = (0..rows.len()).filter(|k| placed[*k] > *a);
                prop_assert!(later.all(|k| fastest <= means[k]));
            }
        }
    }

    #[test]
    fn what_is_not_told_apart_shares_the_front() {
        // Error and time; the third is slower but too noisy to differ significantly.
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
        // Equal points share the front.
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
                // A point no better than a beaten one is beaten.
                let beaten = |k: usize| found[k].dominated_by.is_some();
                let below_beaten = (0..values.len()).any(|k| better(k) && beaten(k));
                prop_assert!(beaten(i) || !below_beaten);
            }
        }
    }
}
