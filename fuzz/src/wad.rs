//! Doom maps: every point of an accepted map has one region, and all stages work.

use std::sync::Arc;

use cullbench::scene::{Scene, WadMap, map_names};
use cullbench::visibility::region::doom::DoomMap;

use crate::maps::see_through as see_through_regions;
use crate::read;

/// Most linedefs, and most sectors: searches of larger maps take seconds.
const MOST: usize = 64;

pub fn wad(bytes: &[u8]) {
    let names = read(map_names(bytes, "fuzz.wad")).unwrap_or_default();
    // Of several maps one is to be named.
    let first = names.first().filter(|_| names.len() > 1);
    let first = first.map(String::as_str);
    let map = WadMap::read(bytes, "fuzz.wad", first);
    let Some(scene) = read(map.and_then(|map| map.into_scene("fuzz"))) else {
        return;
    };
    for place in &scene.places {
        assert_eq!(scene.holding(&scene.search_point(place.eye)).len(), 1);
    }
    let map = DoomMap::of_scene(&scene).expect("a map");
    if map.lines.len().max(map.sectors.len()) <= MOST {
        see_through(map, &scene);
    }
}

/// Runs the stages of the funnel on a map.
fn see_through(map: Arc<DoomMap>, scene: &Scene) {
    let surfaces = map.surfaces(scene);
    assert_eq!(surfaces.items(), scene.items.len() + map.sectors.len());
    map.solid_boxes([-512.0, 512.0]);
    if let Ok(graph) = map.graph() {
        see_through_regions(graph, &scene.places);
    }
}
