//! Two rooms and the door between them, intact and damaged.
//!
//! The file has three floors, a patch, a mesh and a flare; walls, a ramp and water; three clusters.
//! The first room's cluster does not see the second's, but is seen from it.

use super::*;

const MAP: &[u8] = include_bytes!("../../../tests/data/two_rooms.bsp");

fn read(bytes: &[u8]) -> Result<Scene, String> {
    let scene = read_ibsp(bytes, "in.bsp", "in", &LoadOptions::default());
    scene.map_err(|e| e.to_string())
}

fn map_of(scene: &Scene) -> &QuakeMap {
    match &scene.regions {
        Regions::Leaves(map) => map,
        _ => panic!("no leaves"),
    }
}

/// The file with a number at a byte of a lump.
fn with(lump: usize, at: usize, value: i32) -> Vec<u8> {
    let mut bytes = MAP.to_vec();
    let entry = 8 + 8 * lump;
    let start = i32::from_le_bytes(MAP[entry..entry + 4].try_into().unwrap()) as usize;
    bytes[start + at..][..4].copy_from_slice(&value.to_le_bytes());
    bytes
}

/// The file without a lump.
fn without(lump: usize) -> Vec<u8> {
    let mut bytes = MAP.to_vec();
    bytes[12 + 8 * lump..][..4].fill(0);
    bytes
}

#[track_caller]
fn refused(bytes: &[u8], wanted: &str) {
    let error = read(bytes).unwrap_err();
    assert!(error.contains(wanted), "{error}");
    assert!(
        error.contains("; expected ") && !error.contains('\n'),
        "{error}"
    );
}

#[test]
fn surfaces_brushes_leaves_and_places_are_read() {
    let scene = read(MAP).unwrap();
    let kinds = [
        ("brush", 12),
        ("polygon", 3),
        ("mesh", 1),
        ("patch", 1),
        ("volume", 1),
    ];
    assert_eq!(scene.labels[0].histogram(), kinds);
    let map = map_of(&scene);
    let ends = map.tree.nodes.iter().flat_map(|node| node.children);
    let leaves = ends
        .filter(|end| !matches!(end, super::super::BspChild::Node(_)))
        .count();
    assert_eq!((leaves, map.tree.nodes.len()), (21, 20));
    assert_eq!((&map.tree.clusters[..], map.clusters), (&[0, 2, 1][..], 3));
    let forward = scene.places.iter().map(|p| (p.forward * 2.0).round());
    let down = DVec3::new(2.0, 0.0, -1.0);
    let wanted = [DVec3::Y * 2.0, DVec3::X * -2.0, down];
    assert_eq!(forward.collect::<Vec<_>>(), wanted);
    let ramp = scene.items.iter().filter(|b| b.min.x == 280.0);
    let wanted = Aabb::new(Vec3::new(280.0, 40.0, 0.0), Vec3::new(312.0, 72.0, 32.0));
    assert_eq!(ramp.collect::<Vec<_>>(), [&wanted]);
}

#[test]
fn surfaces_or_brushes_alone_are_items_on_request() {
    for (items, count) in [(ItemKind::Surfaces, 5), (ItemKind::Brushes, 13)] {
        let options = LoadOptions {
            items,
            ..LoadOptions::default()
        };
        let scene = read_ibsp(MAP, "in.bsp", "in", &options).unwrap();
        assert_eq!((scene.items.len(), map_of(&scene).clusters), (count, 3));
        let error = super::super::load("city:n=9", &options).unwrap_err();
        let wanted = format!("no {}; expected a Quake III map", items.name());
        assert!(error.to_string().contains(&wanted), "{error}");
    }
}

