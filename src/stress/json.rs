//! Walking through JSON with a place in hand, so that every mistake can say
//! where it is. It defines how numbers, names, planes, cameras and boxes are
//! written; which fields a vector has is left to `vectors`.

use glam::{DVec3, Vec3};
use serde_json::{Map, Value};

use super::vector::{Names, VectorCamera, VectorPoint};
use crate::geometry::{Aabb, Plane};
use crate::input::InputError;

/// A place in the file.
pub struct At<'a> {
    file: &'a str,
    place: String,
}

impl<'a> At<'a> {
    pub fn new(file: &'a str, place: String) -> At<'a> {
        At { file, place }
    }

    pub fn child(&self, field: &str) -> At<'a> {
        At::new(self.file, format!("{}, {field}", self.place))
    }

    pub fn wrong(&self, found: &str, expected: &str) -> InputError {
        InputError::Value {
            file: self.file.to_owned(),
            place: self.place.clone(),
            found: found.to_owned(),
            expected: expected.to_owned(),
        }
    }

    pub fn object<'v>(&self, value: &'v Value) -> Result<&'v Map<String, Value>, InputError> {
        let object = value.as_object();
        object.ok_or_else(|| self.wrong(&of(value), "an object"))
    }

    pub fn required<'v>(
        &self,
        object: &'v Map<String, Value>,
        field: &str,
    ) -> Result<&'v Value, InputError> {
        let value = object.get(field);
        value.ok_or_else(|| self.wrong(&format!("no '{field}'"), &format!("the field '{field}'")))
    }

    /// The elements of an array, each with its place.
    pub fn elements<'v>(&self, value: &'v Value) -> Result<Vec<(At<'a>, &'v Value)>, InputError> {
        let list = value.as_array();
        let list = list.ok_or_else(|| self.wrong(&of(value), "an array"))?;
        let place = |i: usize| At::new(self.file, format!("{}[{i}]", self.place));
        Ok(list
            .iter()
            .enumerate()
            .map(|(i, v)| (place(i), v))
            .collect())
    }

    pub fn exactly<'v, const N: usize>(
        &self,
        value: &'v Value,
        what: &str,
    ) -> Result<[(At<'a>, &'v Value); N], InputError> {
        let elements = self.elements(value)?;
        let count = elements.len();
        let wrong = || self.wrong(&format!("{count} elements"), what);
        elements.try_into().map_err(|_| wrong())
    }

    /// A name: text, or a whole number taken as text.
    pub fn name(&self, value: &Value) -> Result<String, InputError> {
        match value {
            Value::String(text) => Ok(text.clone()),
            Value::Number(number) if number.is_u64() => Ok(number.to_string()),
            other => Err(self.wrong(&of(other), "a name")),
        }
    }

    pub fn names(&self, value: &Value) -> Result<Names, InputError> {
        let elements = self.elements(value)?;
        elements.iter().map(|(at, v)| at.name(v)).collect()
    }

    pub fn number(&self, value: &Value) -> Result<f64, InputError> {
        const WORDS: [(&str, f64); 5] = [
            ("nan", f64::NAN),
            ("inf", f64::INFINITY),
            ("infinity", f64::INFINITY),
            ("-inf", f64::NEG_INFINITY),
            ("-infinity", f64::NEG_INFINITY),
        ];
        let said = match value {
            Value::String(text) => {
                let row = WORDS.iter().find(|row| text.eq_ignore_ascii_case(row.0));
                row.map(|row| row.1)
            }
            other => other.as_f64(),
        };
        said.ok_or_else(|| self.wrong(&of(value), "a number, NaN, Infinity or -Infinity"))
    }

    /// A number of f32, exactly or in the fewest decimals that read back as it: the
    /// answers beside it are about this very number. What is beyond its range is infinite.
    pub fn f32_number(&self, value: &Value) -> Result<f32, InputError> {
        let number = self.number(value)?;
        let narrow = number as f32;
        let is_shortest = || narrow.to_string().parse() == Ok(number);
        match !narrow.is_finite() || f64::from(narrow) == number || is_shortest() {
            true => Ok(narrow),
            false => Err(self.wrong(&of(value), "a number that f32 holds")),
        }
    }

    pub fn vector(&self, value: &Value) -> Result<DVec3, InputError> {
        let [x, y, z] = self.exactly(value, "three numbers")?;
        let number = |(at, value): (At, &Value)| at.number(value);
        Ok(DVec3::new(number(x)?, number(y)?, number(z)?))
    }

    /// The bits of an f32 in hexadecimal: "0x3f800000".
    pub fn bits(&self, value: &Value) -> Result<f32, InputError> {
        let digits = value.as_str().map(|text| {
            let bare = text.strip_prefix("0x").or_else(|| text.strip_prefix("0X"));
            bare.unwrap_or(text)
        });
        let sound = digits.filter(|d| d.len() == 8 && d.bytes().all(|b| b.is_ascii_hexdigit()));
        let bits = sound.and_then(|digits| u32::from_str_radix(digits, 16).ok());
        let bits = bits.ok_or_else(|| {
            let expected = "the 32 bits of an f32 such as \"0x3f800000\"";
            self.wrong(&of(value), expected)
        })?;
        Ok(f32::from_bits(bits))
    }

    pub fn planes(
        &self,
        rows: &Value,
        number: impl Fn(&At, &Value) -> Result<f32, InputError>,
    ) -> Result<Vec<Plane>, InputError> {
        let rows = self.elements(rows)?;
        let planes = rows.iter().map(|(at, row)| {
            let [x, y, z, d] = at.exactly(row, "four numbers: the normal and the offset")?;
            let read = |(at, value): (At, &Value)| number(&at, value);
            Ok(Plane::new(
                Vec3::new(read(x)?, read(y)?, read(z)?),
                read(d)?,
            ))
        });
        planes.collect()
    }

    pub fn camera(&self, value: &Value) -> Result<VectorCamera, InputError> {
        let object = self.object(value)?;
        let vector = |field: &str| self.child(field).vector(self.required(object, field)?);
        let number = |field: &str| self.child(field).number(self.required(object, field)?);
        let far = match object.get("far") {
            None | Some(Value::Null) => None,
            Some(value) => Some(self.child("far").number(value)?),
        };
        Ok(VectorCamera {
            eye: vector("eye")?,
            look: vector("look")?,
            up: vector("up")?,
            fovy_deg: number("fovy_deg")?,
            aspect: number("aspect")?,
            near: number("near")?,
            far: far.filter(|&far| far != f64::INFINITY),
        })
    }

    /// Bounds are f32 numbers.
    pub fn bounds(&self, value: &Value) -> Result<(String, Aabb), InputError> {
        let object = self.object(value)?;
        let name = self.child("id").name(self.required(object, "id")?)?;
        let corner = |field: &str| -> Result<Vec3, InputError> {
            let corner = self.required(object, field)?;
            let [x, y, z] = self.child(field).exactly(corner, "three numbers")?;
            let number = |(at, value): (At, &Value)| at.f32_number(value);
            Ok(Vec3::new(number(x)?, number(y)?, number(z)?))
        };
        Ok((name, Aabb::new(corner("lo")?, corner("hi")?)))
    }

    pub fn point(&self, value: &Value) -> Result<VectorPoint, InputError> {
        let object = self.object(value)?;
        let field = "expected_containing";
        Ok(VectorPoint {
            id: self.child("id").name(self.required(object, "id")?)?,
            p: self.child("p").vector(self.required(object, "p")?)?,
            containing: self.child(field).names(self.required(object, field)?)?,
        })
    }
}

/// A value as messages quote it: short and on one line.
pub fn of(value: &Value) -> String {
    match value {
        Value::Array(list) => format!("an array of {}", list.len()),
        Value::Object(_) => "an object".to_owned(),
        other => format!("'{}'", shown(&other.to_string())),
    }
}

pub fn shown(text: &str) -> String {
    const MOST: usize = 60;
    let mut plain: String = text.chars().take(MOST).collect();
    if plain.len() < text.len() {
        plain.push_str("...");
    }
    plain.replace(char::is_control, " ")
}
