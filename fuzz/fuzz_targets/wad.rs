//! Any bytes as a Doom WAD: no panic, one-line errors, and a map that is
//! accepted has one region for every point.
#![no_main]

use cullbench::scene::{WadMap, map_names};
use libfuzzer_sys::fuzz_target;

fuzz_target!(|bytes: &[u8]| {
    let names = map_names(bytes, "fuzz.wad").unwrap_or_default();
    // Of several maps one is to be named.
    let first = names.first().filter(|_| names.len() > 1);
    let map = WadMap::read(bytes, "fuzz.wad", first.map(String::as_str));
    let scene = map.and_then(|map| map.into_scene("fuzz"));
    match scene {
        Err(error) => assert!(!error.to_string().contains('\n'), "{error}"),
        Ok(scene) => {
            for place in &scene.places {
                assert_eq!(scene.holding(&scene.sought(place.eye)).len(), 1);
            }
        }
    }
});
