//! The lumps of an IBSP file: tables of 32-bit numbers. No byte is trusted.

use crate::input::{InputError, Result};
use crate::scene::records::Table;

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

/// Finds the lump of a number.
///
/// # Errors
/// Another format, a lump beyond the file or one that is no whole number of records.
pub fn lump<'a>(bytes: &'a [u8], file: &'a str, number: usize) -> Result<Table<'a>> {
    let (name, record) = LUMPS[number];
    if !bytes.starts_with(b"IBSP\x2e\0\0\0") {
        let other = OTHERS.iter().find(|other| bytes.starts_with(other.0));
        let start = bytes.get(..8).unwrap_or(bytes).escape_ascii();
        let found = match other {
            Some((_, engine)) => format!("a map of {engine}"),
            None => format!("'{start}'"),
        };
        let expected = "IBSP of version 46 (Quake III)";
        return Err(InputError::byte(file, 0, found, expected));
    }
    let entry = 8 + 8 * number;
    if bytes.len() < entry + 8 {
        let expected = "a directory of 17 lumps";
        let (end, found) = (bytes.len(), "the end of the file");
        return Err(InputError::byte(file, end, found, expected));
    }
    Table::of_entry(file, name, bytes, entry)?.of_records(record)
}
