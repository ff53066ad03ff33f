//! Holm's step-down procedure: many tests, one error rate.

/// Which hypotheses are rejected so that the chance of even one false rejection
/// among all of them is at most `alpha` (Holm 1979, "A simple sequentially
/// rejective multiple test procedure", sec. 2). A NaN is never rejected, but
/// counts as a test.
///
/// ```
/// use cullbench::statistics::holm;
/// // 0.01 <= 0.05 / 3, 0.02 <= 0.05 / 2, 0.06 > 0.05 / 1.
/// assert_eq!(holm(&[0.02, 0.06, 0.01], 0.05), [true, false, true]);
/// ```
pub fn holm(p: &[f64], alpha: f64) -> Vec<bool> {
    let mut order: Vec<usize> = (0..p.len()).collect();
    order.sort_by(|&a, &b| p[a].total_cmp(&p[b]));
    let mut rejected = vec![false; p.len()];
    for (step, &i) in order.iter().enumerate() {
        let small_enough = p[i] <= alpha / (p.len() - step) as f64;
        if !small_enough {
            break;
        }
        rejected[i] = true;
    }
    rejected
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    #[test]
    fn the_procedure_stops_at_the_first_that_fails() {
        // 0.01 <= .05/4, 0.02 > .05/3: then 0.03 <= .05/1 does not count.
        let p = [0.03, 0.02, 0.01, 0.9];
        assert_eq!(holm(&p, 0.05), [false, false, true, false]);
        assert_eq!(holm(&[0.01, f64::NAN], 0.05), [true, false]);
        assert_eq!(holm(&[0.03, f64::NAN], 0.05), [false, false]);
        assert!(holm(&[], 0.05).is_empty());
    }

    proptest! {
        #[test]
        fn a_smaller_p_is_never_worse_and_bonferroni_never_better(
            p in prop::collection::vec(0.0..0.1f64, 1..20), which in 0..20usize
        ) {
            let before = holm(&p, 0.05);
            let which = which % p.len();
            let mut smaller = p.clone();
            smaller[which] /= 2.0;
            for (i, after) in holm(&smaller, 0.05).into_iter().enumerate() {
                prop_assert!(after || !before[i]);
                prop_assert!(before[i] || p[i] > 0.05 / p.len() as f64);
                prop_assert!(!before[i] || p[i] <= 0.05);
                for k in 0..p.len() {
                    prop_assert!(before[k] || !before[i] || p[i] <= p[k]);
                }
            }
        }
    }
}
