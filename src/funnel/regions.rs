//! Regions of a scene, with the back ends that find visible regions among them.

use std::sync::Arc;

use crate::scene::{self, Dispute, Scene};
use crate::visibility::region::doom::DoomMap;
use crate::visibility::region::{BACK_ENDS, Pvs, RegionGraph, RegionItems, RegionRow, Source};

/// Rooms of a scene, or sectors or clusters of its map.
pub struct Regions {
    /// Regions and the openings between them.
    pub graph: Arc<RegionGraph>,
    /// Items of each region.
    pub items: RegionItems,
    rows: Vec<RegionRow>,
}

impl Regions {
    /// Back ends of a scene; `Err` without regions, with the dispute of a map whose
    /// linedefs contradict each other.
    pub fn of(scene: &Scene) -> Result<Regions, Option<Dispute>> {
        let map = DoomMap::of_scene(scene);
        let graph = Arc::new(match (&map, &scene.regions) {
            (Some(map), _) => map.graph().map_err(Some)?,
            (None, scene::Regions::Leaves(map)) => RegionGraph::of_quake(map),
            (None, _) => RegionGraph::of_scene(scene).map_err(|_| None)?,
        });
        let searches = [Source::Flood, Source::PortalRect, Source::PortalClip];
        let is_for = |source| {
            BACK_ENDS
                .iter()
                .any(|row| row.source == source && row.is_for(scene))
        };
        let mut regions = Regions {
            rows: searches
                .into_iter()
                .filter(|&source| is_for(source))
                .map(|source| RegionRow::search(source, graph.clone()))
                .collect(),
            items: RegionItems::of(&graph, scene),
            graph,
        };
        if let Some(reject) = map.and_then(|map| map.reject()) {
            regions.store(Arc::new(reject), Source::Reject);
        }
        if let scene::Regions::Leaves(map) = &scene.regions
            && let Some(seen) = Pvs::of_quake(map)
        {
            regions.store(Arc::new(seen), Source::Claim);
        }
        Ok(regions)
    }

    /// Adds a claimed table, in place of the map's own.
    ///
    /// False if it has another number of regions.
    pub fn claim(&mut self, claim: &Arc<Pvs>) -> bool {
        self.store(claim.clone(), Source::Claim)
    }

    fn store(&mut self, pvs: Arc<Pvs>, source: Source) -> bool {
        let row = RegionRow::stored(source, self.graph.clone(), pvs);
        let fits = row.is_some();
        self.rows
            .retain(|row| row.back_end.source != source || !fits);
        self.rows.extend(row);
        fits
    }

    /// The back end of a name.
    pub fn row(&self, name: &str) -> Option<&RegionRow> {
        self.rows.iter().find(|row| row.back_end.name == name)
    }
}
