//! A line of sight that shows that one region sees another, and what proves such
//! lines. The search for them is elsewhere; checking one is `Ground::check`.

use glam::DVec3;
use serde::{Deserialize, Serialize};

use super::answer::RegionId;
use super::pvs::Pvs;

/// A segment from within one region to within another, strictly through openings.
#[derive(Clone, Copy, PartialEq, Debug, Serialize, Deserialize)]
pub struct Witness {
    /// The regions of its two ends.
    pub regions: [RegionId; 2],
    /// World coordinates of the ends, to be taken as they are, without an error.
    pub ends: [DVec3; 2],
}

/// Why a witness is not accepted.
#[derive(Clone, Copy, PartialEq, Eq, Debug, thiserror::Error)]
#[non_exhaustive]
pub enum Rejected {
    /// A region that the graph has not.
    #[error("a region that is not there")]
    Region,
    /// An end is not strictly within its region.
    #[error("end {0} is not strictly within its region")]
    End(usize),
    /// The segment meets a border where there is no opening, or touches its edge.
    #[error("the segment leaves region {0} where there is no opening")]
    Blocked(RegionId),
}

/// A set of visible pairs together with what proves them.
pub trait ProvenPvs {
    /// All pairs that are proven visible or could not be decided; what it lacks is
    /// proven invisible.
    fn pvs(&self) -> &Pvs;

    /// A line of sight between two regions; `None` where there is none, or none was
    /// found.
    fn witness(&self, from: RegionId, to: RegionId) -> Option<Witness>;
}
