//! [`Answer`]: number of ids and a digest that does not depend on their order.

use serde::{Deserialize, Serialize};

use crate::query::ItemId;

/// A set of ids, so far as two answers are compared by it.
#[derive(Clone, Copy, Default, PartialEq, Eq, Debug, Serialize, Deserialize)]
#[cfg_attr(test, derive(schemars::JsonSchema))]
pub struct Answer {
    /// Number of ids.
    pub count: u64,
    /// Sum over the ids of a hash of each: the order does not matter.
    pub digest: u64,
}

impl Answer {
    /// The answer that consists of these ids, in any order.
    pub fn of(ids: &[ItemId]) -> Answer {
        /// SplitMix64's finaliser (Steele, Lea and Flood 2014).
        fn mixed(id: ItemId) -> u64 {
            let mut z = u64::from(id).wrapping_add(0x9E37_79B9_7F4A_7C15);
            z = (z ^ (z >> 30)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
            z = (z ^ (z >> 27)).wrapping_mul(0x94D0_49BB_1331_11EB);
            z ^ (z >> 31)
        }
        Answer {
            count: ids.len() as u64,
            digest: ids.iter().fold(0, |all, &id| all.wrapping_add(mixed(id))),
        }
    }
}

/// Sum of the ids, the checksum that `query` and `locate` print.
pub fn id_sum(ids: &[ItemId]) -> u64 {
    ids.iter().map(|&id| u64::from(id)).sum()
}
