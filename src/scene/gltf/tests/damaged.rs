//! Damaged files.

use super::*;

#[test]
fn what_is_wrong_is_named_with_its_place() {
    let whole = file();
    let uri = whole["buffers"][0]["uri"].as_str().unwrap();
    // The x of the second point is NaN.
    let bytes = STANDARD.decode(uri.split_once(',').unwrap().1).unwrap();
    let bytes = [&bytes[..12], &[0xff; 4], &bytes[16..]].concat();
    let nan = format!("data:;base64,{}", STANDARD.encode(bytes));
    let cases: [(&str, Value, &str); 23] = [
        ("/nodes/2/camera", json!(1), "nodes[2].camera: index 1"),
        (
            "/buffers/0/uri",
            json!(nan),
            "accessors[0]: point 1 is [NaN, 0, 0]; expected finite",
        ),
        (
            "/nodes/1/children",
            json!([0]),
            "nodes[0]: a node that is reached twice",
        ),
        (
            "/nodes/0/mesh",
            json!(7),
            "nodes[0].mesh: index 7; expected an index below 1",
        ),
        (
            "/nodes/0/rotation",
            json!([0, 0, 0, 0]),
            "nodes[0]: a transform that is not finite",
        ),
        ("/nodes/0/children", json!([99]), "nodes[99]: index 99"),
        ("/scene", json!(3), "scene: index 3"),
        (
            "/accessors/0/count",
            json!(5),
            "accessors[0]: 5 elements that end behind their buffer",
        ),
        (
            "/accessors/0/count",
            json!(u64::MAX),
            "expected a smaller input",
        ),
        ("/accessors/1/count", json!(13), "accessors[1]: 13 elements"),
        (
            "/accessors/1/componentType",
            json!(5122),
            "accessors[1]: indices of type 5122; expected 5121, 5123 or 5125",
        ),
        (
            "/accessors/1/normalized",
            json!(true),
            "accessors[1]: normalized indices; expected 5121",
        ),
        (
            "/meshes/0/primitives/0/mode",
            json!(7),
            "meshes[0].primitives[0]: an unknown mode",
        ),
        (
            "/cameras/0/type",
            json!("orthographic"),
            "cameras[0]: no lens; expected type 'perspective'",
        ),
        ("/scenes", json!([]), "scene: index 0; expected no index"),
        ("/buffers/0/uri", json!("-"), "./-: "),
        (
            "/accessors/0/type",
            json!("VEC2"),
            "accessors[0]: elements of 2 numbers",
        ),
        (
            "/bufferViews/0/byteOffset",
            json!(u64::MAX),
            "accessors[0]: 4 elements",
        ),
        (
            "/buffers/0/uri",
            json!("data:;base64,???"),
            "buffers[0].uri: bytes that are no base64",
        ),
        (
            "/asset/version",
            json!("1.0"),
            "glTF of version '1.0'; expected glTF 2.0",
        ),
        (
            "/asset",
            json!({"version": "2.0", "minVersion": "2.1"}),
            "glTF of version '2.1'; expected glTF 2.0",
        ),
        (
            "/buffers/0/uri",
            json!(""),
            "buffers[0].uri: ''; expected a file beside",
        ),
        (
            "/nodes/0",
            json!({"mesh": 0, "matrix": [1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 5, 6, 7, 2]}),
            "nodes[0].matrix: a last row of [0, 0, 0, 2]; expected [0, 0, 0, 1]",
        ),
    ];
    for (place, value, wanted) in cases {
        let mut file = file();
        set(&mut file, place, value);
        let error = read(&file).map(|_| ()).unwrap_err().to_string();
        assert!(error.contains(wanted), "{place}: {error}");
        assert!(
            error.contains("expected") && !error.contains('\n'),
            "{error}"
        );
    }
}

#[test]
fn no_damage_ends_in_a_panic() {
    let text = file().to_string().into_bytes();
    let mut rng = SeededRng::new(5);
    for _ in 0..3000 {
        let mut bytes = text.clone();
        for _ in 0..1 + rng.below(3) {
            let at = rng.below(bytes.len());
            bytes[at] = b"0123456789-e.,[]{}\" "[rng.below(20)];
        }
        if let Err(error) = read_gltf(&bytes, "t.gltf", "t", &LoadOptions::default()) {
            assert!(!error.to_string().contains('\n'), "{error}");
        }
    }
}
