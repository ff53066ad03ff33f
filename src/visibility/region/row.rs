//! The back ends of the region stage: their table, and each over a graph.
//!
//! Pairs of regions that may see each other are a set per region, as a map claims.

use std::sync::Arc;

use super::graph::{RegionGraph, RegionId};
use super::search::Search;
use crate::index::IdSet;
use crate::kernel::extend;
use crate::scene::{Regions, Scene};
use crate::visibility::{Guarantee, Rays, Row};

/// A potentially visible set: regions seen from each region, itself among them.
///
/// One allocation for each region: reading a row of one table with offsets takes half again
/// as long.
#[derive(Clone, PartialEq, Eq, Debug)]
pub struct Pvs {
    /// Ascending, a row for each region.
    pub rows: Box<[Box<[RegionId]>]>,
}

/// Most regions of a set.
const MOST_REGIONS: usize = 1 << 16;

impl Pvs {
    /// The REJECT table of a Doom map: bit `from * sectors + to`, lowest bit of a
    /// byte first, is 1 where a monster in sector `from` cannot see sector `to`.
    ///
    /// `None` for fewer bits than pairs of sectors, or too many sectors.
    pub fn from_reject(bytes: &[u8], sectors: usize) -> Option<Pvs> {
        let is_whole = bytes.len() >= sectors.saturating_mul(sectors).div_ceil(8);
        let is_hidden = |from: u32, to: u32| {
            let bit = from as usize * sectors + to as usize;
            bytes[bit / 8] >> (bit % 8) & 1 == 1
        };
        is_whole.then(|| Pvs::of_pairs(sectors, |from, to| !is_hidden(from, to)))?
    }

    /// All pairs of regions that a table has; each region sees itself.
    ///
    /// `None` for too many regions.
    pub fn of_pairs(regions: usize, sees: impl Fn(u32, u32) -> bool) -> Option<Pvs> {
        let all = 0..regions as u32;
        let row = |from| {
            all.clone()
                .filter(|&to| from == to || sees(from, to))
                .collect()
        };
        (regions <= MOST_REGIONS).then(|| Pvs {
            rows: all.clone().map(row).collect(),
        })
    }

    /// The regions that a region sees, ascending.
    pub fn row(&self, from: RegionId) -> &[RegionId] {
        &self.rows[from as usize]
    }
}

/// A row of the table of back ends.
///
/// The guarantee is of answers from an eye in the world of regions and openings (hiding by
/// items aside).
pub type BackEnd = Row<Source>;

/// Source of the answers of a back end.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum Source {
    /// A search with rectangles of the image.
    PortalRect,
    /// The table of a Quake III map.
    Claim,
    /// The REJECT table of a map.
    Reject,
}

/// All back ends of the region stage.
pub const BACK_ENDS: &[BackEnd] = rows! { BackEnd { name, build, guarantee, summary }
    "portal-rect", Source::PortalRect, Guarantee::Conservative,
        "rectangles of the image, intersected from opening to opening";
    "stored-pvs", Source::Claim, Guarantee::Unproven,
        "the row of the eye's region in the map's own table";
    "reject", Source::Reject, Guarantee::Unproven,
        "the row of the eye's sector in the map's REJECT table";
};

impl BackEnd {
    /// Tests whether a scene has the regions that the back end needs.
    pub fn is_for(&self, scene: &Scene) -> bool {
        match (&scene.regions, self.build) {
            (Regions::Tiling(_), Source::PortalRect) | (Regions::Leaves(_), Source::Claim) => true,
            (Regions::Bsp(map), Source::PortalRect | Source::Reject) => map.disputes().is_empty(),
            _ => false,
        }
    }
}

/// A back end over a graph.
#[derive(Clone, Debug)]
pub struct RegionRow {
    /// Its row of the table.
    pub back_end: BackEnd,
    /// The graph that it searches.
    pub graph: Arc<RegionGraph>,
    /// Stored pairs; `None` for a search.
    pub pvs: Option<Arc<Pvs>>,
}

/// Memory that queries use again and again.
#[derive(Clone, Default, Debug)]
pub struct Scratch {
    homes: Vec<RegionId>,
    seen: IdSet,
    search: Search,
}

impl RegionRow {
    /// A back end that searches, or reads stored pairs of as many regions.
    pub fn of(source: Source, graph: &Arc<RegionGraph>, pvs: Option<Arc<Pvs>>) -> RegionRow {
        let row = BACK_ENDS.iter().find(|row| row.build == source);
        RegionRow {
            back_end: *row.expect("a row for every source"),
            graph: graph.clone(),
            pvs,
        }
    }

    /// Replaces `out` by the regions that a camera may see, ascending.
    ///
    /// Returns `false`, with all regions in `out`, if the eye is not wholly in regions or the
    /// lens is orthographic.
    #[allow(clippy::wrong_self_convention)] // Regions seen from an eye, not a conversion.
    pub fn from_eye(&self, rays: &Rays, scratch: &mut Scratch, out: &mut Vec<RegionId>) -> bool {
        let graph = &*self.graph;
        let Scratch {
            homes,
            seen,
            search,
        } = scratch;
        out.clear();
        if !graph.homes(rays, homes) {
            out.extend(0..graph.len() as u32);
            return false;
        }
        if let (Some(pvs), [home]) = (&self.pvs, &homes[..]) {
            extend(out, pvs.row(*home));
            return true;
        }
        seen.clear(graph.len());
        match &self.pvs {
            Some(pvs) => seen.insert_all(homes.iter().flat_map(|&home| pvs.row(home))),
            None => search.run(graph, rays, homes, seen),
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
        // Bit 1 (0 to 1) and bit 8 (2 to 2, which sees itself all the same).
        let pvs = Pvs::from_reject(&[0b10, 0b1], 3).unwrap();
        assert_eq!(pvs.row(0), [0, 2]);
        assert_eq!((pvs.row(1), pvs.row(2)), (&[0, 1, 2][..], &[0, 1, 2][..]));
        assert_eq!(Pvs::from_reject(&[0], 3), None, "a byte for nine pairs");
    }
}
