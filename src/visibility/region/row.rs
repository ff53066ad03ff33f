//! The back ends of the region stage: their table, and each over a graph.
//!
//! Pairs of regions that may see each other are a set per region, as a file claims.

use std::sync::Arc;

use serde::Deserialize;

use super::graph::RegionGraph;
use super::id_set::{IdSet, RegionId};
use super::search::{Flood, PortalClip, PortalRect, Search};
use crate::json::from_json;
use crate::kernel::extend;
use crate::scene::{Regions, Scene};
use crate::visibility::{Guarantee, Rays, Row};

/// A potentially visible set: for each region the set of regions seen from it.
#[derive(Clone, PartialEq, Eq, Debug)]
pub struct Pvs {
    rows: Vec<IdSet>,
}

/// Reason for which bytes are no potentially visible set, in a line.
#[derive(Debug, thiserror::Error)]
#[error("{0}")]
pub struct PvsError(String);

const FORM: &str = "{\"regions\": COUNT, \"sees\": [[FROM, TO], ...]}";

/// Its form in a file: ordered pairs.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Written {
    regions: usize,
    sees: Vec<[RegionId; 2]>,
}

/// Most regions of a set: half a gigabyte of bits.
const MOST_REGIONS: usize = 1 << 16;

impl Pvs {
    /// Each region sees itself alone. O(n^2) bits.
    pub fn alone(regions: usize) -> Pvs {
        let row = |region| {
            let mut row = IdSet::default();
            row.clear(regions);
            row.insert(region);
            row
        };
        Pvs {
            rows: (0..regions as u32).map(row).collect(),
        }
    }

    /// Reads `{"regions": COUNT, "sees": [[FROM, TO], ...]}`; each region sees
    /// itself, whether that is written or not.
    ///
    /// # Errors
    /// Other JSON, or a region that is not there.
    pub fn from_json(text: impl AsRef<[u8]>) -> Result<Pvs, PvsError> {
        let written: Written = from_json(text.as_ref()).map_err(|error| {
            let (place, expected) = (error.place(), error.expected_of(FORM));
            PvsError(format!("{place}: {}; expected {expected}", error.found))
        })?;
        let regions = written.regions;
        if regions > MOST_REGIONS {
            let message = format!("{regions} regions; expected at most {MOST_REGIONS}");
            return Err(PvsError(message));
        }
        let mut pvs = Pvs::alone(regions);
        for (pair, [from, to]) in written.sees.into_iter().enumerate() {
            let region = from.max(to);
            if region as usize >= regions {
                return Err(PvsError(format!(
                    "pair {pair}: region {region} is out of range; expected less than {regions}"
                )));
            }
            pvs.insert(from, to);
        }
        Ok(pvs)
    }

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
        let mut pvs = (regions <= MOST_REGIONS).then(|| Pvs::alone(regions))?;
        let all = 0..regions as u32;
        for from in all.clone() {
            let seen = all.clone().filter(|&to| sees(from, to));
            seen.for_each(|to| pvs.insert(from, to));
        }
        Some(pvs)
    }

    /// Number of regions.
    pub fn len(&self) -> usize {
        self.rows.len()
    }

    /// Tests whether there are no regions.
    pub fn is_empty(&self) -> bool {
        self.rows.is_empty()
    }

    /// The regions that a region sees.
    pub fn row(&self, from: RegionId) -> &IdSet {
        &self.rows[from as usize]
    }

    /// Adds a pair, in this direction only.
    pub fn insert(&mut self, from: RegionId, to: RegionId) {
        self.rows[from as usize].insert(to);
    }
}

/// A row of the table of back ends.
///
/// The guarantee is of answers from an eye in the world of regions and openings (hiding by
/// items aside).
pub type BackEnd = Row<Source>;

/// Source of the answers of a back end.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
#[non_exhaustive]
pub enum Source {
    /// A search that takes each opening by itself.
    Flood,
    /// A search with rectangles of the image.
    PortalRect,
    /// A search with clipped openings.
    PortalClip,
    /// Pairs of regions read from a file, or the table of a Quake III map.
    Claim,
    /// The REJECT table of a map.
    Reject,
}

/// All back ends of the region stage.
pub const BACK_ENDS: &[BackEnd] = rows! { BackEnd { name, build, guarantee, summary }
    "flood", Source::Flood, Guarantee::Conservative,
        "regions reached through openings that meet the view volume";
    "portal-rect", Source::PortalRect, Guarantee::Conservative,
        "rectangles of the image, intersected from opening to opening";
    "portal-clip", Source::PortalClip, Guarantee::Conservative,
        "openings clipped as convex polygons by those before them";
    "stored-pvs", Source::Claim, Guarantee::Unproven,
        "the row of the eye's region in a set of pairs, the map's own or read from a file";
    "reject", Source::Reject, Guarantee::Unproven,
        "the row of the eye's sector in the map's REJECT table";
};

impl BackEnd {
    /// Tests whether a scene has the regions that the back end needs.
    pub fn is_for(&self, scene: &Scene) -> bool {
        match (&scene.regions, self.build) {
            (Regions::Tiling(_), source) => source != Source::Reject,
            (Regions::Leaves(_), source) => source == Source::Claim,
            (Regions::Bsp(map), _) => map.disputes().is_empty(),
            _ => false,
        }
    }
}

/// Place of the eye of an answer.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
#[non_exhaustive]
pub enum EyePlace {
    /// In regions: the answer is the regions seen from them.
    Inside,
    /// Not wholly in regions (or the lens is orthographic): all regions are listed.
    Outside,
}

