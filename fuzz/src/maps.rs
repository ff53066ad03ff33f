//! Quake III maps, and archives with scenes in them.

use cullbench::camera::{Camera, Frame, Lens};
use cullbench::index::{Input, Registry};
use cullbench::scene::{CameraPlace, LoadOptions, Regions, part_names, read_bytes, read_ibsp};
use cullbench::visibility::Rays;
use cullbench::visibility::region::{Pvs, RegionGraph, Scratch};

use crate::read;

/// Most clusters: pairs of more take seconds.
const MOST: usize = 256;

pub fn ibsp(bytes: &[u8]) {
    let options = LoadOptions::default();
    let Some(scene) = read(read_ibsp(bytes, "fuzz.bsp", "fuzz", &options)) else {
        return;
    };
    let surfaces = scene.surfaces.as_ref().expect("triangles");
    assert_eq!(surfaces.items(), scene.items.len());
    for (item, b) in scene.items.iter().enumerate() {
        let held = surfaces.bounds(item);
        assert!(b.min.cmple(held.min).all() && b.max.cmpge(held.max).all());
    }
    let Regions::Leaves(map) = &scene.regions else {
        panic!("no leaves");
    };
    let structures = Registry::builtin().structures("bsp").expect("a structure");
    let boxes = Input::new(scene.regions.boxes(&scene.items)).own_tree(scene.own_tree.as_ref());
    let index = read(structures[0].build(boxes));
    let graph = RegionGraph::of_quake(map);
    for place in &scene.places {
        let sought = scene.search_point(place.eye);
        let wanted = scene.holding(&sought);
        let mut found = Vec::new();
        if let Some(index) = &index {
            scene.search(&sought, &mut found, |p, out| index.locate(p, out));
            assert_eq!(found, wanted);
        }
    }
    if graph.len() <= MOST {
        assert!(Pvs::of_quake(map).is_none_or(|pvs| pvs.rows.len() == graph.len()));
        see_through(graph, &scene.places);
    }
}

/// Finds what each place sees of the regions.
pub fn see_through(graph: RegionGraph, places: &[CameraPlace]) {
    let (mut scratch, mut found) = (Scratch::default(), Vec::new());
    let lens = Lens::perspective(60.0, 1.5, 1.0, None).expect("a lens");
    for place in places {
        let up = place.forward.any_orthogonal_vector();
        let Ok(frame) = Frame::looking_along(place.eye, place.forward, up) else {
            continue;
        };
        let Ok(rays) = Rays::of(&Camera { frame, lens }) else {
            continue;
        };
        graph.seen_by(&rays, None, &mut scratch, &mut found);
        assert!(found.is_sorted() && found.iter().all(|&id| (id as usize) < graph.len()));
    }
}

/// Reads the only scene of an archive, and each that it names.
pub fn zip(bytes: &[u8]) {
    // Other bytes are read by other readers.
    if !bytes.starts_with(b"PK") {
        return;
    }
    let load = |part: Option<&str>| {
        let options = LoadOptions::default();
        read(read_bytes(bytes, ["fuzz.zip", "fuzz"], part, &options));
    };
    load(None);
    for name in read(part_names(bytes, "fuzz.zip")).unwrap_or_default() {
        load(Some(&name));
    }
}
