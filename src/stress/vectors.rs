//! Test vectors: boxes, cameras or planes with the answers of exact arithmetic.
//!
//! Fields have the names of the JSON files; numbers and names have readers.

use std::collections::BTreeSet;
use std::fmt;
use std::path::Path;

use glam::{DVec3, Vec3};
use serde::de::{Error, Unexpected, Visitor};
use serde::{Deserialize, Deserializer};
use serde_json::Value;

use crate::camera::{Camera, CameraError, Lens};
use crate::geometry::{Aabb, Plane};
use crate::input::{InputError, Result, note, read_file};
use crate::json::{JsonError, from_json};
use crate::oracle::Pose;
use crate::shown::{counted, plain};
use crate::spec::nearest;
use crate::stress::Level;

/// Vectors that come with the program.
pub const BUILT_IN: &str = include_str!("../../datasets/vectors.json");
/// Name of the built-in vectors in messages.
pub const BUILT_IN_NAME: &str = "datasets/vectors.json";

/// Narrowest angle of view that the camera oracle supports, degrees.
const MIN_FOV_DEG: f64 = 1e-12;

/// Derivations of planes from which those in a file may come.
const METHODS: &str = "given frame_f32 gh_gl_f32 gh_gl_f32_raw gh_revz_f32";

/// Names of boxes, sorted so that the output is deterministic.
pub type Names = BTreeSet<Name>;

/// One test vector; fields that a file leaves out are not checked.
#[derive(Clone, Debug, Deserialize)]
pub struct Vector {
    /// Id, unique in its file.
    pub id: Name,
    category: Option<Name>,
    plane_method: Option<Value>,
    normals: Option<Value>,
    semantics: Option<Value>,
    planes: Option<Vec<Array<F32, 4>>>,
    /// Bit patterns that replace `planes` if a file has both.
    planes_f32_hex: Option<Vec<Array<F32Bits, 4>>>,
    /// Camera that the boxes are culled for.
    pub camera: Option<VectorCamera>,
    boxes: Option<Vec<VectorBox>>,
    points: Option<Vec<VectorPoint>>,
    /// Boxes that intersect or touch the volume of the planes.
    pub expected_visible_planes: Option<Names>,
    /// Boxes that only touch the volume of the planes.
    pub touch_planes: Option<Names>,
    /// Boxes that intersect or touch the camera's view.
    pub expected_visible_camera: Option<Names>,
    /// Boxes that only touch the camera's view.
    pub touch_camera: Option<Names>,
    /// Answer of the f32 six-plane test.
    pub observed_f32_pvertex_mul_add: Option<Names>,
    /// Answer of the f32 six-plane test with fused products and sums.
    pub observed_f32_pvertex_fma: Option<Names>,
    /// Answer of the six-plane test without any rounding.
    pub p_vertex_exact_visible: Option<Names>,
    expect_camera_error: Option<ExpectedError>,
    expect_planes_error: Option<ExpectedError>,
    /// Indices of the planes with a zero normal, among the finite planes.
    pub degenerate_planes: Option<Names>,
    /// Boxes that must be refused because a bound is not finite.
    pub expect_rejected_at_load: Option<Names>,
    /// Inverted boxes (a lower bound above its upper one), which no query may return.
    pub expect_empty_boxes: Option<Names>,
}

/// Camera as stated by a file, possibly impossible.
#[derive(Clone, Copy, Debug, Deserialize)]
pub struct VectorCamera {
    eye: Array<F64, 3>,
    look: Array<F64, 3>,
    up: Array<F64, 3>,
    fovy_deg: F64,
    aspect: F64,
    near: F64,
    far: Option<F64>,
}

/// A box by its name.
#[derive(Clone, Debug, Deserialize)]
pub struct VectorBox {
    /// Name, unique in its vector.
    pub id: Name,
    lo: Array<F32, 3>,
    hi: Array<F32, 3>,
}

/// A point and the boxes that contain it.
#[derive(Clone, Debug, Deserialize)]
pub struct VectorPoint {
    /// Name of the point.
    pub id: Name,
    p: Array<F64, 3>,
    /// Names of the boxes that contain it, bounds included.
    pub expected_containing: Names,
}

impl VectorCamera {
    /// Position and orientation, exact.
    pub fn pose(&self) -> Pose {
        let [eye, look, up] = [self.eye, self.look, self.up].map(vector);
        Pose::LookAt { eye, look, up }
    }

    /// Returns `true` if the oracle represents the angles of the lens without loss.
    pub fn is_supported(&self) -> bool {
        self.fovy_deg.0 * self.aspect.0.min(1.0) >= MIN_FOV_DEG
    }

