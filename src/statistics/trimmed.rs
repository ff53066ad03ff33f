//! The 20 % trimmed mean with its standard error, and variances shared by cells.

use serde::{Deserialize, Serialize};

use super::means::{mean, squares};
use super::{median, sorted, student};

/// Share of the values that is cut off at each end.
const TRIM: f64 = 0.2;

/// Degrees of freedom that the other cells' variances are worth to a cell.
///
/// Smyth estimates them; measured over cells of one comparison: about 8.
const PRIOR_DF: f64 = 8.0;

/// A 20 % trimmed mean with the standard error that Student's t needs.
///
/// The standard error is Yuen's: values beyond the cut are replaced by the outermost kept ones
/// (Winsorised), and their sum of squares is divided by h(h - 1), with h values kept and h - 1
/// degrees of freedom (Yuen 1974, "The two-sample trimmed t for unequal population variances", sec.
/// 2; Wilcox 2017, "Introduction to Robust Estimation and Hypothesis Testing", sec. 4.3). With
/// nothing to trim (fewer than five values) this is the plain mean and its t.
#[derive(Clone, Copy, PartialEq, Debug, Serialize, Deserialize)]
pub struct Trimmed {
    /// Mean of the kept values.
    pub mean: f64,
    /// Standard error of `mean`.
    pub standard_error: f64,
    /// Degrees of freedom of the standard error.
    pub df: f64,
    /// Number of values, those beyond the cut included.
    pub count: usize,
}

impl Trimmed {
    /// The two-sided interval of Student's t; `level` such as 0.95.
    pub fn interval(&self, level: f64) -> (f64, f64) {
        let margin = self.margin(0.5 + level / 2.0);
        (self.mean - margin, self.mean + margin)
    }

    /// One-sided p of the hypothesis "the mean is at most `x`".
    pub fn p_above(&self, x: f64) -> f64 {
        match self.mean - x {
            // Without any spread 0 / 0 must not become a NaN.
            0.0 => 0.5,
            distance => student::upper_tail(distance / self.standard_error, self.df),
        }
    }

    /// One-sided p of the hypothesis "the mean is at least `x`".
    pub fn p_below(&self, x: f64) -> f64 {
        let mut mirrored = *self;
        mirrored.mean = -self.mean;
        mirrored.p_above(-x)
    }

    /// Student's quantile of `p` times the standard error.
    pub(super) fn margin(&self, p: f64) -> f64 {
        student::quantile(p, self.df) * self.standard_error
    }
}

/// The 20 % trimmed mean. `None` below three values, or for a NaN or infinity.
///
/// ```
/// // One process of ten had a bad day; it does not move the mean.
/// let values = [1.0, 1.1, 0.9, 1.0, 1.2, 0.8, 1.0, 1.1, 0.9, 40.0];
/// let found = cullbench::measure::trimmed_mean(&values).unwrap();
/// assert!((found.mean - 1.0).abs() < 0.02);
/// ```
pub fn trimmed_mean(values: &[f64]) -> Option<Trimmed> {
    let mean = centre(values).filter(|_| values.len() >= 3)?;
    let kept = kept(values.len());
    Some(Trimmed {
        mean,
        standard_error: (squares(&winsorised(values)) / (kept * (kept - 1.0))).sqrt(),
        df: kept - 1.0,
        count: values.len(),
    })
}

/// The trimmed mean alone, for any number of values.
///
/// `None` for no values, a NaN or an infinity.
pub fn centre(values: &[f64]) -> Option<f64> {
    if values.is_empty() || !values.iter().all(|value| value.is_finite()) {
        return None;
    }
    let (cut, sorted) = (cut(values.len()), sorted(values.to_vec()));
    let inner = &sorted[cut..sorted.len() - cut];
    // Rounding may move the mean of equal values beyond them.
    Some(mean(inner).clamp(inner[0], inner[inner.len() - 1]))
}

/// The difference of two independent trimmed means, `new` - `old`.
///
/// With the standard error and the degrees of freedom of Welch's test (Yuen 1974, sec. 2; Wilcox
/// 2017, sec. 5.3).
pub(super) fn difference(old: &Trimmed, new: &Trimmed) -> Trimmed {
    let (a, b) = (old.standard_error.powi(2), new.standard_error.powi(2));
    let welch = (a + b).powi(2) / (a * a / old.df + b * b / new.df);
    let pooled = old.df + new.df;
    Trimmed {
        mean: new.mean - old.mean,
        standard_error: (a + b).sqrt(),
        df: if welch.is_finite() { welch } else { pooled },
        count: old.count.min(new.count),
    }
}

/// Shrinks the variances of one comparison's cells towards their median.
///
/// se² becomes (8 median(se²) + df se²) / (8 + df), and df grows by 8. From ten processes a
/// standard error is a rough estimate. The cells of one comparison share machine and method, so
/// their median is the better one, and it is worth eight degrees of freedom (Smyth 2004, "Linear
/// models and empirical Bayes methods ...", sec. 4, with a fixed prior). It is never worth more
/// than the other cells have together: a single cell is unchanged, since its own variance adds no
/// information about itself.
pub(super) fn moderate(cells: &mut [Trimmed]) {
    let variances: Vec<f64> = cells.iter().map(|c| c.standard_error.powi(2)).collect();
    let Some(typical) = median(&variances) else {
        return;
    };
    let all: f64 = cells.iter().map(|cell| cell.df).sum();
    for cell in cells {
        let prior = PRIOR_DF.min(all - cell.df);
        let variance = cell.standard_error.powi(2);
        let df = prior + cell.df;
        cell.standard_error = ((prior * typical + cell.df * variance) / df).sqrt();
        cell.df = df;
    }
}

