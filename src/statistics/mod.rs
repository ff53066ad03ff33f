//! The statistics of a report: quantiles, intervals, tests, verdicts, ranks.
//! Pure functions of numbers; each names its source. Nothing else in the crate
//! computes an interval.

pub mod flat;
mod judgement;
mod means;
mod one_run;
mod ranking;
mod rate;
mod student;
#[cfg(test)]
mod tests_simulation;
mod trimmed;
mod unpaired;

pub use judgement::{Change, Judgement, judge, resolved};
pub use means::two_speeds;
pub use means::{geometric_mean, interquartile_mean};
pub use means::{median, quantile, sorted};
pub use one_run::{Estimate, one_run, ratio, speedup};
pub use ranking::{ALPHA, is_less, ranks};
pub use ranking::{Standing, dominance};
pub use rate::{Rate, rate, rate_of, shows_less, shows_less_in_sum};
pub use student::slope;
pub use trimmed::{Trimmed, centre, trimmed_mean};
pub use unpaired::judge_unpaired;
