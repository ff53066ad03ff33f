//! A rotated tetrahedron twice, whole, compressed and damaged.

use base64::Engine;
use base64::engine::general_purpose::STANDARD;
use glam::{DQuat, DVec3};
use serde_json::{Value, json};

use super::super::{LoadOptions, SeededRng, SurfaceKind, UpAxis};
use super::*;
use crate::geometry::Aabb;

/// A tetrahedron; its indices follow as u16 after its points.
const POINTS: [[f32; 3]; 4] = [
    [0.0, 0.0, 0.0],
    [1.5, 0.0, 0.0],
    [0.0, 2.0, 0.0],
    [0.1, 0.2, 3.0],
];
const CORNERS: [[u16; 3]; 4] = [[0, 2, 1], [0, 1, 3], [1, 2, 3], [0, 3, 2]];

fn file() -> Value {
    let points = POINTS.as_flattened().iter().flat_map(|n| n.to_le_bytes());
    let corners = CORNERS.as_flattened().iter().flat_map(|n| n.to_le_bytes());
    let bytes: Vec<u8> = points.chain(corners).collect();
    json!({
        "asset": {"version": "2.0"},
        "scene": 0,
        "scenes": [{"nodes": [0, 2]}],
        "nodes": [
            {"name": "turned", "mesh": 0, "children": [1], "translation": [10, 20, -30],
             "rotation": [0.1, -0.7, 0.2, 0.6], "scale": [2, 3, -4]},
            {"mesh": 0, "translation": [5, 0, 0]},
            {"camera": 0, "translation": [1, 2, 3], "rotation": [0, 1, 0, 0]},
        ],
        "cameras": [{"type": "perspective", "perspective": {"yfov": 1.0, "znear": 0.1}}],
        "meshes": [{"primitives": [{"attributes": {"POSITION": 0}, "indices": 1, "material": 0}]}],
        "materials": [{"alphaMode": "MASK", "alphaCutoff": 2, "doubleSided": true}],
        "accessors": [
            {"bufferView": 0, "componentType": 5126, "count": 4, "type": "VEC3",
             "min": [0, 0, 0], "max": [1.5, 2, 3]},
            {"bufferView": 1, "componentType": 5123, "count": 12, "type": "SCALAR"},
        ],
        "bufferViews": [
            {"buffer": 0, "byteLength": 48},
            {"buffer": 0, "byteOffset": 48, "byteLength": 24},
        ],
        "buffers": [{"byteLength": bytes.len(), "uri":
            format!("data:application/octet-stream;base64,{}", STANDARD.encode(bytes))}],
    })
}

fn read_gltf(bytes: &[u8], file: &str, name: &str, options: &LoadOptions) -> Result<Scene> {
    read_beside(bytes, [file, name], options, &|uri| beside(file, uri))
}

pub(super) fn read(file: &Value) -> Result<Scene> {
    let text = file.to_string();
    assert!(is_gltf(text.as_bytes()));
    read_gltf(text.as_bytes(), "t.gltf", "t", &LoadOptions::default())
}

/// The points of both items in world coordinates, by hand.
fn world() -> [Vec<DVec3>; 2] {
    let turn = DQuat::from_xyzw(0.1, -0.7, 0.2, 0.6);
    let place = |p: DVec3| {
        DVec3::new(10.0, 20.0, -30.0) + turn.normalize() * (p * DVec3::new(2.0, 3.0, -4.0))
    };
    let points = POINTS.map(|p| DVec3::from(p.map(f64::from)));
    [DVec3::ZERO, DVec3::X * 5.0].map(|by| points.iter().map(|p| place(*p + by)).collect())
}

