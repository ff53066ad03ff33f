//! Reading of vectors, and the answers to them.

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
        (String::new(), "f.json, line 1, column 1: the text ends"),
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
            with(
                r#""points":[{"id":"p","p":[0,0,0],"expected_containing":[]},{"id":"p","p":[0,0,0],"expected_containing":["b"]}]"#,
            ),
            "points[1]: the id 'p' a second time",
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

static HEARD: Mutex<Vec<String>> = Mutex::new(Vec::new());

/// Notes on reading a file with one or more vectors.
fn notes(file: &str, vectors: &str) -> Vec<String> {
    tell_notes(|note| HEARD.lock().unwrap().push(note.to_owned()));
    read_vectors(vectors.as_bytes(), file).unwrap();
    let heard = HEARD.lock().unwrap();
    let about = |note: &String| Some(note.strip_prefix("note: ")?.strip_prefix(file)?.to_owned());
    heard.iter().filter_map(about).collect()
}

#[test]
fn claims_and_fields_that_are_not_judged_are_told() {
    let camera = r#""camera":{"eye":[0,0,0],"look":[0,0,1],"up":[0,1,0],"fovy_deg":180,
        "aspect":1,"near":1}"#;
    let seen = format!(r#"{camera},"expect_camera_error":true,"expected_visible_camera":["b"]"#);
    let differ = |last: &str| {
        let zero = "0x00000000";
        format!(
            r#""planes":[[0,0,1,-0.0],["NaN",0,0,0],[1,0,0,{last}]],"planes_f32_hex":[["{zero}",
            "0x80000000","0x3f800000","{zero}"],["0x7fc00001","{zero}","{zero}","{zero}"],
            ["0x3f800000","{zero}","{zero}","{zero}"]]"#
        )
    };
    let (of_camera, of_planes) = ("claims about a camera but no", "claims about planes but no");
    let cases = [
        (r#""touch_camera":["b"]"#, of_camera),
        (r#""expect_camera_error":"fov""#, of_camera),
        (r#""p_vertex_exact_visible":["b"]"#, of_planes),
        (r#""expect_planes_error":true"#, of_planes),
        (&seen, "boxes seen by a camera that must be refused"),
        (
            r#""Camera":{},"x":1"#,
            "field 'Camera' of 'vectors' is not read (did you mean 'camera'?)",
        ),
        (
            &camera.replace("near", "Far\":8,\"near"),
            "field 'Far' of 'camera' is not read (did you mean 'far'?)",
        ),
        (
            &camera.replace("near", "ortho_height\":8,\"near"),
            "field 'ortho_height' of 'camera' is not read",
        ),
        (
            r#""plane_method":"magic""#,
            "vectors[0]: a plane_method that is none of the format; not judged",
        ),
        (r#""plane_method":"gh_gl_f32""#, ""),
        (
            r#""normals":"outward""#,
            "vectors[0]: normals that are not inward; not judged",
        ),
        (
            r#""semantics":"open: inside iff n.p+d > 0""#,
            "vectors[0]: semantics that are not closed; not judged",
        ),
        (
            r#""normals":"inward","semantics":"closed: box [lo,hi]""#,
            "",
        ),
        // A list without names makes no claim.
        (
            r#""expected_visible_camera":[],"touch_camera":null,"touch_planes":[]"#,
            "",
        ),
        (
            r#""expect_camera_error":false,"margin_camera":{},"points":null"#,
            "",
        ),
        (
            &format!(r#"{camera},"touch_camera":[],"expect_camera_error":"fov""#),
            "",
        ),
        (&differ("0"), ""),
    ];
    for (n, (fields, wanted)) in cases.into_iter().enumerate() {
        let text = format!(r#"[{{"id":"v",{fields}}},{{"id":"w",{fields}}}]"#);
        let heard = notes(&format!("note-{n}.json"), &text);
        let is_right = heard
            .iter()
            .all(|note| !wanted.is_empty() && note.contains(wanted));
        assert!(
            is_right && heard.len() == usize::from(!wanted.is_empty()),
            "{fields}: {heard:?}"
        );
    }
    assert_eq!(notes("note-b.json", BUILT_IN), [""; 0]);
    let counted = |count| format!(r#"{{"count":{count},"vectors":[{{"id":"v"}}]}}"#);
    let wanted = [": count is 9 for 1 vector"];
    assert_eq!(notes("note-c.json", &counted("9")), wanted);
    assert_eq!(notes("note-d.json", &counted("1.0")), [""; 0]);
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
