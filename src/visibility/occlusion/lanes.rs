//! Which lanes of a row are in use.

use crate::kernel::{LANES, LaneMask};

/// The first `count` lanes, all of them from sixteen on.
#[inline(always)]
pub fn first_lanes(count: usize) -> LaneMask {
    if count >= LANES {
        LaneMask::MAX
    } else {
        (1 << count) - 1
    }
}