#[test]
fn items_are_the_boxes_of_the_transformed_triangles() {
    let scene = read(&file()).unwrap();
    assert_eq!((scene.up, scene.items.len()), (UpAxis::Y, 2));
    assert_eq!(scene.labels[0].get(0), "turned");
    let surfaces = scene.surfaces.as_ref().expect("triangles");
    assert_eq!(surfaces.triangles.len(), 8);
    assert_eq!(
        (surfaces.kinds[0], surfaces.two_sided[0]),
        (SurfaceKind::CutOut, true)
    );
    let single = scene.clone().by_triangle(&LoadOptions::default()).unwrap();
    for (item, points) in world().iter().enumerate() {
        let wanted = WorldBox::union_of(points.iter().copied().map(WorldBox::at));
        let of_triangles = single.written().skip(4 * item).take(4);
        for written in [
            scene.written().nth(item).unwrap(),
            WorldBox::union_of(of_triangles),
        ] {
            let ends = [(written.min, wanted.min), (written.max, wanted.max)];
            assert!(ends.iter().all(|(a, b)| a.distance(*b) < 1e-12));
        }
        // A negative scale reverses them; the reader winds them outward again.
        assert!(surfaces.volume(item) > 0.0);
    }
    for (written, b) in scene
        .written()
        .zip(&scene.items)
        .chain(single.written().zip(&single.items))
    {
        let rounded = Aabb::rounded_outward(written.min, written.max, scene.origin);
        assert_eq!((*b, single.origin), (rounded, scene.origin));
    }
    let [place] = &scene.places[..] else {
        panic!("one camera");
    };
    assert_eq!(
        (place.eye, place.forward.round()),
        (DVec3::new(1.0, 2.0, 3.0), DVec3::Z)
    );
}

/// The file with its camera turned by 90 degrees about y, from second 1 to 3.
pub(super) fn animated() -> Value {
    let half = std::f32::consts::FRAC_1_SQRT_2;
    let turns = [0.0, 0.0, 0.0, 1.0, 0.0, half, 0.0, half];
    animated_by("rotation", "VEC4", 2, &turns)
}

/// The file with values for the camera at seconds 1 and 3.
fn animated_by(path: &str, kind: &str, count: usize, values: &[f32]) -> Value {
    let mut file = file();
    let numbers = [&[1.0, 3.0], values].concat();
    let bytes: Vec<u8> = numbers.iter().flat_map(|n: &f32| n.to_le_bytes()).collect();
    let mut push = |place: &str, value: Value| {
        let all = file[place].as_array_mut().expect("an array");
        all.push(value);
    };
    let uri = format!("data:;base64,{}", STANDARD.encode(&bytes));
    push("buffers", json!({"byteLength": bytes.len(), "uri": uri}));
    push("bufferViews", json!({"buffer": 1, "byteLength": 8}));
    push(
        "bufferViews",
        json!({"buffer": 1, "byteOffset": 8, "byteLength": bytes.len() - 8}),
    );
    let accessor = |view: u32, kind: &str, count: usize| json!({"bufferView": view, "componentType": 5126, "count": count, "type": kind});
    push("accessors", accessor(2, "SCALAR", 2));
    push("accessors", accessor(3, kind, count));
    file["animations"] = json!([{
        "channels": [{"sampler": 0, "target": {"node": 2, "path": path}}],
        "samplers": [{"input": 2, "output": 3}],
    }]);
    file
}

pub(super) fn animation_of(scene: &Scene) -> &CameraAnimation {
    let animation = scene.animation.as_deref().expect("an animation");
    animation.as_ref().expect("a good one")
}

/// The error of a scene's animation; the scene is read without it.
fn animation_error(file: &Value) -> String {
    let animation = read(file).unwrap().animation.expect("an animation");
    animation
        .as_ref()
        .as_ref()
        .map(|_| ())
        .unwrap_err()
        .to_string()
}

/// Sets a value that may be new.
fn set(file: &mut Value, place: &str, value: Value) {
    let (parent, name) = place.rsplit_once('/').unwrap();
    match file.pointer_mut(parent).unwrap() {
        Value::Array(all) => all[name.parse::<usize>().unwrap()] = value,
        object => object[name] = value,
    }
}

#[test]
fn transforms_are_those_of_the_file_in_f64() {
    let at = [6378137.3, 0.1, 1e-9];
    let column = [0.3, 0.0, 0.0, 0.0, 0.0, 0.7, 0.0, 0.0, 0.0, 0.0, 1.1, 0.0];
    let matrix = [&column[..], &at, &[1.0]].concat();
    let moved = json!({"mesh": 0, "translation": at, "scale": [0.3, 0.7, 1.1]});
    for node in [moved, json!({"mesh": 0, "matrix": matrix})] {
        let mut file = file();
        file["nodes"] = json!([node]);
        file["scenes"] = json!([{"nodes": [0]}]);
        let scene = read(&file).unwrap();
        let written = scene.written().next().unwrap();
        let size = DVec3::new(0.3 * 1.5, 0.7 * 2.0, 1.1 * 3.0);
        assert_eq!(
            (written.min, written.max),
            (DVec3::from(at), DVec3::from(at) + size)
        );
    }
}