    /// Camera with these numbers.
    ///
    /// # Errors
    /// There is no such camera.
    pub fn camera(&self) -> Result<Camera, CameraError> {
        let far = self.far.map(|far| far.0);
        let far = far.filter(|far| *far != f64::INFINITY);
        let frame = self.pose().frame()?;
        let lens = Lens::perspective(self.fovy_deg.0, self.aspect.0, self.near.0, far)?;
        Ok(Camera { frame, lens })
    }
}

impl VectorBox {
    /// Box as stated; its bounds may be inverted or not finite.
    pub fn bounds(&self) -> Aabb {
        let corner = |row: Array<F32, 3>| Vec3::from(row.0.map(|x| x.0));
        Aabb::new(corner(self.lo), corner(self.hi))
    }
}

impl VectorPoint {
    /// Point in scene coordinates, as written.
    pub fn p(&self) -> DVec3 {
        vector(self.p)
    }
}

impl Vector {
    /// Section of the results.
    pub fn category(&self) -> &str {
        self.category.as_ref().map_or("vector", |name| &name.0)
    }

    /// Boxes to be culled, each with a unique name.
    pub fn boxes(&self) -> impl ExactSizeIterator<Item = &VectorBox> {
        self.boxes.as_deref().unwrap_or_default().iter()
    }

    /// Boxes that a scene may contain: those not rejected at load.
    pub fn sound_boxes(&self) -> impl Iterator<Item = &VectorBox> {
        let rejected = self.expect_rejected_at_load.as_ref();
        self.boxes()
            .filter(move |b| rejected.is_none_or(|names| !names.contains(&b.id)))
    }

    /// Points to be located among the boxes.
    pub fn points(&self) -> impl ExactSizeIterator<Item = &VectorPoint> {
        self.points.as_deref().unwrap_or_default().iter()
    }

    /// Planes in f32, bit for bit.
    pub fn planes(&self) -> Option<Vec<Plane>> {
        let plane = |[x, y, z, d]: [f32; 4]| Plane::new(Vec3::new(x, y, z), d);
        if let Some(bits) = &self.planes_f32_hex {
            return Some(bits.iter().map(|row| plane(row.0.map(|x| x.0))).collect());
        }
        let rows = self.planes.as_ref()?.iter();
        Some(rows.map(|row| plane(row.0.map(|x| x.0))).collect())
    }

    /// Claims of the vector that no check covers, in words.
    ///
    /// A list without names makes no claim. Planes that must be refused may have names: the
    /// format's generator lists what the finite ones among them leave visible.
    fn unchecked(&self) -> impl Iterator<Item = &'static str> {
        let seen = !self.named(Level::Camera).is_empty();
        let of_planes = !self.named(Level::Planes).is_empty();
        let (no_camera, no_planes) = (self.camera.is_none(), self.planes().is_none());
        let is_refused = self.camera_error().is_some();
        let is_other = |own: &Option<Value>, known: &str| {
            let own = own.as_ref().and_then(Value::as_str);
            let first = own.and_then(|own| own.split([' ', ':']).next());
            first.is_some_and(|own| !known.split(' ').any(|known| known == own))
        };
        let found = [
            is_other(&self.normals, "inward").then_some("normals that are not inward"),
            is_other(&self.semantics, "closed").then_some("semantics that are not closed"),
            is_other(&self.plane_method, METHODS)
                .then_some("a plane_method that is none of the format"),
            (no_camera && (seen || is_refused)).then_some("claims about a camera but no camera"),
            (seen && is_refused).then_some("boxes seen by a camera that must be refused"),
            (no_planes && (of_planes || self.planes_error().is_some()))
                .then_some("claims about planes but no planes"),
        ];
        found.into_iter().flatten()
    }

    /// Names in the lists about the camera or about the planes.
    pub fn named(&self, level: Level) -> BTreeSet<&Name> {
        let lists: &[&Option<Names>] = match level {
            Level::Camera => &[&self.expected_visible_camera, &self.touch_camera],
            Level::Planes => &[
                &self.expected_visible_planes,
                &self.touch_planes,
                &self.p_vertex_exact_visible,
                &self.observed_f32_pvertex_mul_add,
                &self.observed_f32_pvertex_fma,
            ],
        };
        lists.iter().copied().flatten().flatten().collect()
    }

    /// True unless `planes` and `planes_f32_hex` are both given and differ.
    pub fn planes_agree(&self) -> bool {
        let equal = |(a, b): (&F32Bits, &F32)| a.0 == b.0 || a.0.is_nan() && b.0.is_nan();
        let both = self.planes_f32_hex.as_ref().zip(self.planes.as_ref());
        both.is_none_or(|(bits, decimals)| {
            let mut rows = bits.iter().zip(decimals);
            bits.len() == decimals.len() && rows.all(|(a, b)| a.0.iter().zip(&b.0).all(equal))
        })
    }

    /// Reason why the camera must be refused.
    pub fn camera_error(&self) -> Option<&str> {
        self.expect_camera_error.as_ref()?.0.as_deref()
    }

    /// Reason why the planes must be refused.
    pub fn planes_error(&self) -> Option<&str> {
        self.expect_planes_error.as_ref()?.0.as_deref()
    }
}

