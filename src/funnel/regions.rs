//! The regions of a scene for the funnel: every back end that its data allow, and the
//! audit of what a map claims of them.

use std::sync::Arc;

use super::back_ends::MOST_EXACT_ROOMS;
use crate::input::InputError;
use crate::scene::Scene;
use crate::visibility::MapFile;
use crate::visibility::region::doom::{DoomMap, SectorPvs};
use crate::visibility::region::{
    Audit, Flood, PortalClip, PortalRect, ProvenPvs, RegionGraph, RegionItems, RegionRow, RoomsPvs,
    StoredPvs, audit,
};

/// The regions of a scene and what finds a way through them.
pub(super) struct Regions {
    rows: Vec<Box<dyn RegionRow>>,
    /// Which items are in which.
    pub items: RegionItems,
    /// What a map's own table of what is seen from where gets wrong.
    pub audit: Option<Audit>,
}

/// The map that a scene is, if it is one.
///
/// # Errors
/// The map's file, read a second time.
pub(super) fn map_of(scene: &Scene) -> Result<Option<Arc<DoomMap>>, InputError> {
    let Some(file) = MapFile::of(&scene.name)? else {
        return Ok(None);
    };
    let map = DoomMap::read(&file.bytes, &file.name, file.map.as_deref())?;
    Ok(Some(Arc::new(map)))
}

impl Regions {
    /// `None` for a scene without any.
    ///
    /// # Errors
    /// The map's file, read a second time.
    pub fn of(scene: &Scene) -> Result<Option<Regions>, InputError> {
        if let Some(map) = map_of(scene)? {
            return Ok(Some(Regions::of_map(map, scene)));
        }
        let Ok(graph) = RegionGraph::of_scene(scene) else {
            return Ok(None);
        };
        let graph = Arc::new(graph);
        let exact = match graph.len() <= MOST_EXACT_ROOMS {
            true => RoomsPvs::of(graph.clone()).ok(),
            false => None,
        };
        let exact = exact.and_then(|exact| stored(&exact, &graph));
        Ok(Some(Regions::with(graph, exact, scene)))
    }

    /// The sectors of a map, with its own table and with what is exact.
    fn of_map(map: Arc<DoomMap>, scene: &Scene) -> Regions {
        let graph = Arc::new(map.graph());
        let exact = SectorPvs::of(map.clone(), graph.clone());
        let claim = map.reject();
        let audit = claim.and_then(|claim| audit(claim, &exact, &graph).ok());
        let reject = claim.cloned().map(Arc::new);
        let reject = reject.and_then(|pvs| StoredPvs::reject(graph.clone(), pvs));
        let exact = stored(&exact, &graph);
        Regions {
            audit,
            ..Regions::with(graph, [reject, exact].into_iter().flatten(), scene)
        }
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
            audit: None,
        }
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

/// What an exact search has found, as a row.
fn stored(exact: &impl ProvenPvs, graph: &Arc<RegionGraph>) -> Option<StoredPvs> {
    StoredPvs::exact(graph.clone(), Arc::new(exact.pvs().clone()))
}