#[test]
fn transforms_that_leave_no_number_are_refused() {
    let column = [1.5e308, 0.0, 0.0, 0.0, -1.5e308, 1.0, 0.0, 0.0];
    let matrix = [&column[..], &[0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0, 1.0]].concat();
    let mut file = file();
    file["nodes"] = json!([{"mesh": 0, "matrix": matrix}]);
    file["scenes"] = json!([{"nodes": [0]}]);
    let refused = |file: &Value, wanted: &str| {
        let error = read(file).map(|_| ()).unwrap_err().to_string();
        let wanted = format!("meshes[0]: a vertex that its transforms move to {wanted}");
        assert!(error.contains(&wanted), "{error}");
    };
    refused(&file, "[-inf, 2, 0]; expected finite numbers");
    // From the bounds alone.
    let accessor = file["accessors"][0].as_object_mut().unwrap();
    accessor.remove("bufferView");
    refused(&file, "[inf, 0, 0]");
}

#[test]
fn points_without_a_triangle_are_not_copied() {
    let mut file = file();
    file["accessors"][1]["count"] = json!(3);
    let surfaces = read(&file).unwrap().surfaces.expect("triangles");
    assert_eq!((surfaces.points.len(), surfaces.triangles.len()), (6, 2));
    assert_eq!(surfaces.triangles[0], [0, 2, 1]);
}

#[test]
fn data_of_uris_may_lack_padding_and_have_any_case() {
    let mut file = file();
    // One byte beyond the 72; its base64 ends in padding.
    let uri = file["buffers"][0]["uri"].as_str().unwrap().to_owned() + "AA==";
    let bare = uri.trim_end_matches('=').to_owned();
    for uri in [
        uri.replace('=', "%3D"),
        bare,
        uri.replace("data:", "DATA:"),
        uri,
    ] {
        file["buffers"][0]["uri"] = json!(uri);
        assert_eq!(read(&file).unwrap().items.len(), 2, "{uri}");
    }
}

#[test]
fn cameras_have_their_lens_and_move_as_animated() {
    let scene = read(&animated()).unwrap();
    let view = scene.places[0].view.expect("a lens");
    let wanted = [Some(1f64.to_degrees()), None, None];
    assert_eq!([view.fovy_deg, view.aspect, view.far], wanted);
    assert!(view.near == 0.1 && view.up.distance(DVec3::Y) < 1e-6);
    let forward = |scene: &Scene, time: f64| {
        let animation = animation_of(scene);
        assert_eq!(animation.seconds, [1.0, 3.0]);
        let place = animation.at(time).expect("a direction");
        assert_eq!((place.eye, place.view), (scene.places[0].eye, Some(view)));
        place.forward
    };
    let half = std::f64::consts::FRAC_1_SQRT_2;
    let turned = [DVec3::NEG_Z, DVec3::new(-half, 0.0, -half), DVec3::NEG_X];
    for (time, wanted) in [0.0, 2.0, 9.0].into_iter().zip(turned) {
        assert!(forward(&scene, time).distance(wanted) < 1e-6, "{time}");
    }
    let mut stepped = animated();
    stepped["animations"][0]["samplers"][0]["interpolation"] = json!("STEP");
    assert_eq!(forward(&read(&stepped).unwrap(), 2.9), DVec3::NEG_Z);
    let mut two = animated();
    let nodes = two["nodes"].as_array_mut().unwrap();
    nodes[2]["children"] = json!([nodes.len()]);
    let second = json!({"camera": nodes[2]["camera"]});
    nodes.push(second);
    let clip = two["animations"][0].clone();
    two["animations"].as_array_mut().unwrap().push(clip);
    let two = read(&two).unwrap();
    assert_eq!(
        (animation_of(&two).cameras, animation_of(&two).clips),
        (2, 2)
    );
    let mut parallel = animated();
    let lens = json!({"xmag": 3, "ymag": 2, "znear": 0, "zfar": 9});
    parallel["cameras"] = json!([{"type": "orthographic", "orthographic": lens}]);
    let view = read(&parallel).unwrap().places[0].view.expect("a lens");
    let numbers = [view.ortho_height, view.aspect, view.far];
    assert_eq!(numbers, [Some(4.0), Some(1.5), Some(9.0)]);
    // A negative sign mirrors the view.
    parallel["cameras"][0]["orthographic"]["xmag"] = json!(-3);
    let mirrored = read(&parallel).unwrap().places[0].view;
    assert_eq!(mirrored, Some(view));
    for (place, value, wanted) in [
        (
            "/accessors/2/count",
            json!(1),
            "animations[0].channels[0]: 1 time and 2 values",
        ),
        (
            "/accessors/2/bufferView",
            json!(3),
            "animations[0].channels[0]: times that do not ascend",
        ),
        (
            "/bufferViews/3/extensions",
            json!({"EXT_meshopt_compression": {}}),
            "animations[0].channels[0]: is compressed",
        ),
        (
            "/animations/0/channels/0/sampler",
            json!(4),
            "animations[0].channels[0]: index 4",
        ),
    ] {
        let mut file = animated();
        set(&mut file, place, value);
        file["extensionsRequired"] = json!(["EXT_meshopt_compression"]);
        let error = animation_error(&file);
        assert!(error.contains(wanted), "{place}: {error}");
    }
}

