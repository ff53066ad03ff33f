//! A stored set of visible regions as a row: the union of the rows of the regions
//! that the eye is in.

use std::sync::Arc;

use super::answer::{About, EyePlace, RegionId, RegionRow, Scratch, decode};
use super::graph::RegionGraph;
use super::pvs::Pvs;
use crate::visibility::{Guarantee, Rays};

/// The row that reads a file of pairs: a claim promises nothing.
pub const ABOUT: About = About {
    name: "stored-pvs",
    summary: "the row of the eye's region in a set of pairs read from a file",
    guarantee: Guarantee::Unproven,
};

/// The row that reads a Doom map's REJECT table, a claim as well.
pub const REJECT: About = About {
    name: "reject",
    summary: "the row of the eye's sector in the map's REJECT table",
    guarantee: Guarantee::Unproven,
};

/// The row whose pairs are found by an exact search: nothing that is seen through the
/// inside of openings is missing.
pub const EXACT: About = About {
    name: "exact-pvs",
    summary: "regions seen from anywhere in the eye's region, exactly",
    guarantee: Guarantee::Conservative,
};

/// The row.
#[derive(Clone, Debug)]
pub struct StoredPvs {
    graph: Arc<RegionGraph>,
    pvs: Arc<Pvs>,
    /// The rows as lists: what is read is what is answered.
    starts: Vec<u32>,
    lists: Vec<RegionId>,
    about: About,
}

impl StoredPvs {
    /// A claim: nothing is promised of it. `None` if it is of another number of
    /// regions.
    pub fn claim(graph: Arc<RegionGraph>, pvs: Arc<Pvs>) -> Option<StoredPvs> {
        StoredPvs::of(graph, pvs, ABOUT)
    }

    /// The same of a REJECT table.
    pub fn reject(graph: Arc<RegionGraph>, pvs: Arc<Pvs>) -> Option<StoredPvs> {
        StoredPvs::of(graph, pvs, REJECT)
    }

    /// What an exact search has found. It promises no region missing that is seen
    /// through the inside of openings.
    pub fn exact(graph: Arc<RegionGraph>, pvs: Arc<Pvs>) -> Option<StoredPvs> {
        StoredPvs::of(graph, pvs, EXACT)
    }

    fn of(graph: Arc<RegionGraph>, pvs: Arc<Pvs>, about: About) -> Option<StoredPvs> {
        if pvs.len() != graph.len() {
            return None;
        }
        let (mut starts, mut lists) = (vec![0], Vec::new());
        for from in 0..pvs.len() as u32 {
            decode(pvs.row(from), &mut lists);
            starts.push(lists.len() as u32);
        }
        Some(StoredPvs {
            graph,
            pvs,
            starts,
            lists,
            about,
        })
    }

    /// The pairs.
    pub fn pvs(&self) -> &Pvs {
        &self.pvs
    }

    /// What a region sees, ascending. O(1).
    pub fn list(&self, from: RegionId) -> &[RegionId] {
        let at = from as usize;
        &self.lists[self.starts[at] as usize..self.starts[at + 1] as usize]
    }
}

impl RegionRow for StoredPvs {
    fn about(&self) -> About {
        self.about
    }

    fn graph(&self) -> &Arc<RegionGraph> {
        &self.graph
    }

    fn from_eye(&self, rays: &Rays, scratch: &mut Scratch, out: &mut Vec<RegionId>) -> EyePlace {
        out.clear();
        if !self.graph.homes(rays, &mut scratch.homes) {
            out.extend(0..self.graph.len() as u32);
            return EyePlace::Outside;
        }
        match scratch.homes[..] {
            [home] => out.extend_from_slice(self.list(home)),
            _ => {
                scratch.seen.clear(self.graph.len());
                for &home in &scratch.homes {
                    scratch.seen.insert_all(self.pvs.row(home));
                }
                scratch.seen.list(out);
            }
        }
        EyePlace::Inside
    }

    fn from_region(&self, region: RegionId, out: &mut Vec<RegionId>) {
        out.clear();
        out.extend_from_slice(self.list(region));
    }
}