fn vector(row: Array<F64, 3>) -> DVec3 {
    DVec3::from(row.0.map(|x| x.0))
}

/// Reads the built-in vectors.
///
/// # Errors
/// None, unless the file in the source is broken; a test reads it.
pub fn built_in() -> Result<Vec<Vector>> {
    read_vectors(BUILT_IN.as_bytes(), BUILT_IN_NAME)
}

/// Reads a file of vectors from disk, as [`read_vectors`] does.
///
/// # Errors
/// A file that cannot be read, or is wrong.
pub fn read_vectors_file(path: &Path) -> Result<Vec<Vector>> {
    let bytes = read_file(path)?;
    read_vectors(&bytes, &path.display().to_string())
}

/// Reads a file of vectors: an object with the array `vectors`, or the array alone.
///
/// Numbers may be given as the words NaN, Infinity (inf) and -Infinity (-inf). Ignores unknown
/// fields, with a note if one resembles a known field or belongs to a camera, and claims that no
/// check covers.
///
/// # Errors
/// One line: the file, the path of the field, what was found and expected.
pub fn read_vectors(bytes: &[u8], file: &str) -> Result<Vec<Vector>> {
    let vectors: Vec<Vector> = list(bytes).map_err(|error: JsonError| {
        let form = || format!("JSON in the form of {BUILT_IN_NAME}");
        let (place, expected) = (error.place(), error.expected.unwrap_or_else(form));
        InputError::at(file, place, error.found, expected)
    })?;
    unique(file, "vectors", vectors.iter().map(|vector| &vector.id))?;
    for (n, vector) in vectors.iter().enumerate() {
        let of = |list| format!("vectors[{n}].{list}");
        unique(file, &of("boxes"), vector.boxes().map(|b| &b.id))?;
        unique(file, &of("points"), vector.points().map(|p| &p.id))?;
    }
    note_unchecked(&vectors, file);
    note_unknown(bytes, file, vectors.len());
    Ok(vectors)
}

fn list(bytes: &[u8]) -> Result<Vec<Vector>, JsonError> {
    let is_array = bytes.iter().find(|byte| b"[{".contains(byte)) == Some(&b'[');
    match is_array {
        true => from_json(bytes),
        false => from_json(bytes).map(|file: File| file.vectors),
    }
}

/// Prints a note for each kind of claim that is not checked, once.
fn note_unchecked(vectors: &[Vector], file: &str) {
    let mut noted = BTreeSet::new();
    for (n, vector) in vectors.iter().enumerate() {
        for found in vector.unchecked().filter(|&found| noted.insert(found)) {
            note(&format!("{file}, vectors[{n}]: {found}; not judged"));
        }
    }
}

/// Collects the fields of objects, each with the field that holds the object.
fn fields(holder: &str, value: &Value, found: &mut BTreeSet<[String; 2]>) {
    match value {
        Value::Array(list) => list.iter().for_each(|value| fields(holder, value, found)),
        Value::Object(map) if HOLDERS.contains(&holder) => map.iter().for_each(|(name, value)| {
            found.insert([holder, name].map(str::to_owned));
            fields(name, value, found);
        }),
        _ => {}
    }
}

/// Prints notes on a wrong count and on fields that the format does not have.
///
/// Only on `normals` and `semantics`, fields that resemble a known one, and all fields of a camera:
/// those may change its view.
fn note_unknown(bytes: &[u8], file: &str, vectors: usize) {
    let value = |bytes| from_json(bytes).unwrap_or(Value::Null);
    let all = |value: &Value| {
        let mut found = BTreeSet::new();
        let holder = if value.is_array() { "vectors" } else { "file" };
        fields(holder, value, &mut found);
        found
    };
    let read = value(bytes);
    let count = read["count"].as_f64();
    if let Some(count) = count.filter(|count| *count != vectors as f64) {
        let vectors = counted(vectors, "vector");
        note(&format!("{file}: count is {count} for {vectors}"));
    }
    // The built-in vectors have every field.
    let known = all(&value(BUILT_IN.as_bytes()));
    for [holder, name] in all(&read).difference(&known) {
        let own = known.iter().filter(|[of, _]| of == holder);
        let guess = match nearest(name, own.map(|[_, field]| field.as_str())) {
            Some(guess) => format!(" (did you mean '{guess}'?)"),
            None if holder == "camera" => String::new(),
            None if name == "normals" || name == "semantics" => ": inward and closed".to_owned(),
            None => continue,
        };
        let found = format!("field '{}' of '{holder}' is not read", plain(name));
        note(&format!("{file}: {found}{guess}"));
    }
}

