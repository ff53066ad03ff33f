//! Regions of a scene, with the back ends that find visible regions among them.

use std::cell::OnceCell;
use std::sync::Arc;

use super::back_ends::has_exact;
use crate::scene::{Dispute, Scene};
use crate::visibility::region::doom::DoomMap;
use crate::visibility::region::{
    About, EXACT, Pvs, REJECT, RegionGraph, RegionItems, RegionRow, STORED, Searched, StoredPvs,
};

/// Rooms of a scene or sectors of its map.
pub struct Regions {
    /// Regions and the openings between them.
    pub graph: Arc<RegionGraph>,
    /// Items of each region.
    pub items: RegionItems,
    rows: Vec<Box<dyn RegionRow>>,
    has_exact: bool,
    /// The exact table, computed when it is first used.
    exact: OnceCell<Option<StoredPvs>>,
}

impl Regions {
    /// Back ends of a scene; `Err` without regions, with the dispute of a map whose
    /// linedefs contradict each other.
    pub fn of(scene: &Scene) -> Result<Regions, Option<Dispute>> {
        let map = DoomMap::of_scene(scene);
        let graph = Arc::new(match &map {
            Some(map) => map.graph().map_err(Some)?,
            None => RegionGraph::of_scene(scene).map_err(|_| None)?,
        });
        let mut regions = Regions {
            rows: vec![
                Box::new(Searched::flood(graph.clone())),
                Box::new(Searched::portal_rect(graph.clone())),
                Box::new(Searched::portal_clip(graph.clone())),
            ],
            items: RegionItems::of(&graph, scene),
            graph,
            has_exact: has_exact(scene),
            exact: OnceCell::new(),
        };
        if let Some(reject) = map.and_then(|map| map.reject()) {
            regions.store(Arc::new(reject), REJECT);
        }
        Ok(regions)
    }

    /// Adds a claimed table; false if it has another number of regions.
    pub fn claim(&mut self, claim: &Arc<Pvs>) -> bool {
        self.store(claim.clone(), STORED)
    }

    fn store(&mut self, pvs: Arc<Pvs>, about: About) -> bool {
        let row = StoredPvs::of(self.graph.clone(), pvs, about);
        let fits = row.is_some();
        self.rows
            .extend(row.map(|row| Box::new(row) as Box<dyn RegionRow>));
        fits
    }

    /// The back end of a name.
    pub fn row(&self, name: &str) -> Option<&dyn RegionRow> {
        if name == EXACT.name {
            let exact = self.exact.get_or_init(|| {
                let exact = self.has_exact.then(|| Pvs::of_rooms(&self.graph).ok());
                let pvs = exact.flatten()?;
                StoredPvs::of(self.graph.clone(), Arc::new(pvs), EXACT)
            });
            return exact.as_ref().map(|row| row as &dyn RegionRow);
        }
        let found = self.rows.iter().find(|row| row.about().name == name);
        found.map(|row| &**row)
    }
}
