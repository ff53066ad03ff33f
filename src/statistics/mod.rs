//! The statistics of a report: quantiles, intervals, tests, verdicts, ranks.
//!
//! Pure functions of numbers; each names its source. All intervals of the crate are computed here.

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
pub use means::{geometric_mean, interquartile_mean, median, quantile, sorted, two_speeds};
pub use one_run::{Estimate, about, one_run, ratio, speedup};
pub use ranking::{ALPHA, dominance, is_less, ranks};
pub use rate::{rate_of, shows_less};
pub use student::slope;
pub use trimmed::{Trimmed, centre, trimmed_mean};
pub use unpaired::judge_unpaired;
