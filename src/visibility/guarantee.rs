//! Guarantees of the answers of a stage's back ends.

use serde::Serialize;

named! {
    /// Guarantee that a back end declares of its answers and that tests check.
    #[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, Debug, Serialize)]
    #[serde(rename_all = "kebab-case")]
    #[non_exhaustive]
    pub enum Guarantee {
        /// The visible set itself.
        Exact = "exact",
        /// A superset of the items that are visible along any ray.
        Conservative = "conservative",
        /// The set that the rays of a sample grid see.
        SampleExact = "sample-exact",
        /// Nothing: visible items may be missing.
        Unproven = "unproven",
    }
}

impl Guarantee {
    /// Returns `true` if no visible item is ever missing.
    pub fn is_safe(self) -> bool {
        matches!(self, Guarantee::Exact | Guarantee::Conservative)
    }
}
