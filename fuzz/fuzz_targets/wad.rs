//! Any bytes as a Doom WAD: no panic, one-line errors, and a map that is accepted has
//! one region for every point and can be seen through.
#![no_main]

use std::sync::Arc;

use cullbench::scene::{Scene, WadMap, map_names};
use cullbench::visibility::Ray;
use cullbench::visibility::region::Marks;
use cullbench::visibility::region::doom::DoomMap;
use libfuzzer_sys::fuzz_target;

/// Most linedefs, and most sectors: searches of larger maps take seconds.
const MOST: usize = 64;

fuzz_target!(|bytes: &[u8]| {
    let names = map_names(bytes, "fuzz.wad").unwrap_or_default();
    // Of several maps one is to be named.
    let first = names.first().filter(|_| names.len() > 1);
    let first = first.map(String::as_str);
    let map = WadMap::read(bytes, "fuzz.wad", first);
    let scene = map.and_then(|map| map.into_scene("fuzz"));
    match scene {
        Err(error) => assert!(!error.to_string().contains('\n'), "{error}"),
        Ok(scene) => {
            for place in &scene.places {
                assert_eq!(scene.holding(&scene.sought(place.eye)).len(), 1);
            }
            let map = DoomMap::read(bytes, "fuzz.wad", first).expect("the same map");
            if map.lines.len().max(map.sectors.len()) <= MOST {
                see_through(Arc::new(map), &scene);
            }
        }
    }
});

/// What the stages of the funnel make of a map.
fn see_through(map: Arc<DoomMap>, scene: &Scene) {
    let surfaces = map.surfaces(scene);
    assert_eq!(surfaces.items(), scene.items.len() + map.sectors.len());
    map.solid_boxes([-512.0, 512.0]);
    let Ok(graph) = map.graph() else {
        return;
    };
    let mut seen = Marks::default();
    for place in &scene.places {
        let ray = Ray {
            origin: place.eye,
            direction: place.forward,
            near: 0.0,
            far: f64::INFINITY,
        };
        seen.clear(graph.len());
        graph.ground().follow(&graph, &ray, &mut seen);
    }
}
