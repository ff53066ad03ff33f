//! The statistics of a report: quantiles, intervals, tests, verdicts, ranks.
//! Pure functions of numbers; each names its source. Nothing else in the crate
//! computes an interval.

pub mod flat;
mod front;
mod holm;
mod judgement;
mod means;
mod one_run;
mod quantiles;
mod ranking;
mod rate;
mod slope;
mod speeds;
mod student;
#[cfg(test)]
mod tests_simulation;
mod trimmed;
mod unpaired;

pub use front::{Standing, dominance};
pub use holm::holm;
pub use judgement::{Change, Judgement, judge, resolved};
pub use means::{geometric_mean, interquartile_mean};
pub use one_run::{Estimate, one_run, ratio, speedup};
pub use quantiles::{median, quantile, sorted};
pub use ranking::{ALPHA, is_less, ranks};
pub use rate::{Rate, rate, shows_less, shows_less_in_sum};
pub use slope::slope;
pub use speeds::two_speeds;
pub use trimmed::{Trimmed, moderate, trimmed_mean};
pub use unpaired::judge_unpaired;
