//! [`UpdatePolicy`]: when an index is refitted and when it is built again.

use std::fmt;
use std::str::FromStr;

use crate::spec::{SpecError, parse_number};

/// Work of a frame after items have moved.
#[derive(Clone, Copy, PartialEq, Default, Debug)]
#[non_exhaustive]
pub enum UpdatePolicy {
    /// A refit; a new build only where the structure cannot refit.
    #[default]
    Refit,
    /// A new build in every frame.
    Rebuild,
    /// A new build in every n-th frame, refits in the others.
    Every(u32),
    /// Bounds enlarged by this part of an item's size on each side.
    ///
    /// Only items that have left theirs are updated; queries return false positives.
    Fat(f64),
}

impl fmt::Display for UpdatePolicy {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            UpdatePolicy::Refit => f.write_str("refit"),
            UpdatePolicy::Rebuild => f.write_str("rebuild"),
            UpdatePolicy::Every(frames) => write!(f, "every={frames}"),
            UpdatePolicy::Fat(margin) => write!(f, "fat={margin}"),
        }
    }
}

impl FromStr for UpdatePolicy {
    type Err = SpecError;

    fn from_str(text: &str) -> Result<Self, SpecError> {
        let (name, value) = text.split_once('=').unwrap_or((text, ""));
        let whole = || value.parse().ok().filter(|n| (2..=1_000_000).contains(n));
        let margin = || parse_number(value).filter(|m| *m > 0.0 && *m <= 100.0);
        let found = match name {
            "refit" | "rebuild" if text != name => None,
            "refit" => Some(UpdatePolicy::Refit),
            "rebuild" => Some(UpdatePolicy::Rebuild),
            "every" => whole().map(UpdatePolicy::Every),
            "fat" => margin().map(UpdatePolicy::Fat),
            _ => None,
        };
        found.ok_or_else(|| {
            SpecError::new(format_args!(
                "--update '{text}'; expected refit, rebuild, every=N (frames, at least 2) or \
                 fat=M (margin in item sizes, above 0)"
            ))
        })
    }
}