/// A back end over a graph.
#[derive(Clone, Debug)]
pub struct RegionRow {
    /// Its row of the table.
    pub back_end: BackEnd,
    /// The graph that it searches.
    pub graph: Arc<RegionGraph>,
    pairs: Option<Stored>,
}

/// Pairs of regions, as bits and as lists.
#[derive(Clone, Debug)]
struct Stored {
    pvs: Arc<Pvs>,
    /// List of each region.
    ///
    /// One allocation each: reading a row of one table with offsets takes half again as long.
    lists: Box<[Box<[RegionId]>]>,
}

/// Memory that queries use again and again.
#[derive(Clone, Default, Debug)]
pub struct Scratch {
    homes: Vec<RegionId>,
    seen: IdSet,
    flood: Search<Flood, ()>,
    portal_rect: Search<PortalRect, [f64; 4]>,
    portal_clip: Search<PortalClip, [u32; 2]>,
}

impl RegionRow {
    /// A back end that searches.
    ///
    /// # Panics
    /// If the source is a set of pairs.
    pub fn search(source: Source, graph: Arc<RegionGraph>) -> RegionRow {
        let searches = [Source::Flood, Source::PortalRect, Source::PortalClip];
        assert!(searches.contains(&source), "{source:?} needs pairs");
        RegionRow::of(source, graph, None)
    }

    /// A back end that reads stored pairs; `None` if they are of another number of
    /// regions.
    pub fn stored(source: Source, graph: Arc<RegionGraph>, pvs: Arc<Pvs>) -> Option<RegionRow> {
        let list = |from| {
            let mut seen = Vec::new();
            pvs.row(from).list(&mut seen);
            seen.into_boxed_slice()
        };
        let lists = (0..pvs.len() as u32).map(list).collect();
        (pvs.len() == graph.len())
            .then(|| RegionRow::of(source, graph, Some(Stored { lists, pvs })))
    }

    fn of(source: Source, graph: Arc<RegionGraph>, pairs: Option<Stored>) -> RegionRow {
        let row = BACK_ENDS.iter().find(|row| row.build == source);
        RegionRow {
            back_end: *row.expect("a row for every source"),
            graph,
            pairs,
        }
    }

    /// Replaces `out` by the regions that a camera may see, ascending.
    #[allow(clippy::wrong_self_convention)] // Regions seen from an eye, not a conversion.
    pub fn from_eye(
        &self,
        rays: &Rays,
        scratch: &mut Scratch,
        out: &mut Vec<RegionId>,
    ) -> EyePlace {
        let graph = &*self.graph;
        let Scratch { homes, seen, .. } = scratch;
        out.clear();
        if !graph.homes(rays, homes) {
            out.extend(0..graph.len() as u32);
            return EyePlace::Outside;
        }
        if let (Some(pairs), [home]) = (&self.pairs, &homes[..]) {
            extend(out, &pairs.lists[*home as usize]);
            return EyePlace::Inside;
        }
        seen.clear(graph.len());
        match (&self.pairs, self.back_end.build) {
            (Some(Stored { pvs, .. }), _) => {
                homes
                    .iter()
                    .for_each(|&home| seen.insert_all(pvs.row(home)));
            }
            (None, Source::Flood) => scratch.flood.run(graph, rays, homes, seen),
            (None, Source::PortalRect) => scratch.portal_rect.run(graph, rays, homes, seen),
            (None, _) => scratch.portal_clip.run(graph, rays, homes, seen),
        }
        seen.list(out);
        EyePlace::Inside
    }

    /// Stored regions that are seen from a region, ascending; none of a search.
    pub fn stored_from(&self, region: RegionId) -> &[RegionId] {
        let pairs = self.pairs.as_ref();
        pairs.map_or(&[], |pairs| &pairs.lists[region as usize])
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn pairs_are_read_and_each_region_sees_itself() {
        let pvs = Pvs::from_json(r#"{"regions":70,"sees":[[3,69],[69,4]]}"#).unwrap();
        let mut wanted = Pvs::alone(70);
        wanted.insert(3, 69);
        wanted.insert(69, 4);
        assert_eq!(pvs, wanted);
        assert!(pvs.row(3).holds(69) && !pvs.row(69).holds(3));
        let mut row = Vec::new();
        pvs.row(69).list(&mut row);
        assert_eq!(row, [4, 69]);
    }

    #[test]
    fn other_files_are_typed_errors() {
        let error = |text: &str| Pvs::from_json(text).unwrap_err().to_string();
        assert!(error("[]").contains("expected {\"regions\""));
        assert!(
            error(r#"{"regions":2,"sees":[[0,2]]}"#)
                .contains("pair 0: region 2 is out of range; expected less than 2")
        );
        assert!(error(r#"{"regions":1,"sees":[],"more":1}"#).contains("more"));
        assert!(error(r#"{"regions":99999,"sees":[]}"#).contains("at most 65536"));
    }

    #[test]
    fn a_reject_bit_hides_and_bits_run_on_over_rows() {
        // Bit 1 (0 to 1) and bit 8 (2 to 2, which sees itself all the same).
        let pvs = Pvs::from_reject(&[0b10, 0b1], 3).unwrap();
        assert!(!pvs.row(0).holds(1) && pvs.row(1).holds(0) && pvs.row(2).holds(2));
        let rows = [0, 1, 2].map(|from| [0, 1, 2].map(|to| pvs.row(from).holds(to)));
        assert_eq!(rows, [[true, false, true], [true; 3], [true; 3]]);
        assert_eq!(Pvs::from_reject(&[0], 3), None, "a byte for nine pairs");
    }
}
