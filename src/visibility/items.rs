//! Items of a scene as rays meet them: triangles, boxes with holes, walls of a map.

use std::sync::Arc;

use super::fragment::{self, CutOuts};
use super::region::RegionGraph;
use super::region::doom::DoomMap;
use crate::input::InputError;
use crate::query::ItemId;
use crate::scene::{ItemShape, Scene, Surfaces};

/// The triangles of a scene's items, if they are no solid boxes.
///
/// Those of a map's floors and ceilings follow the items.
///
/// # Errors
/// The map's file, read a second time.
pub fn surfaces_of(scene: &Scene) -> Result<Option<Arc<Surfaces>>, InputError> {
    Ok(match (scene.item_shape(), &scene.surfaces) {
        (ItemShape::Box, _) => None,
        (_, Some(mesh)) => Some(mesh.clone()),
        (_, None) => Some(Arc::new(match DoomMap::of_scene(scene)? {
            Some(map) => map.surfaces(scene),
            // A map whose file is not known.
            None => Surfaces::from_boxes(scene),
        })),
    })
}

/// The items of a scene that are cut out: all but the walls of its rooms.
///
/// The regions of the rooms are `graph`; a view into the next room leads through portals only.
pub fn holes_of(typed: &CutOuts, scene: &Scene, graph: Option<&RegionGraph>) -> fragment::Surfaces {
    let walls = graph.map(|graph| graph.borders(scene));
    let is_free = |item: ItemId| walls.as_ref().is_none_or(|walls| !walls[item as usize]);
    typed.surfaces(scene.items.len(), is_free)
}
