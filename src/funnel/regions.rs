//! The regions of a scene for the funnel: every back end that its data allow, and the
//! audit of what a map claims of them.

use std::sync::Arc;

use serde::Serialize;

use super::back_ends::has_exact;
use super::error::FunnelError;
use super::seen_from::SeenFrom;
use crate::input::InputError;
use crate::scene::Scene;
use crate::visibility::Solids;
use crate::visibility::region::doom::{DoomMap, SectorPvs};
use crate::visibility::region::{
    Audit, EXACT, FromRegion, OtherRegions, ProvenPvs, Pvs, REJECT, RegionGraph, RegionItems,
    RegionRow, RoomsPvs, STORED, Searched, StoredPvs, audit, pairs_of,
};

/// A back end, and which items are in which of its regions.
struct Row {
    row: Box<dyn RegionRow>,
    items: Arc<RegionItems>,
}

/// The regions of a scene and what finds a way through them.
pub(super) struct Regions {
    graph: Arc<RegionGraph>,
    rows: Vec<Row>,
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
/// from where; `None` for a scene without regions, such as a map whose linedefs disagree.
///
/// # Errors
/// The map's file, read a second time.
pub fn regions_of(scene: &Scene) -> Result<Option<(RegionGraph, Option<Pvs>)>, InputError> {
    Ok(match DoomMap::of_scene(scene)? {
        Some(map) => map.graph().ok().map(|graph| (graph, map.reject().cloned())),
        None => RegionGraph::of_scene(scene).ok().map(|graph| (graph, None)),
    })
}

impl Regions {
    /// `None` for a scene without any. Of `solids`, boxes without holes, a grid is made too.
    ///
    /// # Errors
    /// The map's file, read a second time.
    pub fn of(
        scene: &Scene,
        claim: Option<&Arc<Pvs>>,
        from: SeenFrom,
        solids: Option<&Solids>,
    ) -> Result<Option<Regions>, FunnelError> {
        if let Some(map) = DoomMap::of_scene(scene)? {
            return match map.graph() {
                Ok(graph) => Regions::of_map(map, Arc::new(graph), scene, claim, from).map(Some),
                Err(dispute) if claim.is_some() => Err(FunnelError::Disputed {
                    scene: scene.name.clone(),
                    dispute,
                }),
                Err(_) => Ok(None),
            };
        }
        let Ok(graph) = RegionGraph::of_scene(scene) else {
            return Ok(None);
        };
        let graph = Arc::new(graph);
        let exact = match has_exact(scene) {
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
        rows.extend(exact.as_ref().and_then(|exact| stored(exact, &graph)));
        let mut regions = Regions::with(graph, rows, scene, from);
        // From a whole cell nearly all others are reached.
        let solids = solids.filter(|_| from == SeenFrom::Eye);
        regions
            .rows
            .extend(solids.map(|solids| grid(solids, scene)));
        regions.audits = audits;
        if let Some(exact) = exact.filter(|_| from == SeenFrom::Region) {
            regions.audit_searches(&exact)?;
        }
        Ok(Some(regions))
    }

    /// The sectors of a map, with its own table and with what is exact.
    fn of_map(
        map: Arc<DoomMap>,
        graph: Arc<RegionGraph>,
        scene: &Scene,
        claim: Option<&Arc<Pvs>>,
        from: SeenFrom,
    ) -> Result<Regions, FunnelError> {
        // A claim is to be audited at any price.
        let exact = (has_exact(scene) || claim.is_some())
            .then(|| SectorPvs::of(map.clone(), graph.clone()));
        let mut rows = Vec::new();
        if let Some(reject) = map.reject() {
            let reject = Arc::new(reject.clone());
            rows.extend(StoredPvs::of(graph.clone(), reject, REJECT));
        }
        if let Some(claim) = claim {
            rows.push(claimed(claim, &graph)?);
        }
        let mut audits = Vec::new();
        if let Some(exact) = &exact {
            let claims = [
                (REJECT, map.reject()),
                (STORED, claim.map(|claim| &**claim)),
            ];
            for (row, claim) in claims {
                let found = claim.map(|claim| audit(claim, exact, &graph)).transpose()?;
                audits.extend(found.map(|audit| ClaimAudit {
                    claim: row.name,
                    audit,
                }));
            }
            rows.extend(stored(exact, &graph));
        }
        let mut regions = Regions::with(graph, rows, scene, from);
        regions.audits = audits;
        if let Some(exact) = exact.filter(|_| from == SeenFrom::Region) {
            regions.audit_searches(&exact)?;
        }
        Ok(regions)
    }

    /// The searches that can answer from there, and what is stored.
    fn with(
        graph: Arc<RegionGraph>,
        stored: impl IntoIterator<Item = StoredPvs>,
        scene: &Scene,
        from: SeenFrom,
    ) -> Regions {
        let items = Arc::new(RegionItems::of(&graph, scene));
        let mut rows: Vec<Box<dyn RegionRow>> = vec![Box::new(Searched::flood(graph.clone()))];
        // Portals restrict an eye: from a whole region they let through what a flood does.
        if from == SeenFrom::Eye {
            rows.push(Box::new(Searched::portal_rect(graph.clone())));
            rows.push(Box::new(Searched::portal_clip(graph.clone())));
        }
        let stored = stored.into_iter();
        rows.extend(stored.map(|row| Box::new(row) as Box<dyn RegionRow>));
        let row = |row| Row {
            row: match from {
                SeenFrom::Eye => row,
                SeenFrom::Region => Box::new(FromRegion(row)),
            },
            items: items.clone(),
        };
        Regions {
            rows: rows.into_iter().map(row).collect(),
            graph,
            audits: Vec::new(),
        }
    }

    /// Holds what the searches say of whole regions against what is proven, as a claim is.
    fn audit_searches(&mut self, exact: &dyn ProvenPvs) -> Result<(), OtherRegions> {
        let searches = self.rows.iter().map(|Row { row, .. }| &**row);
        let searches = searches.filter(|row| Arc::ptr_eq(row.graph(), &self.graph));
        for row in searches {
            let claim = row.about().name;
            if self.audits.iter().all(|audit| audit.claim != claim) {
                let audit = audit(&pairs_of(row), exact, &self.graph)?;
                self.audits.push(ClaimAudit { claim, audit });
            }
        }
        Ok(())
    }

    /// What all back ends search, but for the one that makes its own grid.
    pub fn graph(&self) -> &RegionGraph {
        &self.graph
    }

    /// Which items are in which region of that graph.
    pub fn items_of_graph(&self) -> &RegionItems {
        &self.rows[0].items
    }

    /// The back ends that there are.
    pub fn names(&self) -> impl Iterator<Item = &'static str> {
        self.rows.iter().map(|row| row.row.about().name)
    }

