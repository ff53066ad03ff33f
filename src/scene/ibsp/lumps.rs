//! The lumps of an IBSP file: tables of 32-bit numbers. No byte is trusted.

use std::fmt;
use std::ops::Range;

use glam::Vec3;

use crate::input::InputError;

/// Names and sizes of the records of the lumps, in their order.
const LUMPS: [(&str, usize); 17] = [
    ("entities", 1),
    ("shaders", 72),
    ("planes", 16),
    ("nodes", 36),
    ("leafs", 48),
    ("leafsurfaces", 4),
    ("leafbrushes", 4),
    ("models", 40),
    ("brushes", 12),
    ("brushsides", 8),
    ("drawverts", 44),
    ("drawindexes", 4),
    ("fogs", 72),
    ("surfaces", 104),
    ("lightmaps", 1),
    ("lightgrid", 1),
    ("visibility", 1),
];
/// Formats of other engines, by magic and version.
const OTHERS: [(&[u8], &str); 7] = [
    (b"IBSP\x26", "Quake II"),
    (b"IBSP\x2f", "Return to Castle Wolfenstein or Quake Live"),
    (b"VBSP", "Source"),
    (b"RBSP", "Raven"),
    (b"FBSP", "QFusion"),
    (b"\x1d\0\0\0", "Quake"),
    (b"\x1e\0\0\0", "Half-Life"),
];

/// A table of a file.
pub struct Lump<'a> {
    file: &'a str,
    name: &'static str,
    /// Offset of its first byte in the file.
    start: usize,
    pub data: &'a [u8],
    record: usize,
}

/// Finds the lump of a number.
///
/// # Errors
/// Another format, a lump beyond the file or one that is no whole number of records.
pub fn lump<'a>(bytes: &'a [u8], file: &'a str, number: usize) -> Result<Lump<'a>, InputError> {
    let (name, record) = LUMPS[number];
    let error =
        |offset, found, expected: String| Err(InputError::byte(file, offset, found, expected));
    if !bytes.starts_with(b"IBSP\x2e\0\0\0") {
        let other = OTHERS.iter().find(|other| bytes.starts_with(other.0));
        let start = bytes.get(..8).unwrap_or(bytes).escape_ascii();
        let found = match other {
            Some((_, engine)) => format!("a map of {engine}"),
            None => format!("'{start}'"),
        };
        return error(0, found, "IBSP of version 46 (Quake III)".to_owned());
    }
    let entry = 8 + 8 * number;
    if bytes.len() < entry + 8 {
        let found = "the end of the file".to_owned();
        return error(bytes.len(), found, "a directory of 17 lumps".to_owned());
    }
    let [at, length] = [0, 4].map(|part| int_at(bytes, entry + part));
    let range = usize::try_from(at).ok().zip(usize::try_from(length).ok());
    let range = range.and_then(|(at, length)| Some(at..at.checked_add(length)?));
    let Some((range, data)) = range.and_then(|range| Some((range.clone(), bytes.get(range)?)))
    else {
        let found = format!("{name} at {at}, {length} bytes long");
        return error(
            entry,
            found,
            format!("within the file's {} bytes", bytes.len()),
        );
    };
    if data.len() % record != 0 {
        let found = format!("{name} of {length} bytes");
        return error(entry, found, format!("a multiple of {record} bytes"));
    }
    Ok(Lump {
        file,
        name,
        start: range.start,
        data,
        record,
    })
}

impl Lump<'_> {
    pub fn len(&self) -> usize {
        self.data.len() / self.record
    }

    /// The field at byte `at` of record `i`.
    pub fn int(&self, i: usize, at: usize) -> i32 {
        int_at(self.data, i * self.record + at)
    }

    /// Three fields, whole numbers.
    pub fn whole(&self, i: usize, at: usize) -> Vec3 {
        Vec3::from([0, 4, 8].map(|part| self.int(i, at + part) as f32))
    }

    pub fn float(&self, i: usize, at: usize) -> Result<f32, InputError> {
        let value = f32::from_bits(self.int(i, at) as u32);
        match value.is_finite() {
            true => Ok(value),
            false => Err(self.error(i, at, value.to_string(), "a finite number")),
        }
    }

    pub fn vector(&self, i: usize, at: usize) -> Result<Vec3, InputError> {
        let part = |part| self.float(i, at + part);
        Ok(Vec3::new(part(0)?, part(4)?, part(8)?))
    }

    /// A field that counts records of another lump.
    pub fn index(&self, i: usize, at: usize, of: &Lump) -> Result<usize, InputError> {
        let index = self.int(i, at);
        let known = usize::try_from(index)
            .ok()
            .filter(|&index| index < of.len());
        known.ok_or_else(|| {
            let found = format!("{} {index} in {} {i}", of.name, self.name);
            self.error(i, at, found, format!("less than {}", of.len()))
        })
    }

    /// Two fields, the first of some records of another lump and their count.
    pub fn range(&self, i: usize, at: usize, of: &Lump) -> Result<Range<usize>, InputError> {
        let [first, count] = [at, at + 4].map(|at| self.int(i, at));
        let ends = usize::try_from(first).ok().zip(usize::try_from(count).ok());
        let range = ends.and_then(|(first, count)| Some(first..first.checked_add(count)?));
        range.filter(|range| range.end <= of.len()).ok_or_else(|| {
            let found = format!("{count} {} from {first} on in {} {i}", of.name, self.name);
            self.error(i, at, found, format!("some of {}", of.len()))
        })
    }

    pub fn error(
        &self,
        i: usize,
        at: usize,
        found: impl fmt::Display,
        expected: impl fmt::Display,
    ) -> InputError {
        InputError::byte(
            self.file,
            self.start + i * self.record + at,
            found,
            expected,
        )
    }
}

fn int_at(bytes: &[u8], at: usize) -> i32 {
    i32::from_le_bytes([bytes[at], bytes[at + 1], bytes[at + 2], bytes[at + 3]])
}
