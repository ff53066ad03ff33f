//! Points, lines, and meshes that are compressed or sparse.

use super::*;

/// The file with another item that has its own primitive.
fn beside(primitive: Value) -> Value {
    let mut file = file();
    let push = |all: &mut Value, value: Value| all.as_array_mut().unwrap().push(value);
    push(&mut file["meshes"], json!({"primitives": [primitive]}));
    push(
        &mut file["nodes"],
        json!({"mesh": 1, "rotation": [0.3, 0.1, 0.0, 0.9]}),
    );
    push(&mut file["scenes"][0]["nodes"], json!(3));
    file
}

fn draco() -> Value {
    json!({"KHR_draco_mesh_compression": {"bufferView": 0, "attributes": {}}})
}

#[test]
fn points_and_lines_are_in_the_box_of_their_item_alone() {
    let whole = read(&file()).unwrap();
    for mode in 0..4 {
        let lines = json!({"attributes": {"POSITION": 0}, "mode": mode});
        let scene = read(&beside(lines.clone())).unwrap();
        assert_eq!(scene.items[..2], whole.items);
        let surfaces = scene.surfaces.as_ref().expect("triangles");
        let counts = surfaces.of_item.iter().map(|own| own.len());
        assert_eq!(counts.collect::<Vec<_>>(), [4, 4, 0]);
        let turn = DQuat::from_xyzw(0.3, 0.1, 0.0, 0.9).normalize();
        let points = POINTS.map(|p| WorldBox::at(turn * DVec3::from(p.map(f64::from))));
        let (wanted, b) = (WorldBox::union_of(points), scene.written().nth(2).unwrap());
        assert!(b.min.distance(wanted.min) < 1e-12 && b.max.distance(wanted.max) < 1e-12);
        assert_eq!(
            scene
                .by_triangle(&LoadOptions::default())
                .unwrap()
                .items
                .len(),
            8
        );
        // In the same mesh, where then only two points have triangles.
        let mut same = file();
        same["meshes"][0]["primitives"]
            .as_array_mut()
            .unwrap()
            .push(lines);
        same["accessors"][1]["count"] = json!(3);
        assert_eq!(read(&same).unwrap().items, whole.items);
        let mut alone = file();
        alone["meshes"][0]["primitives"][0]["mode"] = json!(mode);
        let alone = read(&alone).unwrap();
        assert_eq!(
            (&alone.items, alone.surfaces.is_none()),
            (&whole.items, true)
        );
    }
}

#[test]
fn what_is_compressed_is_seen_as_the_box_of_its_bounds() {
    let whole = read(&file()).unwrap();
    let primitive = json!({"attributes": {"POSITION": 0}, "extensions": draco()});
    let mut file = beside(primitive);
    // The compression is not required: core glTF has the data too.
    assert_eq!(read(&file).unwrap().surfaces.unwrap().of_item[2], 8..9);
    file["extensionsRequired"] = json!(["KHR_draco_mesh_compression"]);
    let scene = read(&file).unwrap();
    assert_eq!(scene.items[..2], whole.items);
    let surfaces = scene.surfaces.as_ref().expect("triangles");
    assert_eq!(surfaces.of_item[2], 8..20);
    assert_eq!(surfaces.kinds[8..], [SurfaceKind::CutOut; 12]);
    assert!(scene.items[2].contains_point(surfaces.bounds(2).min));
    assert!(surfaces.volume(2) > 8.99);
    file["accessors"][0]["min"][0] = json!(9);
    let error = read(&file).map(|_| ()).unwrap_err().to_string();
    let wanted = "accessors[0]: no bounds of positions; expected min <= max";
    assert!(error.contains(wanted), "{error}");
}

#[test]
fn a_file_of_compressed_meshes_alone_has_boxes() {
    let whole = read(&file()).unwrap();
    let mut draco_only = file();
    draco_only["meshes"][0]["primitives"][0]["extensions"] = draco();
    draco_only["extensionsRequired"] = json!(["KHR_draco_mesh_compression"]);
    let mut meshopt = file();
    let view =
        json!({"buffer": 1, "byteLength": 48, "extensions": {"EXT_meshopt_compression": {}}});
    meshopt["bufferViews"][0] = view;
    meshopt["buffers"]
        .as_array_mut()
        .unwrap()
        .push(json!({"byteLength": 48}));
    for file in [draco_only, meshopt] {
        let scene = read(&file).unwrap();
        assert!(scene.surfaces.is_none());
        for (all, triangles) in scene.written().zip(whole.written()) {
            let margin = DVec3::splat(1e-12);
            assert!(all.min.cmple(triangles.min + margin).all());
            assert!(all.max.cmpge(triangles.max - margin).all());
        }
    }
}

#[test]
fn sparse_accessors_replace_some_elements() {
    let mut file = file();
    let moved = [5.0f32, 0.0, 0.0, 0.0, 0.0, 7.0].map(f32::to_le_bytes);
    let bytes = [&[1, 3][..], &[0; 2], moved.as_flattened()].concat();
    let uri = format!("data:;base64,{}", STANDARD.encode(&bytes));
    let push = |all: &mut Value, value: Value| all.as_array_mut().unwrap().push(value);
    push(&mut file["buffers"], json!({"byteLength": 28, "uri": uri}));
    push(
        &mut file["bufferViews"],
        json!({"buffer": 1, "byteLength": 28}),
    );
    file["accessors"][0]["sparse"] = json!({"count": 2,
        "indices": {"bufferView": 2, "componentType": 5121},
        "values": {"bufferView": 2, "byteOffset": 4}});
    let points = |file: &Value| {
        read(file)
            .unwrap()
            .surfaces
            .expect("triangles")
            .points
            .clone()
    };
    let mut plain = self::file();
    let all = [POINTS[0], [5.0, 0.0, 0.0], POINTS[2], [0.0, 0.0, 7.0]];
    let all: Vec<u8> = all
        .as_flattened()
        .iter()
        .flat_map(|n| n.to_le_bytes())
        .collect();
    let corners = CORNERS.as_flattened().iter().flat_map(|n| n.to_le_bytes());
    let all: Vec<u8> = all.into_iter().chain(corners).collect();
    plain["buffers"][0]["uri"] = json!(format!("data:;base64,{}", STANDARD.encode(all)));
    assert_eq!(points(&file), points(&plain));
    let mut long = file.clone();
    long["accessors"][0]["sparse"]["count"] = json!(u64::MAX);
    let error = read(&long).map(|_| ()).unwrap_err().to_string();
    assert!(
        error.contains("accessors[0]: 18446744073709551615 elements that end"),
        "{error}"
    );
    // Zeros without a view.
    let whole = file["accessors"][0].as_object_mut().unwrap();
    whole.remove("bufferView");
    let zeros = points(&file);
    assert_eq!((zeros[0], zeros.len()), (zeros[1], 8));
    for (count, index, wanted) in [
        (
            1_000_000,
            1,
            "1000000 elements of zeros; expected at most 100",
        ),
        (
            3,
            1,
            "accessors[0]: sparse element 3; expected an index below its count",
        ),
    ] {
        file["accessors"][0]["count"] = json!(count);
        file["accessors"][1]["count"] = json!(index);
        let error = read(&file).map(|_| ()).unwrap_err().to_string();
        assert!(error.contains(wanted), "{error}");
    }
}
