//! The library's readers, fed with damaged copies of good input and with
//! plain noise: no panic, and every error is one line that says where.

use cullbench::camera::{Camera, Frame, Lens, MATRIX_CONVENTIONS};
use cullbench::index::Registry;
use cullbench::path::{LensDefaults, read_cameras_csv, read_points_csv};
use cullbench::scene::{WadMap, map_names, read_boxes_csv};

use cullbench::stress::{read_vectors, replay};
use cullbench::visibility::Rays;
use cullbench::visibility::region::Scratch;
use cullbench::visibility::region::doom::DoomMap;
use glam::DVec3;

use super::process::*;
use super::{BOXES, FULL_CAMERA};

/// Bytes that readers are known to stumble over.
const WORDS: &[&[u8]] = &[
    b"nan",
    b"-inf",
    b"1e999",
    b"1e308",
    b"-1e39",
    b"\"",
    b",",
    b"\n",
    b"\r\n",
    b"\r",
    b"\0",
    b"-",
    b"\xff\xfe",
    b"\xef\xbb\xbf",
    b"4294967296",
    b"\xff\xff\xff\x7f",
];

/// A damaged copy: a few bytes changed, taken out, put in, or the end lost.
fn damaged(random: &mut Random, good: &[u8]) -> Vec<u8> {
    let mut bytes = good.to_vec();
    for _ in 0..=random.below(6) {
        let at = random.below(bytes.len() + 1);
        let end = (at + random.below(12)).min(bytes.len());
        match random.below(8) {
            0 => bytes.truncate(at),
            1 => drop(bytes.drain(at..end)),
            2 => {
                let copy = bytes[at..end].to_vec();
                bytes.splice(at..at, copy);
            }
            3 | 4 => {
                let word = WORDS[random.below(WORDS.len())];
                bytes.splice(at..at, word.iter().copied());
            }
            _ => bytes[at..end].fill_with(|| random.next() as u8),
        }
    }
    bytes
}

/// Feeds a reader with its good input, damaged copies of it, and noise.
fn feed(name: &str, good: &[u8], read: fn(&[u8]) -> Result<(), String>) {
    assert_eq!(read(good), Ok(()), "{name}");
    let (mut refused, rounds) = (0, 1500);
    for seed in 1..=rounds {
        let mut random = Random(u64::wrapping_mul(seed, 0x9E37_79B9_7F4A_7C15));
        let bytes = if seed % 8 == 0 {
            (0..random.below(400))
                .map(|_| random.next() as u8)
                .collect()
        } else {
            damaged(&mut random, good)
        };
        let result = std::panic::catch_unwind(|| read(&bytes));
        let Ok(result) = result else {
            panic!("{name}, seed {seed} panicked on: {}", bytes.escape_ascii());
        };
        if let Err(error) = result {
            refused += 1;
            let clear = error.contains("in.file") && error.contains("expected");
            assert!(clear && error.len() < 600, "{name}, seed {seed}: {error}");
            let one_line = !error.contains(char::is_control);
            assert!(one_line, "{name}, seed {seed}: {error:?}");
        }
    }
    assert!(refused * 4 > rounds, "{name}: only {refused} were refused");
}

#[test]
fn damaged_boxes() {
    let good = format!("{BOXES},kind\n0,0,0,1,1,1,a\n-2.5,0,1e3,4,5,6e3,\"b,c\"\n7,7,7,7,7,7,\n");
    feed("boxes", good.as_bytes(), |bytes| {
        let skipped = read_boxes_csv(bytes, "in.file", true);
        let strict = read_boxes_csv(bytes, "in.file", false);
        // Skipping bad rows makes nothing worse, and leaves only good ones.
        assert!(skipped.is_ok() || strict.is_err());
        for scene in skipped.iter().chain(&strict) {
            assert!(scene.items.iter().all(|b| b.is_finite() && !b.is_empty()));
        }
        strict.map(|_| ()).map_err(|e| e.to_string())
    });
}

#[test]
fn damaged_cameras() {
    let rows = "0,0,0,1,0,0,0,0,1,60,1.5,0.1,100\n1,2,3,4,5,6,0,0,1,90,1,1,inf\n";
    let good = format!("{FULL_CAMERA}\n{rows}");
    feed("cameras", good.as_bytes(), |bytes| {
        let path = read_cameras_csv(bytes, "in.file", &LensDefaults::default());
        let path = path.map_err(|e| e.to_string())?;
        assert!(!path.cameras.is_empty());
        Ok(())
    });
}

#[test]
fn damaged_matrices() {
    let names: Vec<String> = (0..16).map(|i| format!("m{}{}", i / 4, i % 4)).collect();
    let rows = "1,0,0,-2,0,0,1,-1,0,1.25,0,-6,0,1,0,-3\n1,0,0,-2,0,0,1,-1,0,0,0,1,0,1,0,-3\n";
    let good = format!("{}\n{rows}", names.join(","));
    feed("matrices", good.as_bytes(), |bytes| {
        let mut first = None;
        for (convention, ..) in MATRIX_CONVENTIONS {
            let defaults = LensDefaults {
                matrix: Some(convention),
                ..LensDefaults::default()
            };
            let path = read_cameras_csv(bytes, "in.file", &defaults);
            for camera in path.iter().flat_map(|path| &path.cameras) {
                let _ = camera.volume(&Default::default(), &Default::default());
            }
            first.get_or_insert(path.map(|_| ()).map_err(|e| e.to_string()));
        }
        first.unwrap_or(Ok(()))
    });
}