/// Objects with fields of the format; the keys of others are names of boxes.
const HOLDERS: [&str; 5] = ["file", "vectors", "camera", "boxes", "points"];

/// Rejects an id that occurs twice in a list.
fn unique<'v>(file: &str, list: &str, ids: impl Iterator<Item = &'v Name>) -> Result<()> {
    let mut seen = BTreeSet::new();
    ids.enumerate().try_for_each(|(n, id)| {
        let found = format_args!("the id '{}' a second time", plain(&id.0));
        let again = || InputError::at(file, format_args!("{list}[{n}]"), found, "an id of its own");
        seen.insert(id).then_some(()).ok_or_else(again)
    })
}

#[derive(Deserialize)]
#[serde(expecting = "an object with the array 'vectors'")]
struct File {
    #[serde(default, deserialize_with = "format")]
    #[expect(dead_code, reason = "there is but one")]
    format: (),
    vectors: Vec<Vector>,
}

/// Name of a box or a vector: text, or an integer read as text.
#[derive(Clone, PartialEq, Eq, PartialOrd, Ord, Debug)]
pub struct Name(pub String);

/// An f64, or a word for a value that JSON does not have.
#[derive(Clone, Copy, Debug)]
struct F64(f64);

/// An f32, exact or in the fewest decimals that round-trip.
///
/// The expected answers are about this very number; it is infinite beyond f32's range.
#[derive(Clone, Copy, Debug)]
struct F32(f32);

/// Bits of an f32 in hexadecimal: "0x3f800000".
#[derive(Clone, Copy, Debug)]
struct F32Bits(f32);

/// Expected error, in words; `false` means none.
#[derive(Clone, Debug)]
struct ExpectedError(Option<String>);

/// A row of `N` values.
#[derive(Clone, Copy, Debug)]
struct Array<T, const N: usize>([T; N]);

impl<'de, T: Deserialize<'de>, const N: usize> Deserialize<'de> for Array<T, N> {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        let row = Vec::deserialize(deserializer)?;
        let found = row.len();
        let expected = match N {
            3 => "three numbers",
            _ => "four numbers: the normal and the offset",
        };
        let row = row.try_into().map(Array);
        row.map_err(|_| D::Error::invalid_length(found, &expected))
    }
}

/// Implements reading of one type above from each JSON kind that it may have.
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
    F64, "a number, NaN, Infinity or -Infinity",
    visit_str(&str, Str) |text| word(text).map(F64);
    visit_f64(f64, Float) |number| Some(F64(number));
    visit_u64(u64, Unsigned) |number| Some(F64(number as f64));
    visit_i64(i64, Signed) |number| Some(F64(number as f64));
}
written_as! {
    F32, "a number that f32 holds",
    visit_str(&str, Str) |text| word(text).map(|x| F32(x as f32));
    visit_f64(f64, Float) f32_of;
    visit_u64(u64, Unsigned) |number| f32_of(number as f64);
    visit_i64(i64, Signed) |number| f32_of(number as f64);
}
written_as! {
    F32Bits, "the 32 bits of an f32 such as \"0x3f800000\"",
    visit_str(&str, Str) bits;
}
written_as! {
    ExpectedError, "the error in words",
    visit_bool(bool, Bool) |is_wrong| Some(ExpectedError(is_wrong.then(|| "an error".to_owned())));
    visit_str(&str, Str) |text| Some(ExpectedError(Some(text.to_owned())));
}

fn format<'de, D: Deserializer<'de>>(deserializer: D) -> Result<(), D::Error> {
    let other = Option::<f64>::deserialize(deserializer)?.filter(|format| *format != 1.0);
    let error = |other| D::Error::invalid_value(Unexpected::Float(other), &"format 1");
    other.map(error).map_or(Ok(()), Err)
}

fn word(text: &str) -> Option<f64> {
    // Words only: a number in quotes is rejected.
    let is_word = text.chars().all(|c| c == '-' || c.is_ascii_alphabetic());
    text.parse().ok().filter(|_| is_word)
}

fn f32_of(number: f64) -> Option<F32> {
    let f32_of = number as f32;
    let is_shortest = || f32_of.to_string().parse() == Ok(number);
    let is_held = !f32_of.is_finite() || f64::from(f32_of) == number || is_shortest();
    is_held.then_some(F32(f32_of))
}

fn bits(text: &str) -> Option<F32Bits> {
    let bare = text.strip_prefix("0x").or_else(|| text.strip_prefix("0X"));
    let digits = bare.unwrap_or(text);
    let is_sound = digits.len() == 8 && digits.bytes().all(|b| b.is_ascii_hexdigit());
    let bits = u32::from_str_radix(digits, 16).ok().filter(|_| is_sound)?;
    Some(F32Bits(f32::from_bits(bits)))
}

#[cfg(test)]
mod tests;
