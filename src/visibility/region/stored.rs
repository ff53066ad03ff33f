//! A stored set of visible regions as a row: the union of the rows of the regions
//! that the eye is in.

use std::sync::Arc;

use super::answer::{About, EyePlace, RegionId, RegionRow, Scratch, decode};
use super::graph::RegionGraph;
use super::pvs::Pvs;
use crate::kernel::extend;
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
    /// The rows as lists: what is read is what is answered. One allocation a region, not one
    /// table with offsets: reading a row takes two thirds of the time.
    lists: Box<[Box<[RegionId]>]>,
    about: About,
}

impl StoredPvs {
    /// The row that declares `about` of such a set. `None` if it is of another number
    /// of regions.
    pub fn of(graph: Arc<RegionGraph>, pvs: Arc<Pvs>, about: About) -> Option<StoredPvs> {
        if pvs.len() != graph.len() {
            return None;
        }
        let seen = |from| {
            let mut seen = Vec::new();
            decode(pvs.row(from), &mut seen);
            seen.into_boxed_slice()
        };
        Some(StoredPvs {
            lists: (0..pvs.len() as u32).map(seen).collect(),
            graph,
            pvs,
            about,
        })
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
            [home] => extend(out, &self.lists[home as usize]),
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

    fn stored(&self, region: RegionId) -> &[RegionId] {
        &self.lists[region as usize]
    }
}
