//! Tables of fixed-size records in binary files, little-endian.
//!
//! No byte is trusted.

use std::fmt;
use std::ops::Range;

use glam::{DVec2, Vec3};

use crate::input::{InputError, Result};

/// A table of a file.
pub struct Table<'a> {
    pub file: &'a str,
    pub name: &'static str,
    /// Offset of its first byte in the file.
    pub start: usize,
    pub data: &'a [u8],
    /// Bytes per record; `data` is a multiple of it.
    pub record: usize,
}

impl<'a> Table<'a> {
    /// Some bytes of a file, one record per byte.
    pub fn new(file: &'a str, name: &'static str, bytes: &'a [u8], range: Range<usize>) -> Self {
        Table {
            file,
            name,
            start: range.start,
            data: &bytes[range],
            record: 1,
        }
    }

    /// The bytes whose offset and length are in an entry of a directory.
    ///
    /// An empty table starts at its entry: its offset is meaningless.
    pub fn of_entry(
        file: &'a str,
        name: &'static str,
        bytes: &'a [u8],
        entry: usize,
    ) -> Result<Self> {
        let [offset, size] = [0, 4].map(|at| int_at(bytes, entry + at));
        let range = match size {
            0 => Some(entry..entry),
            _ => range_within(offset, size, bytes.len()),
        };
        let range = range.ok_or_else(|| {
            let found = format!("lump {name} at {offset}, {size} bytes long");
            let expected = format!("a lump within the file's {} bytes", bytes.len());
            InputError::byte(file, entry, found, expected)
        })?;
        Ok(Table::new(file, name, bytes, range))
    }

    /// The same bytes as records of a given size.
    pub fn of_records(self, record: usize) -> Result<Self> {
        let size = self.data.len();
        match size.is_multiple_of(record) {
            true => Ok(Table { record, ..self }),
            false => {
                let found = format!("{} of {size} bytes", self.name);
                Err(self.error(0, 0, found, format!("a multiple of {record} bytes")))
            }
        }
    }

    pub fn len(&self) -> usize {
        self.data.len() / self.record
    }

    /// The unsigned 16-bit field at byte `at` of record `i`.
    pub fn word(&self, i: usize, at: usize) -> u16 {
        let start = i * self.record + at;
        u16::from_le_bytes([self.data[start], self.data[start + 1]])
    }

    /// The signed 16-bit field, as a coordinate.
    pub fn short(&self, i: usize, at: usize) -> f64 {
        f64::from(self.word(i, at) as i16)
    }

    /// Two signed 16-bit fields, x then y.
    pub fn point(&self, i: usize, at: usize) -> DVec2 {
        DVec2::new(self.short(i, at), self.short(i, at + 2))
    }

    /// The signed 32-bit field.
    pub fn int(&self, i: usize, at: usize) -> i32 {
        int_at(self.data, i * self.record + at)
    }

    /// Three signed 32-bit fields.
    pub fn whole(&self, i: usize, at: usize) -> Vec3 {
        Vec3::from([0, 4, 8].map(|part| self.int(i, at + part) as f32))
    }

    /// A finite f32.
    pub fn float(&self, i: usize, at: usize) -> Result<f32> {
        let value = f32::from_bits(self.int(i, at) as u32);
        match value.is_finite() {
            true => Ok(value),
            false => Err(self.error(i, at, value.to_string(), "a finite number")),
        }
    }

    /// Three finite f32.
    pub fn vector(&self, i: usize, at: usize) -> Result<Vec3> {
        let part = |part| self.float(i, at + part);
        Ok(Vec3::new(part(0)?, part(4)?, part(8)?))
    }

    /// A 16-bit index into another table.
    pub fn index16(&self, i: usize, at: usize, of: &Table) -> Result<usize> {
        self.below(i, at, self.word(i, at).into(), of)
    }

    /// A 32-bit index into another table.
    pub fn index(&self, i: usize, at: usize, of: &Table) -> Result<usize> {
        self.below(i, at, self.int(i, at), of)
    }

    fn below(&self, i: usize, at: usize, index: i32, of: &Table) -> Result<usize> {
        match usize::try_from(index) {
            Ok(known) if known < of.len() => Ok(known),
            _ => {
                let found = format!("{} {index} in {} {i}", of.name, self.name);
                Err(self.error(i, at, found, format!("less than {}", of.len())))
            }
        }
    }

    /// A range of another table's records, as two 32-bit fields: first and count.
    pub fn range(&self, i: usize, at: usize, of: &Table) -> Result<Range<usize>> {
        let [first, count] = [at, at + 4].map(|at| self.int(i, at));
        range_within(first, count, of.len()).ok_or_else(|| {
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
        let offset = self.start + i * self.record + at;
        InputError::byte(self.file, offset, found, expected)
    }
}

/// The range of `count` numbers from `first` on, if all are below `limit`.
pub fn range_within(first: i32, count: i32, limit: usize) -> Option<Range<usize>> {
    let (first, count) = (usize::try_from(first).ok()?, usize::try_from(count).ok()?);
    let range = first..first.checked_add(count)?;
    (range.end <= limit).then_some(range)
}

pub fn int_at(bytes: &[u8], at: usize) -> i32 {
    i32::from_le_bytes([bytes[at], bytes[at + 1], bytes[at + 2], bytes[at + 3]])
}
