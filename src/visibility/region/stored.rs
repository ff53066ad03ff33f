//! A stored set of visible regions as a row: the union of the rows of the regions
//! that the eye is in.

use std::sync::Arc;

use super::answer::{EyePlace, RegionId, RegionRow, Scratch, decode};
use super::graph::RegionGraph;
use super::pvs::Pvs;
use crate::visibility::{Guarantee, Rays};

/// As the row is typed that reads a file of pairs.
pub const NAME: &str = "stored-pvs";
/// One line of what it does.
pub const SUMMARY: &str = "the row of the eye's region in a set of pairs read from a file";
/// What a claim promises: nothing.
pub const GUARANTEE: Guarantee = Guarantee::Unproven;
/// As the row is typed that reads a Doom map's REJECT table.
pub const REJECT_NAME: &str = "reject";
/// One line of what it does.
pub const REJECT_SUMMARY: &str = "the row of the eye's sector in the map's REJECT table";
/// As the row is typed whose pairs are found by an exact search.
pub const EXACT_NAME: &str = "exact-pvs";
/// One line of what it does.
pub const EXACT_SUMMARY: &str = "regions seen from anywhere in the eye's region, exactly";
/// What it promises: nothing that is seen through the inside of openings is missing.
pub const EXACT_GUARANTEE: Guarantee = Guarantee::Conservative;

/// The row.
#[derive(Clone, Debug)]
pub struct StoredPvs {
    graph: Arc<RegionGraph>,
    pvs: Arc<Pvs>,
    /// The rows as lists: what is read is what is answered.
    starts: Vec<u32>,
    lists: Vec<RegionId>,
    name: &'static str,
    summary: &'static str,
    guarantee: Guarantee,
}

impl StoredPvs {
    /// A claim: nothing is promised of it. `None` if it is of another number of
    /// regions.
    pub fn claim(graph: Arc<RegionGraph>, pvs: Arc<Pvs>) -> Option<StoredPvs> {
        StoredPvs::of(graph, pvs, NAME, SUMMARY, GUARANTEE)
    }

    /// The same of a REJECT table.
    pub fn reject(graph: Arc<RegionGraph>, pvs: Arc<Pvs>) -> Option<StoredPvs> {
        StoredPvs::of(graph, pvs, REJECT_NAME, REJECT_SUMMARY, GUARANTEE)
    }

    /// What an exact search has found. It promises no region missing that is seen
    /// through the inside of openings.
    pub fn exact(graph: Arc<RegionGraph>, pvs: Arc<Pvs>) -> Option<StoredPvs> {
        StoredPvs::of(
            graph,
            pvs,
            EXACT_NAME,
            EXACT_SUMMARY,
            Guarantee::Conservative,
        )
    }

    fn of(
        graph: Arc<RegionGraph>,
        pvs: Arc<Pvs>,
        name: &'static str,
        summary: &'static str,
        guarantee: Guarantee,
    ) -> Option<StoredPvs> {
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
            name,
            summary,
            guarantee,
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
    fn name(&self) -> &'static str {
        self.name
    }

    fn summary(&self) -> &'static str {
        self.summary
    }

    fn guarantee(&self) -> Guarantee {
        self.guarantee
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