#[test]
fn damaged_points() {
    feed("points", b"x,y,z\n0,0,0\n-1.5,2e3,3\n4,5,6\n", |bytes| {
        let points = read_points_csv(bytes, "in.file").map_err(|e| e.to_string())?;
        assert!(!points.is_empty() && points.iter().all(|p| p.is_finite()));
        Ok(())
    });
}

/// Vectors that can be read can be queried, whatever their values.
#[test]
fn damaged_vectors() {
    let good = r#"{"format": 1, "vectors": [{"id": "a", "category": "c", "camera": {"eye": [0, 0, 0],
        "look": [0, 0, -1], "up": [0, 1, 0], "fovy_deg": 90, "aspect": 1.5, "near": 1, "far": "inf"},
        "planes": [[1, 0, -1, 0], [0, 0, -1, -1e0]], "boxes": [
        {"id": "x", "lo": [-1, -1, -4], "hi": [1, 1, -2]}, {"id": "y", "lo": ["NaN", 0, 0], "hi": [1, 1, 1]}],
        "expect_rejected_at_load": ["y"], "expected_visible_planes": ["x"], "touch_planes": [],
        "points": [{"id": "p", "p": [0, 0, -3], "expected_containing": ["x"]}]},
        {"id": "b", "planes_f32_hex": [["0x3f800000", "0x00000000", "0xbf800000", "0xffc00000"]],
        "expect_planes_error": "no plane", "boxes": []}]}"#;
    feed("vectors", good.as_bytes(), |bytes| {
        let vectors = read_vectors(bytes, "in.file").map_err(|e| e.to_string())?;
        let linear = Registry::builtin()
            .structures("linear")
            .map_err(|e| e.to_string())?;
        for vector in &vectors {
            let _ = replay(vector, &linear);
        }
        Ok(())
    });
}

#[test]
fn damaged_maps() {
    feed("map", &map12(), |bytes| {
        let names = map_names(bytes, "in.file");
        let map = WadMap::read(bytes, "in.file", None).map_err(|e| e.to_string())?;
        assert!(names.is_ok());
        let scene = map.into_scene("in.file").map_err(|e| e.to_string())?;
        assert!(scene.items.iter().all(|b| b.is_finite() && !b.is_empty()));
        Ok(())
    });
}

/// A map that is accepted can be seen through, whatever it says.
#[test]
fn damaged_maps_seen_through() {
    feed("rooms", include_bytes!("../data/two_rooms.wad"), |bytes| {
        let scene = WadMap::read(bytes, "in.file", None).and_then(|map| map.into_scene("in.file"));
        let scene = scene.map_err(|e| e.to_string())?;
        let map = DoomMap::of_scene(&scene).expect("a map");
        assert_eq!(
            map.surfaces(&scene).items(),
            scene.items.len() + map.sectors.len()
        );
        map.solid_boxes([-512.0, 512.0]);
        // Where linedefs disagree, sectors are no regions.
        let Ok(graph) = map.graph() else {
            return Ok(());
        };
        let (mut scratch, mut seen) = (Scratch::default(), Vec::new());
        for place in &scene.places {
            let frame = Frame::looking_along(place.eye, place.forward, DVec3::Z);
            let lens = Lens::perspective(60.0, 1.5, 0.5, None).expect("a lens");
            let rays = Rays::of(&Camera {
                frame: frame.expect("a frame"),
                lens,
            });
            let rays = rays.expect("rays");
            graph.seen_by(&rays, None, &mut scratch, &mut seen);
            assert!(
                seen.iter()
                    .all(|&sector| (sector as usize) < map.sectors.len())
            );
        }
        Ok(())
    });
}

/// Nodes that lead back into the tree, twice to one place or out of it.
#[test]
fn maps_whose_nodes_are_no_tree() {
    let good = map12();
    let is_nodes = |name: &[u8]| name == b"NODES\0\0\0";
    let name = good.windows(8).rposition(is_nodes).expect("NODES");
    let int =
        |at: usize| i32::from_le_bytes(good[at..at + 4].try_into().expect("4 bytes")) as usize;
    let (start, count) = (int(name - 8), int(name - 4) / 28);
    for node in 0..count {
        let at = start + 28 * node + 24;
        let other = [good[at + 2], good[at + 3]];
        let root = (count as u16 - 1).to_le_bytes();
        let itself = (node as u16).to_le_bytes();
        for child in [other, root, itself, [0xFF, 0x7F], [0xFF, 0xFF]] {
            let mut bytes = good.clone();
            bytes[at..at + 2].copy_from_slice(&child);
            let error = WadMap::read(&bytes, "in.file", None).expect_err("no tree");
            let error = error.to_string();
            let clear = error.contains("in.file, byte ") && error.contains("expected a BSP tree");
            assert!(clear, "node {node} to {child:?}: {error}");
        }
    }
}
