//! The regions of a scene for the funnel: every back end that its data allow.

use std::sync::Arc;

use super::back_ends::has_exact;
use super::error::FunnelError;
use crate::scene::Scene;
use crate::visibility::region::doom::DoomMap;
use crate::visibility::region::{
    EXACT, Pvs, REJECT, RegionGraph, RegionItems, RegionRow, STORED, Searched, StoredPvs,
};

/// The regions of a scene and what finds a way through them.
pub(super) struct Regions {
    graph: Arc<RegionGraph>,
    items: RegionItems,
    rows: Vec<Box<dyn RegionRow>>,
}

impl Regions {
    /// `None` for a scene without any, such as a map whose linedefs disagree.
    ///
    /// # Errors
    /// A claim of other regions, or about a map whose linedefs disagree.
    pub fn of(scene: &Scene, claim: Option<&Arc<Pvs>>) -> Result<Option<Regions>, FunnelError> {
        let map = DoomMap::of_scene(scene);
        let graph = match &map {
            Some(map) => match map.graph() {
                Err(dispute) if claim.is_some() => {
                    return Err(FunnelError::Disputed {
                        scene: scene.name.clone(),
                        dispute,
                    });
                }
                graph => graph.ok(),
            },
            None => RegionGraph::of_scene(scene).ok(),
        };
        let Some(graph) = graph.map(Arc::new) else {
            return Ok(None);
        };
        let mut rows: Vec<Box<dyn RegionRow>> = vec![
            Box::new(Searched::flood(graph.clone())),
            Box::new(Searched::portal_rect(graph.clone())),
            Box::new(Searched::portal_clip(graph.clone())),
        ];
        let reject = map.and_then(|map| map.reject());
        let exact = has_exact(scene).then(|| Pvs::of_rooms(&graph).ok());
        let stored = [
            (reject.map(Arc::new), REJECT),
            (claim.cloned(), STORED),
            (exact.flatten().map(Arc::new), EXACT),
        ];
        for (pvs, about) in stored {
            let Some(pvs) = pvs else { continue };
            let claimed = pvs.len();
            let row = StoredPvs::of(graph.clone(), pvs, about);
            let regions = graph.len();
            rows.push(Box::new(
                row.ok_or(FunnelError::Claim { claimed, regions })?,
            ));
        }
        Ok(Some(Regions {
            items: RegionItems::of(&graph, scene),
            graph,
            rows,
        }))
    }

    /// What all back ends search.
    pub fn graph(&self) -> &RegionGraph {
        &self.graph
    }

    /// Which items are in which region.
    pub fn items(&self) -> &RegionItems {
        &self.items
    }

    /// The back ends that there are.
    pub fn names(&self) -> impl Iterator<Item = &'static str> {
        self.rows.iter().map(|row| row.about().name)
    }

    /// A back end by its name.
    pub fn row(&self, name: &str) -> Option<&dyn RegionRow> {
        let found = self.rows.iter().find(|row| row.about().name == name);
        found.map(|row| &**row)
    }
}
