//! Reading test vectors: JSON with the answers that exact arithmetic gave. It
//! owns the format and every way in which a file can be wrong; asking the
//! vectors is left to the files beside this one.

use std::collections::BTreeSet;
use std::path::Path;

use serde_json::Value;

use super::json::{At, of, shown};
use super::vector::{Names, Vector};
use crate::input::InputError;
use crate::json::from_json;

/// The vectors that come with the program.
pub const BUILT_IN: &str = include_str!("../../datasets/vectors.json");
/// What messages call them.
pub const BUILT_IN_NAME: &str = "datasets/vectors.json";

/// The vectors that come with the program.
///
/// # Errors
/// None, unless the file in the source was broken; a test reads it.
pub fn built_in() -> Result<Vec<Vector>, InputError> {
    read_vectors(BUILT_IN.as_bytes(), BUILT_IN_NAME)
}

/// [`read_vectors`] from a file on disk.
///
/// # Errors
/// A file that cannot be read, or is wrong.
pub fn read_vectors_file(path: &Path) -> Result<Vec<Vector>, InputError> {
    let bytes = std::fs::read(path).map_err(|source| InputError::Io {
        path: path.to_owned(),
        source,
    })?;
    read_vectors(&bytes, &path.display().to_string())
}

/// Reads a file of vectors: an object with the array `vectors`, or the array
/// alone. Numbers may be given as the words NaN, Infinity (inf) and
/// -Infinity (-inf); fields that are not known are left alone.
///
/// # Errors
/// One line: the file, the vector and field, what was found and expected.
pub fn read_vectors(bytes: &[u8], file: &str) -> Result<Vec<Vector>, InputError> {
    let json: Value = from_json(bytes).map_err(|error| InputError::Value {
        file: file.to_owned(),
        place: error.place(),
        found: error.found,
        expected: "JSON: an object with the array 'vectors'".into(),
    })?;
    let list = match &json {
        Value::Array(list) => list,
        Value::Object(object) => {
            let top = At::new(file, "the top level".into());
            let format = object.get("format").unwrap_or(&Value::Null);
            if !(format.is_null() || format.as_f64() == Some(1.0)) {
                return Err(top.wrong(&format!("format {}", of(format)), "format 1"));
            }
            let list = object.get("vectors").unwrap_or(&Value::Null);
            let list = list.as_array();
            list.ok_or_else(|| top.wrong("no array 'vectors'", "an array of vectors"))?
        }
        other => {
            let top = At::new(file, "the top level".into());
            return Err(top.wrong(&of(other), "an object with the array 'vectors'"));
        }
    };
    let mut seen = Names::new();
    let vectors = list.iter().enumerate().map(|(index, value)| {
        let vector = vector(value, file, index)?;
        if !seen.insert(vector.id.clone()) {
            let at = At::new(file, format!("vector {index}"));
            let found = format!("the id '{}' a second time", shown(&vector.id));
            return Err(at.wrong(&found, "an id of its own"));
        }
        Ok(vector)
    });
    vectors.collect()
}

