//! Reading test vectors: JSON with the answers that exact arithmetic gave. It
//! owns the format; asking the vectors is left to the files beside this one.

use std::collections::BTreeSet;
use std::fmt;
use std::path::Path;

use glam::{DVec3, Vec3};
use serde::de::{Error, Unexpected, Visitor};
use serde::{Deserialize, Deserializer};

use super::vector::{Names, Vector, VectorCamera, VectorPoint};
use crate::geometry::{Aabb, Plane};
use crate::input::InputError;
use crate::json::{JsonError, from_json};
use crate::shown::plain;

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
/// One line: the file, the path of the field, what was found and expected.
pub fn read_vectors(bytes: &[u8], file: &str) -> Result<Vec<Vector>, InputError> {
    let wrong = |place: String, found: String, expected: String| InputError::Value {
        file: file.to_owned(),
        place,
        found,
        expected,
    };
    let is_array = bytes.iter().find(|byte| b"[{".contains(byte)) == Some(&b'[');
    let read = match is_array {
        true => from_json(bytes).map(|vectors| File {
            format: (),
            vectors,
        }),
        false => from_json(bytes),
    };
    let refused = |error: JsonError| {
        let place = error.place();
        let expected = error.expected;
        let expected = expected.unwrap_or_else(|| format!("JSON in the form of {BUILT_IN_NAME}"));
        wrong(place, error.found, expected)
    };
    let vectors: Vec<Written> = read.map_err(refused)?.vectors;
    let again = |place: String, id: &str| {
        let found = format!("the id '{}' a second time", plain(id));
        wrong(place, found, "an id of its own".to_owned())
    };
    let mut seen = BTreeSet::new();
    for (n, vector) in vectors.iter().enumerate() {
        if !seen.insert(&vector.id.0) {
            return Err(again(format!("vectors[{n}]"), &vector.id.0));
        }
        let mut names = BTreeSet::new();
        let boxes = vector.boxes.iter().flatten().enumerate();
        let mut twice = boxes.filter(|(_, b)| !names.insert(&b.id.0));
        if let Some((i, b)) = twice.next() {
            return Err(again(format!("vectors[{n}].boxes[{i}]"), &b.id.0));
        }
    }
    Ok(vectors.into_iter().map(Vector::from).collect())
}

#[derive(Deserialize)]
#[serde(expecting = "an object with the array 'vectors'")]
struct File {
    #[serde(default, deserialize_with = "format")]
    #[expect(dead_code, reason = "there is but one")]
    format: (),
    vectors: Vec<Written>,
}

/// A vector as a file has it.
#[derive(Deserialize)]
struct Written {
    id: Name,
    category: Option<Name>,
    /// Takes precedence: what the answers were found for.
    planes_f32_hex: Option<Vec<Four<Bits>>>,
    planes: Option<Vec<Four<Narrow>>>,
    camera: Option<WrittenCamera>,
    boxes: Option<Vec<WrittenBox>>,
    points: Option<Vec<WrittenPoint>>,
    expected_visible_planes: Option<BTreeSet<Name>>,
    touch_planes: Option<BTreeSet<Name>>,
    expected_visible_camera: Option<BTreeSet<Name>>,
    touch_camera: Option<BTreeSet<Name>>,
    observed_f32_pvertex_mul_add: Option<BTreeSet<Name>>,
    p_vertex_exact_visible: Option<BTreeSet<Name>>,
    expect_camera_error: Option<Declared>,
    expect_planes_error: Option<Declared>,
    expect_rejected_at_load: Option<BTreeSet<Name>>,
    expect_empty_boxes: Option<BTreeSet<Name>>,
}

#[derive(Deserialize)]
struct WrittenCamera {
    eye: Three<Number>,
    look: Three<Number>,
    up: Three<Number>,
    fovy_deg: Number,
    aspect: Number,
    near: Number,
    far: Option<Number>,
}

#[derive(Deserialize)]
struct WrittenBox {
    id: Name,
    lo: Three<Narrow>,
    hi: Three<Narrow>,
}

