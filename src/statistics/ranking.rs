//! Ranks of structures that ran in the same processes.

use super::trimmed::{centre, paired_difference};

/// Level at which two are told apart.
pub const ALPHA: f64 = 0.05;

/// Ranks structures by their trimmed means, 1 for the smallest. Two that share rank
/// 1 are followed by rank 3. Per structure: one value per process, all from the same
/// processes, paired by index.
///
/// A structure shares the rank of the fastest of that rank unless Yuen's paired
/// test over the processes tells the two apart (two-sided, `alpha`). Under three
/// processes nothing can be tested, and each has a rank of its own by order.
/// Equal means are ordered by index, a structure with no values or with one
/// that is not finite comes last: the ranks are the same for the same input.
pub fn ranks(values: &[Vec<f64>], alpha: f64) -> Vec<usize> {
    let means: Vec<f64> = values
        .iter()
        .map(|values| centre(values).unwrap_or(f64::INFINITY))
        .collect();
    let mut order: Vec<usize> = (0..values.len()).collect();
    order.sort_by(|&a, &b| means[a].total_cmp(&means[b]));
    let mut ranks = vec![0; values.len()];
    let mut leader: Option<(usize, usize)> = None;
    for (&i, place) in order.iter().zip(1..) {
        let shared = leader.filter(|(first, _)| !told_apart(&values[*first], &values[i], alpha));
        leader = shared.or(Some((i, place)));
        ranks[i] = leader.map_or(place, |(_, rank)| rank);
    }
    ranks
}

/// Returns true if a paired test over the processes finds `a` less than `b`
/// (Yuen's, two-sided, `alpha`); under three processes, if its trimmed mean is
/// less.
pub fn is_less(a: &[f64], b: &[f64], alpha: f64) -> bool {
    let means = centre(a).zip(centre(b));
    means.is_some_and(|(a, b)| a < b) && told_apart(a, b, alpha)
}

fn told_apart(leader: &[f64], other: &[f64], alpha: f64) -> bool {
    match paired_difference(leader, other) {
        Some(difference) => difference.p_above(0.0) <= alpha / 2.0,
        None => true,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

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
    fn less_is_what_a_test_finds_and_order_where_none_is_possible() {
        let level = |shift: f64| vec![shift, shift + 0.1, shift - 0.1, shift];
        assert!(is_less(&level(1.0), &level(2.0), 0.05));
        assert!(!is_less(&level(2.0), &level(1.0), 0.05));
        // The same on the mean, and in every process another order.
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
            for (i, a) in placed.iter().enumerate() {
                let before = placed.iter().filter(|b| *b < a).count();
                prop_assert_eq!(*a, before + 1);
                for (k, b) in placed.iter().enumerate() {
                    prop_assert!(a >= b || means[i] <= means[k]);
                }
            }
        }
    }
}
