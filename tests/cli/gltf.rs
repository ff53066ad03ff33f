//! glTF as a scene: y up, with triangles and camera places.

use std::fs;
use std::path::Path;

use serde_json::json;

use super::FULL_CAMERA;
use super::matrices::ENTRIES;
use super::process::*;

fn turned() -> String {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("fuzz/corpus/gltf");
    folder.join("turned.gltf").display().to_string()
}

/// A camera of a y-up scene, or the same one where (z, x, y) are its (x, y, z).
fn camera(z_up: bool, [eye, look]: [[f64; 3]; 2]) -> String {
    let turned = [eye, look, [0.0, 1.0, 0.0]].map(|[x, y, z]| match z_up {
        true => format!("{z},{x},{y}"),
        false => format!("{x},{y},{z}"),
    });
    format!("{},50,1.5,0.1,100\n", turned.join(","))
}

#[test]
fn a_y_up_file_and_its_boxes_as_z_up_csv_are_seen_alike() {
    let folder = folder(&[]);
    let line = format!("scene convert {} --out y.csv", turned());
    assert_eq!(cullbench(folder.path(), &line).code, Some(0));
    let boxes = fs::read_to_string(folder.path().join("y.csv")).expect("boxes");
    let header = boxes.lines().next().expect("a header").to_owned();
    let mut z_up = header + "\n";
    for line in boxes.lines().skip(1) {
        let f: Vec<&str> = line.split(',').collect();
        z_up += &format!(
            "{},{},{},{},{},{},{}\n",
            f[2], f[0], f[1], f[5], f[3], f[4], f[6]
        );
    }
    fs::write(folder.path().join("z.csv"), z_up).expect("writable");
    let views = [
        [[0.0, 20.0, 0.0], [10.0, 24.0, -25.0]],
        [[12.0, 40.0, -20.0], [12.0, 20.0, -22.0]],
        [[0.0, 20.0, 0.0], [-10.0, 20.0, 30.0]],
    ];
    let mut answers = Vec::new();
    for (scene, z_up) in [(turned(), false), ("z.csv".to_owned(), true)] {
        let rows: String = views.map(|view| camera(z_up, view)).concat();
        let text = format!("{FULL_CAMERA}\n{rows}");
        fs::write(folder.path().join("c.csv"), text).expect("writable");
        let line = format!("query --scene {scene} --cameras c.csv --structure all --ids");
        let rows = rows_of(&works(folder.path(), &line));
        assert!(rows.iter().any(|row| row.1 == "0 1") && rows.iter().any(|row| row.1.is_empty()));
        answers.push(rows);
    }
    assert_eq!(answers[0], answers[1]);
}

fn rows_of(csv: &str) -> Vec<(String, String)> {
    let rows = rows(csv).into_iter();
    rows.map(|row| {
        (
            row["camera"].clone() + &row["structure"],
            row["visible_ids"].clone(),
        )
    })
    .collect()
}

#[test]
fn a_note_tells_of_skins() {
    let text = fs::read_to_string(turned()).expect("readable");
    let skinned = text.replacen("\"mesh\"", "\"skin\": 0, \"mesh\"", 1);
    let folder = folder(&[("s.gltf", skinned.as_bytes())]);
    let done = cullbench(folder.path(), "scene info s.gltf");
    let note = "note: s.gltf: 1 item with a skin, placed by its node and not by joints\n";
    assert_eq!((done.code, done.err.as_str()), (Some(0), note));
}