/// Number of values cut off at each end of `count`.
fn cut(count: usize) -> usize {
    (TRIM * count as f64).floor() as usize
}

/// Number of values kept of `count`: Yuen's h.
pub(super) fn kept(count: usize) -> f64 {
    (count - 2 * cut(count)) as f64
}

/// The sorted values, those beyond the cut replaced by the outermost kept ones.
fn winsorised(values: &[f64]) -> Vec<f64> {
    let (cut, sorted) = (cut(values.len()), sorted(values.to_vec()));
    let (low, high) = (sorted[cut], sorted[sorted.len() - 1 - cut]);
    values.iter().map(|value| value.clamp(low, high)).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn near(found: f64, wanted: f64) {
        assert!((found - wanted).abs() < 1e-6, "{found}, not {wanted}");
    }

    /// 1 to 9 and an outlier: 3 to 8 are kept.
    const VALUES: [f64; 10] = [7.0, 1.0, 900.0, 2.0, 5.0, 3.0, 8.0, 4.0, 9.0, 6.0];

    #[test]
    fn the_standard_error_is_yuens() {
        // Winsorised: 3 3 3 4 5 6 7 8 8 8, squares about 5.5: 42.5, h (h-1) = 30.
        let found = trimmed_mean(&VALUES).unwrap();
        assert_eq!((found.mean, found.df, found.count), (5.5, 5.0, 10));
        near(found.standard_error, 1.190_238);
        let (lower, upper) = found.interval(0.95);
        near(lower, 5.5 - 2.570_582 * 1.190_238);
        near(upper, 5.5 + 2.570_582 * 1.190_238);
        near(found.p_above(lower), 0.025);
        near(found.p_below(upper), 0.025);
        near(found.p_below(lower), 0.975);
    }

    #[test]
    fn three_values_have_students_plain_interval() {
        // Mean 2, deviation 1: t.test(c(1, 2, 3)) in R has 2 -+ 2.484138.
        let found = trimmed_mean(&[3.0, 1.0, 2.0]).unwrap();
        near(found.interval(0.95).1, 4.484_138);
        assert_eq!(trimmed_mean(&[1.0, 2.0]), None);
        assert_eq!(trimmed_mean(&[]), None);
        assert_eq!(trimmed_mean(&[1.0, f64::NAN, 2.0]), None);
        assert_eq!(trimmed_mean(&[1.0, f64::INFINITY, 2.0]), None);
    }

    #[test]
    fn equal_values_are_certain() {
        let found = trimmed_mean(&[0.125; 10]).unwrap();
        assert_eq!(found.interval(0.95), (0.125, 0.125));
        assert_eq!([0.0, 0.125, 0.2].map(|x| found.p_above(x)), [0.0, 0.5, 1.0]);
        assert_eq!([0.0, 0.125, 0.2].map(|x| found.p_below(x)), [1.0, 0.5, 0.0]);
    }

    fn cell(standard_error: f64, df: f64) -> Trimmed {
        Trimmed {
            mean: 1.0,
            standard_error,
            df,
            count: 10,
        }
    }

    #[test]
    fn independent_differences_are_welchs() {
        let mut new = cell(2.0, 9.0);
        new.mean = 4.0;
        let found = difference(&cell(1.0, 5.0), &new);
        near(found.mean, 3.0);
        near(found.standard_error, 5f64.sqrt());
        near(found.df, 25.0 / (1.0 / 5.0 + 16.0 / 9.0));
        near(difference(&cell(0.0, 5.0), &cell(0.0, 5.0)).df, 10.0);
    }

    #[test]
    fn variances_are_drawn_to_their_median() {
        let mut cells = [cell(1.0, 5.0), cell(3.0, 5.0), cell(2.0, 5.0)];
        moderate(&mut cells);
        near(cells[0].standard_error.powi(2), (8.0 * 4.0 + 5.0) / 13.0);
        near(cells[1].standard_error.powi(2), (8.0 * 4.0 + 45.0) / 13.0);
        near(cells[2].standard_error, 2.0);
        assert_eq!(cells.map(|cell| cell.df), [13.0; 3]);
        // Two cells: neither gains more than the other has. One cell: nothing.
        let mut cells = [cell(1.0, 5.0), cell(3.0, 5.0)];
        moderate(&mut cells);
        near(cells[0].standard_error.powi(2), (5.0 * 5.0 + 5.0) / 10.0);
        let mut cells = [cell(1.0, 5.0)];
        moderate(&mut cells);
        assert_eq!(cells, [cell(1.0, 5.0)]);
        moderate(&mut []);
    }

    proptest! {
        #[test]
        fn trimmed_means_lie_in_their_intervals(
            values in prop::collection::vec(-1e3..1e3f64, 3..40), level in 0.01..0.999f64
        ) {
            let found = trimmed_mean(&values).unwrap();
            let (lower, upper) = found.interval(level);
            prop_assert!(lower <= found.mean && found.mean <= upper);
            let mirrored: Vec<f64> = values.iter().map(|v| -v).collect();
            let mirrored = trimmed_mean(&mirrored).unwrap();
            prop_assert!((mirrored.p_above(1.0) - found.p_below(-1.0)).abs() < 1e-9);
        }
    }
}