#[test]
fn cubic_splines_bend_by_their_tangents() {
    // The x of (t - 1)^3, and its slope on both sides of each key.
    let slope = |x: f32| [x, 0.0, 0.0];
    let keys = [9.0, 0.0, 0.0, 12.0, 8.0, 9.0].map(slope);
    let mut cubic = animated_by("translation", "VEC3", 6, keys.as_flattened());
    cubic["animations"][0]["samplers"][0]["interpolation"] = json!("CUBICSPLINE");
    let scene = read(&cubic).unwrap();
    let animation = animation_of(&scene);
    for (time, x) in [
        (0.5, 0.0),
        (1.0, 0.0),
        (1.5, 0.125),
        (2.0, 1.0),
        (3.0, 8.0),
        (4.0, 8.0),
    ] {
        assert_eq!(animation.at(time).expect("a direction").eye.x, x, "{time}");
    }
    cubic["accessors"][3]["count"] = json!(5);
    let error = animation_error(&cubic);
    assert!(
        error.contains("2 times and 5 values; expected ascending times with 3 values each"),
        "{error}"
    );
}

#[test]
fn what_the_specification_allows_is_read() {
    let mut file = animated();
    let push = |all: &mut Value, value: Value| all.as_array_mut().unwrap().push(value);
    push(&mut file["scenes"], json!({"name": "empty"}));
    let pointer = json!({"sampler": 0, "target": {"path": "pointer"}});
    push(&mut file["animations"][0]["channels"], pointer);
    file["cameras"][0]["perspective"]["zfar"] = json!(1e39);
    let bare = json!({"attributes": {"COLOR_0": 0}, "mode": 0});
    push(&mut file["meshes"][0]["primitives"], bare.clone());
    push(&mut file["meshes"], json!({"primitives": [bare]}));
    file["nodes"][2]["mesh"] = json!(1);
    file["nodes"][0]["extras"] = json!([5, "any"]);
    file["asset"]["extras"] = json!(5);
    let scene = read(&file).unwrap();
    assert_eq!(scene.items, read(&animated()).unwrap().items);
    assert_eq!(
        scene.surfaces.as_ref().expect("triangles").triangles.len(),
        8
    );
    assert_eq!(animation_of(&scene).seconds, [1.0, 3.0]);
    assert_eq!(scene.places[0].view.expect("a lens").far, Some(1e39));
    let whole = file.as_object_mut().unwrap();
    assert!(whole.remove("scene").is_some() && whole.remove("scenes").is_some());
    assert_eq!(read(&file).unwrap().items, scene.items);
}

