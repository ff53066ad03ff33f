//! Items of a scene as rays meet them: triangles, boxes with holes, walls of a map.

use std::sync::Arc;

use super::fragment::{CutOuts, Holes};
use super::region::RegionGraph;
use super::region::doom::DoomMap;
use crate::query::ItemId;
use crate::scene::{Scene, Surfaces};

/// The triangles of a scene's items, if they are no solid boxes.
///
/// Those of a map's floors and ceilings follow the items.
pub fn surfaces_of(scene: &Scene) -> Option<Arc<Surfaces>> {
    let of_map = || Some(Arc::new(DoomMap::of_scene(scene)?.surfaces(scene)));
    scene.surfaces.clone().or_else(of_map)
}

/// The items of a scene that are cut out: all but the walls of its rooms.
///
/// The regions of the rooms are `graph`; a view into the next room leads through portals only.
pub fn holes_of(typed: &CutOuts, scene: &Scene, graph: Option<&RegionGraph>) -> Holes {
    let walls = graph.map(|graph| graph.borders(scene));
    let is_free = |item: ItemId| walls.as_ref().is_none_or(|walls| !walls[item as usize]);
    typed.holes(scene.items.len(), is_free)
}