fn vector(value: &Value, file: &str, index: usize) -> Result<Vector, InputError> {
    let at = At::new(file, format!("vector {index}"));
    let object = at.object(value)?;
    let id = at.child("id").name(at.required(object, "id")?)?;
    let at = At::new(file, format!("vector {index} ({})", shown(&id)));
    let optional = |field: &str| object.get(field).filter(|value| !value.is_null());
    let names = |field: &str| -> Result<Option<Names>, InputError> {
        let read = optional(field).map(|value| at.child(field).names(value));
        read.transpose()
    };
    let error = |field: &str| match optional(field) {
        None | Some(Value::Bool(false)) => Ok(None),
        Some(Value::Bool(true)) => Ok(Some("an error".to_owned())),
        Some(Value::String(text)) => Ok(Some(text.clone())),
        Some(other) => Err(at.child(field).wrong(&of(other), "the error in words")),
    };
    let elements = |field: &str| match optional(field) {
        None => Ok(Vec::new()),
        Some(value) => at.child(field).elements(value),
    };
    let planes = |field: &str, number: fn(&At, &Value) -> Result<f32, InputError>| {
        let rows = optional(field).map(|rows| at.child(field).planes(rows, number));
        rows.transpose()
    };
    // Bits are what the answers were found for.
    let planes = match planes("planes_f32_hex", |at, value| at.bits(value))? {
        None => planes("planes", |at, value| at.f32_number(value))?,
        bits => bits,
    };
    let camera = optional("camera").map(|value| at.child("camera").camera(value));
    let mut boxes = Vec::new();
    let mut seen = BTreeSet::new();
    for (at, value) in elements("boxes")? {
        let (name, b) = at.bounds(value)?;
        if !seen.insert(name.clone()) {
            let found = format!("the id '{}' a second time", shown(&name));
            return Err(at.wrong(&found, "an id of its own"));
        }
        boxes.push((name, b));
    }
    let points = elements("points")?;
    let points = points.iter().map(|(at, value)| at.point(value));
    Ok(Vector {
        category: match optional("category") {
            None => "vector".to_owned(),
            Some(value) => at.child("category").name(value)?,
        },
        planes,
        camera: camera.transpose()?,
        boxes,
        points: points.collect::<Result<_, _>>()?,
        visible_planes: names("expected_visible_planes")?,
        touch_planes: names("touch_planes")?,
        visible_camera: names("expected_visible_camera")?,
        touch_camera: names("touch_camera")?,
        six_plane: match names("observed_f32_pvertex_mul_add")? {
            None => names("p_vertex_exact_visible")?,
            some => some,
        },
        six_plane_exact: names("p_vertex_exact_visible")?,
        camera_error: error("expect_camera_error")?,
        planes_error: error("expect_planes_error")?,
        rejected_at_load: names("expect_rejected_at_load")?.unwrap_or_default(),
        empty_boxes: names("expect_empty_boxes")?.unwrap_or_default(),
        id,
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_built_in_vectors_can_be_read() {
        let vectors = built_in().unwrap();
        assert_eq!(vectors.len(), 55);
        let boxes: usize = vectors.iter().map(|v| v.boxes.len()).sum();
        assert_eq!(boxes, 688);
        let infinite = vectors
            .iter()
            .filter_map(|v| v.camera)
            .filter(|c| c.far.is_none());
        assert_eq!(infinite.count(), 1);
        let points: usize = vectors.iter().map(|v| v.points.len()).sum();
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
            ("3".into(), "the top level: '3'; expected an object"),
            ("{}".into(), "no array 'vectors'"),
            (
                r#"{"format":2,"vectors":[]}"#.into(),
                "format '2'; expected format 1",
            ),
            ("[3]".into(), "vector 0: '3'; expected an object"),
            ("[{}]".into(), "vector 0: no 'id'; expected the field 'id'"),
            (
                r#"[{"id":true}]"#.into(),
                "vector 0, id: 'true'; expected a name",
            ),
            (
                r#"[{"id":"v"},{"id":"v"}]"#.into(),
                "vector 1: the id 'v' a second time",
            ),
            (
                boxed(r#"{"id":"b","lo":[0,0,0]}"#),
                "vector 0 (v), boxes[0]: no 'hi'",
            ),
            (
                boxed(r#"{"id":"b","lo":[0,0],"hi":0}"#),
                "boxes[0], lo: 2 elements; expected three",
            ),
            (
                boxed(r#"{"id":"b","lo":[0,0,"x"],"hi":[1,1,1]}"#),
                r#"boxes[0], lo[2]: '"x"'; expected a number, NaN, Infinity"#,
            ),
            (
                boxed(
                    r#"{"id":"b","lo":[0,0,0],"hi":[1,1,1]},{"id":"b","lo":[0,0,0],"hi":[1,1,1]}"#,
                ),
                "boxes[1]: the id 'b' a second time",
            ),
            (
                with(r#""planes":[[1,2,3]]"#),
                "planes[0]: 3 elements; expected four",
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
                "boxes[0], hi[2]: '0.10000000001'; expected a number that f32 holds",
            ),
            (with(r#""camera":{"eye":[0,0,0]}"#), "camera: no 'look'"),
            (
                with(r#""camera":[]"#),
                "camera: an array of 0; expected an object",
            ),
            (
                with(r#""expected_visible_planes":"all""#),
                "expected_visible_planes: '\"all\"'",
            ),
            (with(r#""expect_camera_error":[1]"#), "the error in words"),
            (
                with(r#""points":[{"id":"p","p":[0,0,0]}]"#),
                "points[0]: no 'expected_containing'",
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

    #[test]
    fn words_are_numbers_and_infinity_has_many_spellings() {
        let text = r#"{"vectors":[{"id":7,"x":{},"camera":{"eye":[0,"-inf","NaN"],"look":[0,0,1],
            "up":[0,1,0],"fovy_deg":60,"aspect":1,"near":1,"far":"Infinity"},"expect_camera_error":true,
            "boxes":[{"id":0,"lo":["-Infinity",0,-0.0],"hi":[1e39,0.1,1]}]}]}"#;
        let vectors = read_vectors(text.as_bytes(), "f.json").unwrap();
        let camera = vectors[0].camera.unwrap();
        assert!(camera.far.is_none() && camera.eye.y == f64::NEG_INFINITY);
        assert!(camera.camera().is_err() && vectors[0].camera_error.is_some());
        let (name, b) = &vectors[0].boxes[0];
        assert_eq!((name.as_str(), b.max.x, b.max.y), ("0", f32::INFINITY, 0.1));
    }
}