    /// A back end by its name.
    pub fn row(&self, name: &str) -> Option<&dyn RegionRow> {
        self.found(name).map(|found| &*found.row)
    }

    /// Which items are in which region of a back end.
    pub fn items(&self, name: &str) -> Option<&RegionItems> {
        self.found(name).map(|found| &*found.items)
    }

    fn found(&self, name: &str) -> Option<&Row> {
        self.rows.iter().find(|row| row.row.about().name == name)
    }
}

/// The flood over a grid of the scene's own boxes.
fn grid(solids: &Solids, scene: &Scene) -> Row {
    let row = Searched::grid_flood(solids);
    Row {
        items: Arc::new(RegionItems::of(row.graph(), scene)),
        row: Box::new(row),
    }
}

/// The claim of a file, as a row.
fn claimed(claim: &Arc<Pvs>, graph: &Arc<RegionGraph>) -> Result<StoredPvs, FunnelError> {
    let row = StoredPvs::of(graph.clone(), claim.clone(), STORED);
    row.ok_or_else(|| {
        FunnelError::Claim(OtherRegions {
            claimed: claim.len(),
            regions: graph.len(),
        })
    })
}

/// What an exact search has found, as a row.
fn stored(exact: &impl ProvenPvs, graph: &Arc<RegionGraph>) -> Option<StoredPvs> {
    StoredPvs::of(graph.clone(), Arc::new(exact.pvs().clone()), EXACT)
}