#[test]
fn unknown_chunks_of_a_glb_are_passed_over() {
    let mut file = file();
    let buffer = &mut file["buffers"][0];
    let uri = buffer["uri"].take();
    let bin = STANDARD
        .decode(uri.as_str().unwrap().split_once(',').unwrap().1)
        .unwrap();
    buffer.as_object_mut().unwrap().remove("uri");
    let json = file.to_string();
    let chunk =
        |kind: &[u8], body: &[u8]| [&(body.len() as u32).to_le_bytes(), kind, body].concat();
    let json = chunk(b"JSON", json.as_bytes());
    let [odd, bin] = [chunk(b"ODD\0", &[1; 9]), chunk(b"BIN\0", &bin)];
    let read = |chunks: &[&[u8]]| {
        let length = 12 + chunks.concat().len() as u32;
        let bytes = [
            &b"glTF\x02\0\0\0"[..],
            &length.to_le_bytes(),
            &chunks.concat(),
        ]
        .concat();
        read_gltf(&bytes, "t.glb", "t", &LoadOptions::default()).map(|scene| scene.items.len())
    };
    assert_eq!(read(&[&json, &odd, &bin]).unwrap(), 2);
    assert_eq!(read(&[&json, &bin, &odd]).unwrap(), 2);
    assert!(read(&[&json, &odd[..12], &bin]).is_err());
    let error = read(&[&json]).unwrap_err().to_string();
    assert!(
        error.contains("buffers[0]: no bytes; expected a uri"),
        "{error}"
    );
}

#[test]
fn instances_are_items() {
    let mut file = file();
    let mut instances = |attributes: Value| {
        let instancing = json!({"EXT_mesh_gpu_instancing": {"attributes": attributes}});
        file["nodes"][1]["extensions"] = instancing;
        let read = read(&file).map(|scene| scene.items.len());
        read.map_err(|error| error.to_string())
    };
    for attributes in [json!({"TRANSLATION": 0}), json!({"_COLOR": 0})] {
        assert_eq!(instances(attributes), Ok(1 + 4));
    }
    let error = instances(json!({"TRANSLATION": 0, "_ID": 1})).unwrap_err();
    let wanted = "instancing: attributes of 4 to 12 elements; expected as many of each";
    assert!(error.contains(wanted), "{error}");
    assert!(instances(json!({})).unwrap_err().contains("0 elements"));
    // Of 72 bytes.
    file["accessors"][1]["count"] = json!(73);
    file["nodes"][1]["extensions"]["EXT_mesh_gpu_instancing"]["attributes"] = json!({"_ID": 1});
    let error = read(&file).map(|_| ()).unwrap_err().to_string();
    assert!(
        error.contains("73 elements; expected as many of each, 1 to 72"),
        "{error}"
    );
    // Four zero bytes: not a rotation.
    let zero = json!({"bufferView": 0, "componentType": 5121, "count": 1, "type": "VEC4"});
    file["accessors"].as_array_mut().unwrap().push(zero);
    file["nodes"][1]["extensions"]["EXT_mesh_gpu_instancing"]["attributes"] =
        json!({"ROTATION": 2});
    let error = read(&file).map(|_| ()).unwrap_err().to_string();
    let wanted = "EXT_mesh_gpu_instancing, instance 0: a transform that is not finite";
    assert!(error.contains(wanted), "{error}");
}

#[test]
fn a_file_that_many_buffers_name_is_read_once() {
    let mut file = file();
    let own = file["buffers"][0]["uri"].as_str().unwrap();
    let bytes = STANDARD.decode(own.split_once(',').unwrap().1).unwrap();
    let buffer = json!({"byteLength": bytes.len(), "uri": "b.bin"});
    file["buffers"] = json!(vec![buffer; 1000]);
    file["bufferViews"][1]["buffer"] = json!(999);
    let reads = std::cell::Cell::new(0);
    let beside = |uri: &str| {
        assert_eq!(uri, "b.bin");
        reads.set(reads.get() + 1);
        Ok(bytes.clone())
    };
    let text = file.to_string();
    let options = LoadOptions::default();
    let scene = read_beside(text.as_bytes(), ["t.gltf", "t"], &options, &beside).unwrap();
    assert_eq!((scene.items.len(), reads.get()), (2, 1));
    assert_eq!(scene.items, read(&self::file()).unwrap().items);
}

mod damaged;
mod materials;
mod without_triangles;