#[derive(Deserialize)]
struct WrittenPoint {
    id: Name,
    p: Three<Number>,
    expected_containing: BTreeSet<Name>,
}

impl From<Written> for Vector {
    fn from(written: Written) -> Vector {
        let names = |names: Option<BTreeSet<Name>>| names.map(names_of);
        let bits = written
            .planes_f32_hex
            .map(|rows| planes(rows, |bits: Bits| bits.0));
        let exact = names(written.p_vertex_exact_visible);
        let boxes = written.boxes.into_iter().flatten().map(|b| {
            let corner = |Three(row): Three<Narrow>| Vec3::from(row.map(|x| x.0));
            (b.id.0, Aabb::new(corner(b.lo), corner(b.hi)))
        });
        let points = written
            .points
            .into_iter()
            .flatten()
            .map(|point| VectorPoint {
                id: point.id.0,
                p: vector(point.p),
                containing: names_of(point.expected_containing),
            });
        Vector {
            id: written.id.0,
            category: written.category.map_or("vector".to_owned(), |name| name.0),
            planes: bits.or_else(|| Some(planes(written.planes?, |x: Narrow| x.0))),
            camera: written.camera.map(|camera| VectorCamera {
                eye: vector(camera.eye),
                look: vector(camera.look),
                up: vector(camera.up),
                fovy_deg: camera.fovy_deg.0,
                aspect: camera.aspect.0,
                near: camera.near.0,
                far: camera
                    .far
                    .map(|far| far.0)
                    .filter(|&far| far != f64::INFINITY),
            }),
            boxes: boxes.collect(),
            points: points.collect(),
            visible_planes: names(written.expected_visible_planes),
            touch_planes: names(written.touch_planes),
            visible_camera: names(written.expected_visible_camera),
            touch_camera: names(written.touch_camera),
            six_plane: names(written.observed_f32_pvertex_mul_add).or_else(|| exact.clone()),
            six_plane_exact: exact,
            camera_error: written.expect_camera_error.and_then(|error| error.0),
            planes_error: written.expect_planes_error.and_then(|error| error.0),
            rejected_at_load: names(written.expect_rejected_at_load).unwrap_or_default(),
            empty_boxes: names(written.expect_empty_boxes).unwrap_or_default(),
        }
    }
}

fn names_of(names: BTreeSet<Name>) -> Names {
    names.into_iter().map(|name| name.0).collect()
}

fn vector(Three(row): Three<Number>) -> DVec3 {
    DVec3::from(row.map(|x| x.0))
}

fn planes<T>(rows: Vec<Four<T>>, number: fn(T) -> f32) -> Vec<Plane> {
    let plane = |Four(row): Four<T>| {
        let [x, y, z, d] = row.map(number);
        Plane::new(Vec3::new(x, y, z), d)
    };
    rows.into_iter().map(plane).collect()
}

/// Names of boxes and vectors: text, or a whole number taken as text.
#[derive(PartialEq, Eq, PartialOrd, Ord)]
struct Name(String);

/// A number of f64, or a word for one that JSON does not have.
struct Number(f64);

/// A number of f32, exactly or in the fewest decimals that read back as it: the
/// answers beside it are about this very number. What is beyond its range is infinite.
struct Narrow(f32);

/// The bits of an f32 in hexadecimal: "0x3f800000".
struct Bits(f32);

/// The error that is expected, in words; `false` is none.
struct Declared(Option<String>);

struct Three<T>([T; 3]);

struct Four<T>([T; 4]);

