//! Vectors as they are read and answered.

use std::sync::Mutex;

use super::*;
use crate::input::tell_notes;

#[test]
fn the_built_in_vectors_can_be_read() {
    let vectors = built_in().unwrap();
    assert_eq!(vectors.len(), 55);
    let boxes: usize = vectors.iter().map(|v| v.boxes().len()).sum();
    assert_eq!(boxes, 688);
    let infinite = vectors
        .iter()
        .filter_map(|v| v.camera)
        .filter(|c| c.camera().is_ok_and(|c| c.lens.far().is_none()));
    assert_eq!(infinite.count(), 1);
    let points: usize = vectors.iter().map(|v| v.points().len()).sum();
    assert!(points >= 12);
}

#[test]
fn every_mistake_is_one_line_that_says_where() {
    let boxed = |b: &str| format!(r#"[{{"id":"v","boxes":[{b}]}}]"#);
    let with = |field: &str| format!(r#"[{{"id":"v",{field}}}]"#);
    let cases = [
        (String::new(), "f.json, line 1, column 0: the text ends"),
        (
            "{\"vectors\":[}".into(),
            "f.json, line 1, column 13, vectors[0]: no JSON (expected value)",
        ),
        (
            "3".into(),
            "column 1: '3'; expected an object with the array",
        ),
        ("{}".into(), "no field 'vectors'"),
        (
            r#"{"format":2,"vectors":[]}"#.into(),
            "format: '2.0'; expected format 1",
        ),
        ("[3]".into(), "[0]: '3'; expected an object"),
        ("[{}]".into(), "[0]: no field 'id'; expected"),
        (r#"[{"id":true}]"#.into(), "[0].id: 'true'; expected a name"),
        (
            r#"[{"id":"v"},{"id":"v"}]"#.into(),
            "vectors[1]: the id 'v' a second time",
        ),
        (
            boxed(r#"{"id":"b","lo":[0,0,0]}"#),
            "[0].boxes[0]: no field 'hi'",
        ),
        (
            boxed(r#"{"id":"b","lo":[0,0],"hi":0}"#),
            "boxes[0].lo: 2 values; expected three",
        ),
        (
            boxed(r#"{"id":"b","lo":[0,0,"x"],"hi":[1,1,1]}"#),
            "boxes[0].lo[2]: the text 'x'; expected a number",
        ),
        (
            boxed(r#"{"id":"b","lo":[0,0,0],"hi":[1,1,1]},{"id":"b","lo":[0,0,0],"hi":[1,1,1]}"#),
            "boxes[1]: the id 'b' a second time",
        ),
        (
            with(r#""planes":[[1,2,3]]"#),
            "planes[0]: 3 values; expected four",
        ),
        (
            with(r#""planes_f32_hex":[["0x3f80000","","",""]]"#),
            "planes_f32_hex[0][0]: ",
        ),
        (
            with(r#""planes":[[1,0,0,-1.00000000001]]"#),
            "planes[0][3]: '-1.00000000001'; expected a number that f32 holds",
        ),
        (
            boxed(r#"{"id":"b","lo":[0,0,0],"hi":[1,0.1000001,0.10000000001]}"#),
            "boxes[0].hi[2]: '0.10000000001'; expected a number that f32 holds",
        ),
        (
            with(r#""camera":{"eye":[0,0,0]}"#),
            "camera: no field 'look'",
        ),
        (
            with(r#""camera":[]"#),
            "camera: 0 values; expected an object",
        ),
        (
            with(r#""expected_visible_planes":"all""#),
            "expected_visible_planes: the text 'all'; expected a list",
        ),
        (with(r#""expect_camera_error":[1]"#), "the error in words"),
        (
            with(r#""points":[{"id":"p","p":[0,0,0]}]"#),
            "points[0]: no field 'expected_containing'",
        ),
        (
            with(r#""touch_camera":["b"]"#),
            "vectors[0].camera: claims about a camera",
        ),
        (
            with(r#""expect_camera_error":"fov""#),
            "vectors[0].camera: claims about a camera",
        ),
        (
            with(r#""p_vertex_exact_visible":["b"]"#),
            "vectors[0].planes: claims about planes",
        ),
        (
            with(r#""expect_planes_error":true"#),
            "vectors[0].planes: claims about planes",
        ),
        (
            with(&format!(
                r#"{CAMERA},"expect_camera_error":true,"expected_visible_camera":["b"]"#
            )),
            "vectors[0].expect_camera_error: an error, and boxes",
        ),
        (
            with(
                &format!(
                    r#""planes":[[0,0,1,-0.0],["NaN",0,0,0],[1,0,0,2]],"planes_f32_hex":[{HEX},
                ["0x7fc00001","0x0","0x0","0x0"],["0x3f800000","0x0","0x0","0x0"]]"#
                )
                .replace("0x0\"", "0x00000000\""),
            ),
            "vectors[0].planes_f32_hex[2]: another plane",
        ),
    ];
    for (text, wanted) in cases {
        let error = read_vectors(text.as_bytes(), "f.json")
            .unwrap_err()
            .to_string();
        assert!(
            error.starts_with("f.json, ") && error.contains(wanted),
            "{text}: {error}"
        );
        assert!(
            error.contains("expected") && !error.contains('\n'),
            "{error}"
        );
    }
}

const CAMERA: &str = r#""camera":{"eye":[0,0,0],"look":[0,0,1],"up":[0,1,0],"fovy_deg":180,
    "aspect":1,"near":1}"#;
const HEX: &str = r#"["0x0","0x80000000","0x3f800000","0x0"]"#;

#[test]
fn lists_without_names_claim_nothing() {
    let text = format!(
        r#"[{{"id":"v","expected_visible_camera":[],"touch_camera":null,"touch_planes":[],
        "expect_camera_error":false}},{{"id":"w",{CAMERA},"expected_visible_camera":[],
        "expect_camera_error":"fov","x":1}}]"#
    );
    assert_eq!(read_vectors(text.as_bytes(), "f.json").unwrap().len(), 2);
}

#[test]
fn fields_like_those_that_are_read_are_told() {
    static HEARD: Mutex<Vec<String>> = Mutex::new(Vec::new());
    tell_notes(|note| HEARD.lock().unwrap().push(note.to_owned()));
    let text =
        r#"[{"id":"v","Camera":{},"Boxes":[],"x":1,"margin_camera":{}},{"id":"w","Boxes":0}]"#;
    read_vectors(text.as_bytes(), "note-v.json").unwrap();
    read_vectors(BUILT_IN.as_bytes(), "note-b.json").unwrap();
    let heard = HEARD.lock().unwrap();
    let heard: Vec<&String> = heard.iter().filter(|n| n.contains("note-")).collect();
    assert_eq!(
        heard,
        [
            "note: note-v.json: field 'Boxes' is not read (did you mean 'boxes'?)",
            "note: note-v.json: field 'Camera' is not read (did you mean 'camera'?)",
        ]
    );
}

#[test]
fn words_are_numbers_and_infinity_has_many_spellings() {
    let text = r#"{"vectors":[{"id":7,"x":{},"camera":{"eye":[0,"-inf","NaN"],"look":[0,0,1],
        "up":[0,1,0],"fovy_deg":60,"aspect":1,"near":1,"far":"Infinity"},"expect_camera_error":true,
        "boxes":[{"id":0,"lo":["-Infinity",0,-0.0],"hi":[1e39,0.1,1]}]}]}"#;
    let vectors = read_vectors(text.as_bytes(), "f.json").unwrap();
    let camera = vectors[0].camera.unwrap();
    let far = camera.far.expect("infinity").0;
    assert!(far == f64::INFINITY && camera.eye.0[1].0 == f64::NEG_INFINITY);
    assert!(camera.camera().is_err() && vectors[0].camera_error().is_some());
    let b = vectors[0].boxes().next().unwrap();
    let max = b.bounds().max;
    assert_eq!((b.id.0.as_str(), max.x, max.y), ("0", f32::INFINITY, 0.1));
}
