//! Tables and JSON of boxes, cameras, points, test vectors.

use cullbench::camera::{MATRIX_CONVENTIONS, PlaneOptions, Surroundings};
use cullbench::index::Registry;
use cullbench::path::{LensDefaults, read_cameras_csv, read_points_csv};
use cullbench::scene::{
    LoadOptions, Scene, read_boxes_csv, read_bytes, read_obj, read_search_boxes_csv,
    write_boxes_csv,
};
use cullbench::stress::{Vector, read_vectors, replay};

use crate::read;

/// Reads glTF whose buffers are within it.
pub fn gltf(bytes: &[u8]) {
    let options = LoadOptions::default();
    if let Some(scene) = read(read_bytes(bytes, ["fuzz.gltf", "fuzz"], None, &options)) {
        let surfaces = scene.surfaces.iter();
        assert!(
            surfaces
                .map(|s| s.items())
                .all(|items| items == scene.items.len())
        );
    }
}

/// Reads OBJ, and its triangles as items.
pub fn obj(bytes: &[u8]) {
    let options = LoadOptions::default();
    let Some(scene) = read(read_obj(bytes, "fuzz.obj", "fuzz", &options)) else {
        return;
    };
    let surfaces = scene.surfaces.clone().expect("triangles");
    assert_eq!(surfaces.items(), scene.items.len());
    for (item, b) in scene.items.iter().enumerate() {
        let held = surfaces.bounds(item);
        assert!(b.min.cmple(held.min).all() && b.max.cmpge(held.max).all());
    }
    let single = read(scene.by_triangle(&options));
    assert!(single.is_none_or(|scene| scene.items.len() == surfaces.triangles.len()));
}

pub fn boxes(bytes: &[u8]) {
    for skip in [false, true] {
        let scene = read(read_boxes_csv(bytes, "fuzz.csv", skip));
        let Some(scene) = scene.and_then(|scene| read(scene.settled())) else {
            continue;
        };
        let written = |scene: &Scene| {
            let mut text = Vec::new();
            write_boxes_csv(scene, &mut text).expect("a Vec takes everything");
            text
        };
        let text = written(&scene);
        let again = read_boxes_csv(&text[..], "again.csv", false).expect("what was written");
        assert!(again.written().eq(scene.written()));
        assert_eq!(written(&again), text);
    }
}

pub fn sought(bytes: &[u8]) {
    let Some(boxes) = read(read_search_boxes_csv(bytes, "fuzz.csv")) else {
        return;
    };
    for b in boxes {
        assert!(b.min.is_finite() && b.max.is_finite() && b.min.cmple(b.max).all());
    }
}

pub fn cameras(bytes: &[u8]) {
    let conventions = MATRIX_CONVENTIONS.map(|row| Some(row.0));
    for matrix in conventions.into_iter().chain([None]) {
        let defaults = LensDefaults {
            matrix,
            ..LensDefaults::default()
        };
        let path = read(read_cameras_csv(bytes, "fuzz.csv", &defaults));
        for camera in path.iter().flat_map(|path| &path.cameras) {
            read(camera.volume(&PlaneOptions::default(), &Surroundings::default()));
        }
    }
}

pub fn points(bytes: &[u8]) {
    let points = read(read_points_csv(bytes, "fuzz.csv"));
    assert!(points.iter().flatten().all(|point| point.is_finite()));
}

pub fn vectors(bytes: &[u8]) {
    let linear = Registry::builtin().structures("linear");
    let linear = linear.expect("a structure");
    // Certificates grow with the fourth power of the planes.
    let is_small = |v: &Vector| v.planes().iter().flatten().count() < 9 && v.boxes().len() < 99;
    for vector in read(read_vectors(bytes, "fuzz.json")).unwrap_or_default() {
        if is_small(&vector) {
            let _ = replay(&vector, &linear);
        }
    }
}
