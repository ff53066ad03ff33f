//! The back ends of the region stage: their table, and each over a graph.

use std::sync::Arc;

use super::graph::RegionGraph;
use super::id_set::{IdSet, RegionId};
use super::pvs::Pvs;
use super::search::{Flood, PortalClip, PortalRect, Search};
use crate::kernel::extend;
use crate::scene::{Regions, Scene};
use crate::visibility::{Guarantee, Rays};

/// A row of the table of back ends.
#[derive(Clone, Copy, Debug)]
#[non_exhaustive]
pub struct BackEnd {
    /// Name as typed.
    pub name: &'static str,
    /// One line for tables and help.
    pub summary: &'static str,
    /// Promise about its answers from an eye, in the world of regions and openings
    /// (hiding by items aside).
    pub guarantee: Guarantee,
    /// Source of its answers.
    pub source: Source,
}

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
pub const BACK_ENDS: &[BackEnd] = rows! { BackEnd { name, source, guarantee, summary }
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
        match (&scene.regions, self.source) {
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
        let row = BACK_ENDS.iter().find(|row| row.source == source);
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
        match (&self.pairs, self.back_end.source) {
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
