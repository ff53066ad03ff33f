//! The regions of a scene for the funnel: every back end that its data allow, and the
//! audit of what a map claims of them.

use std::sync::Arc;

use serde::Serialize;

use super::back_ends::MOST_EXACT_ROOMS;
use super::error::FunnelError;
use crate::input::InputError;
use crate::scene::Scene;
use crate::visibility::region::doom::{DoomMap, SectorPvs};
use crate::visibility::region::{
    Audit, Flood, OtherRegions, PortalClip, PortalRect, ProvenPvs, Pvs, REJECT, RegionGraph,
    RegionItems, RegionRow, RoomsPvs, STORED, StoredPvs, audit,
};

/// The regions of a scene and what finds a way through them.
pub(super) struct Regions {
    rows: Vec<Box<dyn RegionRow>>,
    /// Which items are in which.
    pub items: RegionItems,
    /// What claims of what is seen from where get wrong.
    pub audits: Vec<ClaimAudit>,
}

/// A claim of which regions see which, and what is wrong with it.
#[derive(Clone, PartialEq, Debug, Serialize)]
#[non_exhaustive]
pub struct ClaimAudit {
    /// The back end that reads it.
    pub claim: &'static str,
    /// Against what is proven.
    #[serde(flatten)]
    pub audit: Audit,
}

/// The regions of a scene, and the table that its own file claims to be what is seen
/// from where; `None` for a scene without regions.
///
/// # Errors
/// The map's file, read a second time.
pub fn regions_of(scene: &Scene) -> Result<Option<(RegionGraph, Option<Pvs>)>, InputError> {
    Ok(match DoomMap::of_scene(scene)? {
        Some(map) => Some((map.graph(), map.reject().cloned())),
        None => RegionGraph::of_scene(scene).ok().map(|graph| (graph, None)),
    })
}

impl Regions {
    /// `None` for a scene without any.
    ///
    /// # Errors
    /// The map's file, read a second time.
    pub fn of(scene: &Scene, claim: Option<&Arc<Pvs>>) -> Result<Option<Regions>, FunnelError> {
        if let Some(map) = DoomMap::of_scene(scene)? {
            return Regions::of_map(map, scene, claim).map(Some);
        }
        let Ok(graph) = RegionGraph::of_scene(scene) else {
            return Ok(None);
        };
        let graph = Arc::new(graph);
        let exact = match graph.len() <= MOST_EXACT_ROOMS {
            true => RoomsPvs::of(graph.clone()).ok(),
            false => None,
        };
        let mut audits = Vec::new();
        let mut rows = Vec::new();
        if let Some(claim) = claim {
            rows.push(claimed(claim, &graph)?);
            let found = exact.as_ref().map(|exact| audit(claim, exact, &graph));
            audits.extend(found.transpose()?.map(|audit| ClaimAudit {
                claim: STORED.name,
                audit,
            }));
        }
        rows.extend(exact.and_then(|exact| stored(&exact, &graph)));
        Ok(Some(Regions {
            audits,
            ..Regions::with(graph, rows, scene)
        }))
    }

    /// The sectors of a map, with its own table and with what is exact.
    fn of_map(
        map: Arc<DoomMap>,
        scene: &Scene,
        claim: Option<&Arc<Pvs>>,
    ) -> Result<Regions, FunnelError> {
        let graph = Arc::new(map.graph());
        let exact = SectorPvs::of(map.clone(), graph.clone());
        let mut rows = Vec::new();
        let mut audits = Vec::new();
        if let Some(reject) = map.reject() {
            rows.extend(StoredPvs::reject(graph.clone(), Arc::new(reject.clone())));
            audits.push(ClaimAudit {
                claim: REJECT.name,
                audit: audit(reject, &exact, &graph)?,
            });
        }
        if let Some(claim) = claim {
            rows.push(claimed(claim, &graph)?);
            audits.push(ClaimAudit {
                claim: STORED.name,
                audit: audit(claim, &exact, &graph)?,
            });
        }
        rows.extend(stored(&exact, &graph));
        Ok(Regions {
            audits,
            ..Regions::with(graph, rows, scene)
        })
    }

    fn with(
        graph: Arc<RegionGraph>,
        stored: impl IntoIterator<Item = StoredPvs>,
        scene: &Scene,
    ) -> Regions {
        let items = RegionItems::of(&graph, scene);
        let mut rows: Vec<Box<dyn RegionRow>> = vec![
            Box::new(Flood(graph.clone())),
            Box::new(PortalRect(graph.clone())),
            Box::new(PortalClip(graph)),
        ];
        rows.extend(
            stored
                .into_iter()
                .map(|row| Box::new(row) as Box<dyn RegionRow>),
        );
        Regions {
            rows,
            items,
            audits: Vec::new(),
        }
    }

    /// What all back ends search.
    pub fn graph(&self) -> &RegionGraph {
        self.rows[0].graph()
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

/// The claim of a file, as a row.
fn claimed(claim: &Arc<Pvs>, graph: &Arc<RegionGraph>) -> Result<StoredPvs, FunnelError> {
    let row = StoredPvs::claim(graph.clone(), claim.clone());
    row.ok_or_else(|| {
        FunnelError::Claim(OtherRegions {
            claimed: claim.len(),
            regions: graph.len(),
        })
    })
}

/// What an exact search has found, as a row.
fn stored(exact: &impl ProvenPvs, graph: &Arc<RegionGraph>) -> Option<StoredPvs> {
    StoredPvs::exact(graph.clone(), Arc::new(exact.pvs().clone()))
}