#[test]
fn notes_tell_of_what_is_not_read_as_drawn() {
    let text = r#"{"asset": {"version": "2.0"}, "extensionsRequired": ["EXT_odd", "KHR_materials_unlit"],
        "scenes": [{"nodes": [0, 2]}, {"nodes": [3, 4]}], "cameras": [{"type": "perspective",
        "perspective": {"yfov": 1, "znear": 1}}],
        "nodes": [{"extensions": {"KHR_node_visibility": {"visible": false}}, "children": [1]},
            {"mesh": 0}, {"camera": 0, "scale": [0, 0, 0]}, {"mesh": 0}, {"camera": 0}],
        "meshes": [{"primitives": [{"attributes": {"POSITION": 0}, "mode": 0}], "weights": [0, 1]}],
        "animations": [{"samplers": [{"input": 0, "output": 0}],
            "channels": [{"sampler": 0, "target": {"node": 0, "path": "rotation"}}]}],
        "accessors": [{"componentType": 5126, "count": 1, "type": "VEC3", "min": [0, 0, 0],
            "max": [1, 1, 1]}]}"#;
    let folder = folder(&[("s.gltf", text.as_bytes())]);
    let done = cullbench(folder.path(), "scene info s.gltf");
    let notes = [
        "1 item with morph weights, as stored and not morphed",
        "1 item that an animation moves, placed where its node stands: it is not played",
        "1 item hidden by KHR_node_visibility, read all the same",
        "1 camera without a direction of view, left out",
        "1 further scene not read",
        "2 nodes with a mesh or a camera outside of the scene, not read",
        "extensions that it requires, not read: EXT_odd",
    ];
    assert_eq!(done.code, Some(0), "{}", done.err);
    for note in notes {
        let line = format!("note: s.gltf: {note}\n");
        assert!(done.err.contains(&line), "{note}: {}", done.err);
    }
    // Weights in motion move no node.
    let morphed = text.replace(r#"0, "path": "rotation""#, r#"1, "path": "weights""#);
    fs::write(
        folder.path().join("s.gltf"),
        morphed.replace("[0, 1]}]", "[0]}]"),
    )
    .unwrap();
    let told = cullbench(folder.path(), "scene info s.gltf").err;
    assert!(told.contains(notes[0]) && !told.contains("moves"), "{told}");
    // Nor do channels of other properties, with a node or without.
    let other = text.replace(
        r#""scenes""#,
        r#""extensionsUsed": ["KHR_animation_pointer"], "scenes""#,
    );
    let other = other.replace("[0, 1]}]", "[0]}]");
    for target in [r#"1, "path": "pointer""#, r#"null, "path": "pointer""#] {
        let text = other.replace(r#"0, "path": "rotation""#, target);
        fs::write(folder.path().join("s.gltf"), text).unwrap();
        let told = cullbench(folder.path(), "scene info s.gltf").err;
        let note = "KHR_animation_pointer is not read: what it moves stays as it is stored";
        assert!(
            told.contains(note) && !told.contains("morph") && !told.contains("that an"),
            "{told}"
        );
    }
}

#[test]
fn a_camera_with_another_up_is_not_told_of_an_option_that_its_format_excludes() {
    let text = format!("{FULL_CAMERA}\n0,20,0,10,20,0,0,0,1,50,1.5,0.1,100\n");
    let folder = folder(&[("c.csv", text.as_bytes())]);
    let line = format!(
        "query --scene {} --cameras c.csv --structure linear",
        turned()
    );
    let done = cullbench(folder.path(), &line);
    let warning = format!("c.csv: z is up in 1 of 1 camera, y in {}\n", turned());
    assert_eq!(done.code, Some(0), "{}", done.err);
    assert!(done.err.contains(&warning), "{}", done.err);
}

/// Looking along -z with y up, as in glTF and as in its mirror image.
#[test]
fn matrices_of_a_left_handed_world_are_told_of_beside_it() {
    for (x, is_told) in [(1, false), (-1, true)] {
        let row = format!("{x},0,0,0,0,1,0,-20,0,0,-1.02,28.6,0,0,-1,30");
        let text = format!("{ENTRIES}\n{row}\n");
        let folder = folder(&[("m.csv", text.as_bytes())]);
        let line = format!(
            "scene info {} --path m.csv --matrix-convention column-gl",
            turned()
        );
        let told = cullbench(folder.path(), &line).err;
        assert_eq!(told.contains("capture its boxes"), is_told, "{x}: {told}");
    }
}

#[test]
fn its_triangles_and_cameras_reach_the_later_stages() {
    let folder = folder(&[]);
    let path = "--path outside:frames=4 --processes 1 --samples 48x32 --format json";
    let line = format!("funnel --scene {} {path}", turned());
    let report = json(&works(folder.path(), &line));
    for row in array(&report, "stages") {
        assert_eq!(
            row["false_negative_count"].as_f64().unwrap_or(0.0),
            0.0,
            "{row}"
        );
    }
    let of_triangles = |row: &&serde_json::Value| row["stage"] == "triangle";
    assert!(
        array(&report, "stages")
            .iter()
            .any(|row| of_triangles(&row))
    );
    works(
        folder.path(),
        &format!(
            "query --scene {} --cameras places --structure bvh",
            turned()
        ),
    );
}

type Triangles = Vec<[[f32; 3]; 3]>;

/// A rectangle across x that faces the eye at the origin.
fn pane(x: f32, [low, high]: [[f32; 2]; 2]) -> Triangles {
    let [a, c] = [low, high].map(|[y, z]| [x, y, z]);
    let [b, d] = [[high[0], low[1]], [low[0], high[1]]].map(|[y, z]| [x, y, z]);
    vec![[a, c, b], [a, d, c]]
}

/// A closed box.
fn boxed(low: [f32; 3], high: [f32; 3]) -> Triangles {
    let corner = |bits: usize| std::array::from_fn(|k| [low, high][bits >> k & 1][k]);
    let mut all = Vec::new();
    for axis in 0..3 {
        let (k, u, v) = (1 << axis, 1 << ((axis + 1) % 3), 1 << ((axis + 2) % 3));
        all.extend([
            [k, k | u, k | u | v],
            [k, k | u | v, k | v],
            [0, u | v, u],
            [0, v, u | v],
        ]);
    }
    all.into_iter().map(|corners| corners.map(corner)).collect()
}

/// A file of meshes, each of primitives with a material, and its bytes.
fn of_primitives(meshes: &[&[(Triangles, usize)]]) -> (String, Vec<u8>) {
    let (mut bytes, mut views, mut accessors) = (Vec::new(), Vec::new(), Vec::new());
    let mut add = |own: Vec<u8>, kind: &str, component: u32, count: usize| {
        views.push(json!({"buffer": 0, "byteOffset": bytes.len(), "byteLength": own.len()}));
        bytes.extend(own);
        accessors.push(
            json!({"bufferView": views.len() - 1, "componentType": component,
            "count": count, "type": kind}),
        );
        accessors.len() - 1
    };
    let meshes = meshes.iter().map(|primitives| {
        let primitives = primitives.iter().map(|(triangles, material)| {
            let mut points: Vec<[f32; 3]> = Vec::new();
            let mut indices = Vec::new();
            for p in triangles.as_flattened() {
                let known = points.iter().position(|own| own == p);
                indices.push(known.unwrap_or(points.len()) as u32);
                points.extend(known.is_none().then_some(*p));
            }
            let written = points.as_flattened().iter().flat_map(|x| x.to_le_bytes());
            let written = add(written.collect(), "VEC3", 5126, points.len());
            let order = indices.iter().flat_map(|x| x.to_le_bytes()).collect();
            let order = add(order, "SCALAR", 5125, indices.len());
            json!({"attributes": {"POSITION": written}, "indices": order, "material": material})
        });
        json!({"primitives": primitives.collect::<Vec<_>>()})
    });
    let meshes: Vec<_> = meshes.collect();
    let nodes: Vec<_> = (0..meshes.len())
        .map(|mesh| json!({"mesh": mesh}))
        .collect();
    let file = json!({
        "asset": {"version": "2.0"}, "nodes": nodes, "meshes": meshes,
        "materials": [{}, {"alphaMode": "BLEND"}, {"doubleSided": true}],
        "accessors": accessors, "bufferViews": views,
        "buffers": [{"uri": "b.bin", "byteLength": bytes.len()}],
    });
    (file.to_string(), bytes)
}

/// Panes beside a wall or on a house decide nothing about the wall or the house.
#[test]
fn a_material_is_that_of_its_primitive_at_every_stage() {
    let thing = || (boxed([8.0, -1.0, -1.0], [9.0, 1.0, 1.0]), 0);
    let wall = || pane(5.0, [[-4.0, -6.0], [4.0, 6.0]]);
    let aside = || pane(4.0, [[3.0, 3.0], [3.5, 3.5]]);
    let back = wall().into_iter().map(|[a, b, c]| [a, c, b]).collect();
    let house = boxed([5.0, -4.0, -6.0], [6.0, 4.0, 6.0]);
    let on_it = pane(4.99, [[-0.5, -0.5], [0.5, 0.5]]);
    let camera = format!("{FULL_CAMERA}\n0,0.1,0.2,10,0.1,0.2,0,1,0,60,1.5,0.1,100\n");
    for (what, first, covered, boxed_count) in [
        ("back and two-sided pane", [(back, 0), (aside(), 2)], 49, 1),
        (
            "wall and BLEND pane",
            [(wall(), 0), (aside(), 1)],
            48 * 32,
            1,
        ),
        ("house with a pane", [(house, 0), (on_it, 1)], 48 * 32, 2),
    ] {
        let (file, bytes) = of_primitives(&[&first, &[thing()]]);
        let files: [(&str, &[u8]); 3] = [
            ("m.gltf", file.as_bytes()),
            ("b.bin", &bytes),
            ("c.csv", camera.as_bytes()),
        ];
        let folder = folder(&files);
        for items in ["objects", "triangles"] {
            let line = format!(
                "funnel --scene m.gltf --path c.csv --samples 48x32 --processes 1 --format json \
                 --items {items}"
            );
            let report = json(&works(folder.path(), &line));
            for row in array(&report, "stages") {
                let counts = ["truth_count", "false_negative_count"].map(|name| &row[name]);
                if items == "objects" && row["unit"] == "items" {
                    assert_eq!(counts, [1.0, 0.0], "{what}: {row}");
                }
                let found = &row["fragments"]["covered_count"];
                assert!(
                    found.is_null() || *found == f64::from(covered),
                    "{what}: {row}"
                );
            }
            if items == "objects" {
                assert_eq!(report["inner_boxes"]["boxed_count"], boxed_count, "{what}");
            }
        }
    }
}

#[test]
fn its_cameras_keep_their_lens_and_its_animation_is_a_path() {
    let folder = folder(&[]);
    let animated = turned().replace("turned.gltf", "animated.gltf");
    let lens = |path: &str| {
        let line = format!("scene info {animated} --path {path} --format json");
        json(&works(folder.path(), &line))["cameras"].clone()
    };
    for (path, count) in [("places", 1), ("animation:frames=5", 5)] {
        let cameras = lens(path);
        assert_eq!(cameras["camera_count"], count);
        let fovy = cameras["lens"]["fovy_deg"][0].as_f64().expect("degrees");
        assert!((fovy - 57.29578).abs() < 1e-5, "{fovy}");
        assert_eq!(cameras["lens"]["aspect"], serde_json::json!([1.5, 1.5]));
        assert_eq!(cameras["lens"]["far"], serde_json::json!([99.0, 99.0]));
    }
    assert_eq!(lens("places:frames=9")["camera_count"], 1);
    let typed = lens("places:fovy=40,far=50");
    assert_eq!(typed["lens"]["fovy_deg"][0], 40.0);
    assert_eq!(typed["lens"]["far"][1], 50.0);
    let done = cullbench(folder.path(), "query --scene city:n=9 --cameras animation");
    assert_eq!(done.code, Some(2));
    assert!(
        done.err.contains("no animated camera; expected"),
        "{}",
        done.err
    );
}