/// Reads one of the types above from each kind of JSON value that it may have.
macro_rules! written_as {
    ($Type:ident, $expected:literal, $($visit:ident($From:ty, $Kind:ident) $read:expr;)+) => {
        impl<'de> Deserialize<'de> for $Type {
            fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<$Type, D::Error> {
                struct Reader;

                impl Visitor<'_> for Reader {
                    type Value = $Type;

                    fn expecting(&self, f: &mut fmt::Formatter) -> fmt::Result {
                        f.write_str($expected)
                    }

                    $(fn $visit<E: Error>(self, value: $From) -> Result<$Type, E> {
                        let read: fn($From) -> Option<$Type> = $read;
                        let found = Unexpected::$Kind(value);
                        read(value).ok_or_else(|| E::invalid_value(found, &self))
                    })+
                }

                deserializer.deserialize_any(Reader)
            }
        }
    };
}
written_as! {
    Name, "a name",
    visit_str(&str, Str) |text| Some(Name(text.to_owned()));
    visit_u64(u64, Unsigned) |number| Some(Name(number.to_string()));
}
written_as! {
    Number, "a number, NaN, Infinity or -Infinity",
    visit_str(&str, Str) |text| word(text).map(Number);
    visit_f64(f64, Float) |number| Some(Number(number));
    visit_u64(u64, Unsigned) |number| Some(Number(number as f64));
    visit_i64(i64, Signed) |number| Some(Number(number as f64));
}
written_as! {
    Narrow, "a number that f32 holds",
    visit_str(&str, Str) |text| word(text).map(|x| Narrow(x as f32));
    visit_f64(f64, Float) narrow;
    visit_u64(u64, Unsigned) |number| narrow(number as f64);
    visit_i64(i64, Signed) |number| narrow(number as f64);
}
written_as! {
    Bits, "the 32 bits of an f32 such as \"0x3f800000\"",
    visit_str(&str, Str) bits;
}
written_as! {
    Declared, "the error in words",
    visit_bool(bool, Bool) |is_wrong| Some(Declared(is_wrong.then(|| "an error".to_owned())));
    visit_str(&str, Str) |text| Some(Declared(Some(text.to_owned())));
}

impl<'de, T: Deserialize<'de>> Deserialize<'de> for Three<T> {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        exactly(deserializer, "three numbers").map(Three)
    }
}

impl<'de, T: Deserialize<'de>> Deserialize<'de> for Four<T> {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        exactly(deserializer, "four numbers: the normal and the offset").map(Four)
    }
}

fn exactly<'de, D: Deserializer<'de>, T: Deserialize<'de>, const N: usize>(
    deserializer: D,
    expected: &str,
) -> Result<[T; N], D::Error> {
    let row = Vec::deserialize(deserializer)?;
    let found = row.len();
    row.try_into()
        .map_err(|_| D::Error::invalid_length(found, &expected))
}

fn format<'de, D: Deserializer<'de>>(deserializer: D) -> Result<(), D::Error> {
    match Option::<f64>::deserialize(deserializer)? {
        None | Some(1.0) => Ok(()),
        Some(other) => Err(D::Error::invalid_value(
            Unexpected::Float(other),
            &"format 1",
        )),
    }
}

fn word(text: &str) -> Option<f64> {
    match text.to_ascii_lowercase().as_str() {
        "nan" => Some(f64::NAN),
        "inf" | "infinity" => Some(f64::INFINITY),
        "-inf" | "-infinity" => Some(f64::NEG_INFINITY),
        _ => None,
    }
}

fn narrow(number: f64) -> Option<Narrow> {
    let narrow = number as f32;
    let is_shortest = || narrow.to_string().parse() == Ok(number);
    let is_held = !narrow.is_finite() || f64::from(narrow) == number || is_shortest();
    is_held.then_some(Narrow(narrow))
}

fn bits(text: &str) -> Option<Bits> {
    let bare = text.strip_prefix("0x").or_else(|| text.strip_prefix("0X"));
    let digits = bare.unwrap_or(text);
    let is_sound = digits.len() == 8 && digits.bytes().all(|b| b.is_ascii_hexdigit());
    let bits = u32::from_str_radix(digits, 16).ok().filter(|_| is_sound)?;
    Some(Bits(f32::from_bits(bits)))
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
                boxed(
                    r#"{"id":"b","lo":[0,0,0],"hi":[1,1,1]},{"id":"b","lo":[0,0,0],"hi":[1,1,1]}"#,
                ),
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