#[test]
fn entities_are_read_as_the_engine_reads_them() {
    let spawn = r#""classname" "info_player_deathmatch" "origin" "1 2 3""#;
    let of = |text: &str| places(text, "in.bsp").len();
    for (text, count, is_whole) in [
        (format!("{{{spawn}}} {{{spawn}}}"), 2, true),
        (format!(r#"{{"message" "}}" {spawn}}}"#), 1, true),
        (format!(r#"{{"message" "//" {spawn}}}"#), 1, true),
        (format!("// a \" and a {{\n{{{spawn}}}{{{spawn}}}"), 2, true),
        (
            format!("{{{}}}", spawn.replace("classname", "ClassName")),
            1,
            true,
        ),
        (format!("/* {{{spawn}}} */{{{spawn}}}"), 1, true),
        (format!("{{{spawn}"), 1, false),
        ("\"".to_owned(), 0, false),
        (format!("/* {{{spawn}}}"), 0, false),
        (format!(r#"{{"message" "hi}} {{{spawn}}}"#), 0, false),
        (
            format!(r#"{{"classname" "worldspawn" {{{spawn}}}"#),
            1,
            false,
        ),
    ] {
        assert_eq!(of(&text), count, "{text}");
        assert_eq!(entities_of(&text).1, is_whole, "{text}");
    }
}

#[test]
fn each_spawn_point_lies_in_an_open_leaf_and_its_box() {
    let scene = read(MAP).unwrap();
    let found = |p: DVec3| scene.holding(&scene.search_point(p));
    let at = |x: f64, y: f64, z: f64| found(DVec3::new(x, y, z));
    let map = map_of(&scene);
    for (place, leaf) in scene.places.iter().zip([0, 1, 2]) {
        for p in [place.eye, place.eye.with_z(20.0)] {
            assert_eq!(found(p), [leaf]);
            let grown = &map.tree.boxes[leaf as usize];
            assert!(grown.contains_point(p.as_vec3()));
        }
    }
    // Players have eye height; the scoreboard camera has none.
    let heights = scene.places.iter().map(|place| place.eye.z);
    let standing = 24.0 + EYE_HEIGHT;
    assert_eq!(heights.collect::<Vec<_>>(), [standing, standing, 20.0]);
    // On a plane, just in front of it, in a wall, and beyond the map.
    assert_eq!(at(128.0, 64.0, 9.0), [2]);
    assert_eq!(at(128f64.next_down(), 64.0, 9.0), [0]);
    assert!(at(150.0, 10.0, 9.0).is_empty());
    for far in [1e9, 1e300, f64::MAX] {
        assert!(at(far, -far, far).is_empty());
    }
}

#[test]
fn sight_is_the_files_and_without_a_table_all_is_seen() {
    let scene = read(MAP).unwrap();
    let sees = map_of(&scene).sees().unwrap();
    assert!(!sees(0, 2) && sees(2, 0) && sees(0, 1));
    let scene = read(&without(16)).unwrap();
    assert!(map_of(&scene).sees().is_none());
    assert_eq!(map_of(&scene).clusters, 3);
}

#[test]
fn brushes_are_closed_and_surfaces_face_the_room() {
    let scene = read(MAP).unwrap();
    let surfaces = scene.surfaces.as_ref().unwrap();
    let up = |item: usize| {
        surfaces
            .of(item)
            .all(|[a, b, c]| (b - a).cross(c - a).z > 0.0)
    };
    for (item, bounds) in scene.items.iter().enumerate() {
        let own = surfaces.bounds(item);
        assert!(bounds.contains_point(own.min) && bounds.contains_point(own.max));
        let size = bounds.max - bounds.min;
        let volume = f64::from(size.x * size.y * size.z);
        match scene.labels[0].get(item) {
            "polygon" | "mesh" => assert!(up(item), "{item}"),
            "patch" => assert_eq!(surfaces.of(item).count(), PER_PATCH),
            kind => {
                assert_eq!(surfaces.open_edges(item), 0, "{item}");
                let share = if bounds.min.x == 280.0 { 0.5 } else { 1.0 };
                assert_eq!(surfaces.volume(item), share * volume, "{item}");
                let hides = surfaces.kinds[surfaces.range(item).start] == SurfaceKind::Opaque;
                assert_eq!(hides, kind == "brush");
            }
        }
    }
    // Upward from (0, 0) to the middle of the patch, along the curve.
    let patch = (0..scene.items.len()).find(|&i| scene.labels[0].get(i) == "patch");
    let top = surfaces.bounds(patch.unwrap()).max.z;
    assert_eq!(top, 16.0 + 32.0 / 4.0);
}

#[test]
fn other_formats_are_named() {
    for (magic, wanted) in [
        (&b"IBSP\x26\0\0\0"[..], "a map of Quake II;"),
        (b"VBSP\x14\0\0\0", "a map of Source;"),
        (
            b"\x1d\0\0\0",
            "a map of Quake; expected IBSP of version 46 (Quake III), or",
        ),
        (b"BSP2\0\0\0\0", "a map of Quake (BSP2);"),
        (
            b"IBSP\x2e\0\0\x01",
            "'IBSP.\\x00\\x00\\x01'; expected IBSP of version 46",
        ),
        (b"", "''; expected IBSP"),
    ] {
        refused(magic, wanted);
        assert_eq!(is_ibsp(magic), !magic.is_empty());
    }
}

#[test]
fn every_index_is_checked() {
    for (lump, at, value, wanted) in [
        (3, 36, 999, "planes 999 in nodes 1"),
        (3, 4, 999, "node 999 does not exist; expected a BSP tree"),
        (3, 4, -999, "leaf 998 does not exist"),
        (3, 40, 0, "node 0 is reached twice"),
        (3, 40, -2, "leaf 1 is reached twice"),
        (4, 48, 3, "cluster 3 in leafs 1; expected less than 3"),
        (8, 8, 2, "shaders 2 in brushes 0"),
        (8, 0, i32::MAX, "brushsides from 2147483647 on"),
        (8, 4, -1, "-1 brushsides from 0 on"),
        (9, 0, -1, "planes -1 in brushsides 0"),
        (9, 0, 0, "brush 0 without the sides of its box"),
        (
            10,
            0,
            f32::NAN.to_bits() as i32,
            "NaN; expected a finite number",
        ),
        (11, 0, 4, "vertex 4 of surface 0; expected less than 4"),
        (13, 0, 2, "shaders 2 in surfaces 0"),
        (13, 8, 9, "surface 0 of type 9"),
        (13, 16, 16, "in all; expected at most"),
        (13, 104 * 3 + 96, 5, "a patch of 5 x 3 of 9 points"),
        (16, 0, 65, "visibility of 32 bytes"),
        (16, 4, i32::MAX, "visibility of 32 bytes"),
        (16, 0, 2, "cluster 2 in leafs"),
    ] {
        refused(&with(lump, at, value), wanted);
    }
    refused(&without(3), "no nodes; expected a BSP tree");
}

#[test]
fn no_truncation_and_no_flipped_byte_panics() {
    for length in 0..MAP.len() {
        refused(
            &MAP[..length],
            if length < 8 { "IBSP" } else { "in.bsp, byte " },
        );
    }
    let mut bytes = MAP.to_vec();
    for at in (0..bytes.len()).step_by(3) {
        let kept = bytes[at];
        for value in [0, 0x7F, 0x80, 0xFF] {
            bytes[at] = value;
            let _ = read(&bytes).map(|scene| scene.holding(&scene.search_point(DVec3::ONE)));
        }
        bytes[at] = kept;
    }
}
