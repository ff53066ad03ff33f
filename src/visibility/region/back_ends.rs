//! Back ends of the region stage: their table, and their answers over a graph.
//!
//! The pairs of regions that a map claims to be visible are stored as one set per region.

use super::graph::{RegionGraph, RegionId};
use super::search::Search;
use crate::index::IdSet;
use crate::kernel::extend;
use crate::scene::{Regions, Scene};
use crate::visibility::{Guarantee, Rays, Row};

/// Potentially visible set: the regions visible from each region and itself.
///
/// One allocation per region: reading a row of a single table with offsets takes half again as
/// long.
#[derive(Clone, PartialEq, Eq, Debug)]
pub struct Pvs {
    /// Visible regions of each region, ascending.
    pub rows: Box<[Box<[RegionId]>]>,
}

/// Most regions of a set.
const MOST_REGIONS: usize = 1 << 16;

impl Pvs {
    /// Reads the REJECT table of a Doom map.
    ///
    /// Bit `from * sectors + to`, least significant bit of a byte first, is 1 if a monster in
    /// sector `from` cannot see sector `to`. `None` if there are fewer bits than pairs of sectors,
    /// or too many sectors.
    pub fn from_reject(bytes: &[u8], sectors: usize) -> Option<Pvs> {
        let is_whole = bytes.len() >= sectors.saturating_mul(sectors).div_ceil(8);
        let is_hidden = |from: u32, to: u32| {
            let bit = from as usize * sectors + to as usize;
            bytes[bit / 8] >> (bit % 8) & 1 == 1
        };
        is_whole.then(|| Pvs::of_pairs(sectors, |from, to| !is_hidden(from, to)))?
    }

    /// Set of all pairs that satisfy `sees`; each region sees itself.
    ///
    /// `None` for too many regions.
    pub fn of_pairs(regions: usize, sees: impl Fn(u32, u32) -> bool) -> Option<Pvs> {
        let all = 0..regions as u32;
        let row = |from| {
            let seen = all.clone().filter(|&to| from == to || sees(from, to));
            seen.collect()
        };
        (regions <= MOST_REGIONS).then(|| Pvs {
            rows: all.clone().map(row).collect(),
        })
    }

    /// Regions visible from a region, ascending.
    pub fn row(&self, from: RegionId) -> &[RegionId] {
        &self.rows[from as usize]
    }
}

/// Row of the table of back ends.
///
/// `build` tests whether a scene has the regions that the back end needs. The guarantee is for an
/// eye in the world of regions and openings (occlusion by items aside).
pub type BackEnd = Row<fn(&Scene) -> bool>;

/// All back ends of the region stage.
pub const BACK_ENDS: &[BackEnd] = rows! { BackEnd { name, build, guarantee, summary }
    "portal-rect", |scene| matches!(scene.regions, Regions::Tiling(_)) || has_sectors(scene),
        Guarantee::Conservative, "rectangles of the image, intersected from opening to opening";
    "stored-pvs", |scene| matches!(scene.regions, Regions::Leaves(_)), Guarantee::Unproven,
        "the row of the eye's region in the map's own table";
    "reject", has_sectors, Guarantee::Unproven,
        "the row of the eye's sector in the map's REJECT table";
};

fn has_sectors(scene: &Scene) -> bool {
    matches!(&scene.regions, Regions::Bsp(map) if map.disputes().is_empty())
}

/// Memory reused from query to query.
#[derive(Clone, Default, Debug)]
pub struct Scratch {
    homes: Vec<RegionId>,
    seen: IdSet,
    search: Search,
}

impl RegionGraph {
    /// Replaces `out` by the regions that a camera may see, ascending.
    ///
    /// Reads the stored pairs of `pvs`, for the same number of regions, or searches without them.
    /// Returns `false`, with all regions in `out`, if the eye is not wholly in regions or the lens
    /// is orthographic.
    pub fn seen_by(
        &self,
        rays: &Rays,
        pvs: Option<&Pvs>,
        scratch: &mut Scratch,
        out: &mut Vec<RegionId>,
    ) -> bool {
        let (homes, seen) = (&mut scratch.homes, &mut scratch.seen);
        out.clear();
        if !self.homes(rays, homes) {
            out.extend(0..self.len() as u32);
            return false;
        }
        if let (Some(pvs), [home]) = (pvs, &homes[..]) {
            extend(out, pvs.row(*home));
            return true;
        }
        seen.clear(self.len());
        match pvs {
            Some(pvs) => seen.insert_all(homes.iter().flat_map(|&home| pvs.row(home))),
            None => scratch.search.run(self, rays, homes, seen),
        }
        seen.list(out);
        true
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_reject_bit_hides_and_bits_run_on_over_rows() {
        // Bit 1 (0 to 1) and bit 8 (2 to 2; a sector sees itself regardless).
        let pvs = Pvs::from_reject(&[0b10, 0b1], 3).unwrap();
        assert_eq!(pvs.row(0), [0, 2]);
        assert_eq!((pvs.row(1), pvs.row(2)), (&[0, 1, 2][..], &[0, 1, 2][..]));
        assert_eq!(Pvs::from_reject(&[0], 3), None, "a byte for nine pairs");
    }
}
