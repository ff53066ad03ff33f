//! A time as it is written: with its interval, or not at all.

use serde::Serialize;

use crate::statistics::Estimate;

/// A time with its interval; null where there is none.
#[derive(Clone, Copy, Default, PartialEq, Debug, Serialize)]
pub struct Times {
    /// Mean over the views.
    pub stage_ns: Option<f64>,
    /// Lower end of the 95 % interval.
    pub stage_ns_lower: Option<f64>,
    /// Upper end of the 95 % interval.
    pub stage_ns_upper: Option<f64>,
}

impl Times {
    /// Of an estimate, where there is one.
    pub fn of(found: Option<Estimate>) -> Times {
        let Some(found) = found else {
            return Times::default();
        };
        Times {
            stage_ns: Some(found.value),
            stage_ns_lower: found.lower,
            stage_ns_upper: found.upper,
        }
    }
}
