//! The lumps of an IBSP file: tables of 32-bit numbers. No byte is trusted.

use crate::input::{InputError, Result};
use crate::scene::records::Table;

/// Numbers, names and record sizes of the lumps that are read.
const LUMPS: [(usize, &str, usize); 11] = [
    (0, "entities", 1),
    (1, "shaders", 72),
    (2, "planes", 16),
    (3, "nodes", 36),
    (4, "leafs", 48),
    (8, "brushes", 12),
    (9, "brushsides", 8),
    (10, "drawverts", 44),
    (11, "drawindexes", 4),
    (13, "surfaces", 104),
    (16, "visibility", 1),
];

/// Formats of other engines, by magic and version.
pub const OTHERS: [(&[u8], &str); 12] = [
    (b"IBSP\x26", "Quake II"),
    (b"IBSP\x2f", "Return to Castle Wolfenstein or Quake Live"),
    (b"VBSP", "Source"),
    (b"RBSP", "Raven"),
    (b"FBSP", "QFusion"),
    (b"BSP2", "Quake (BSP2)"),
    (b"2PSB", "Quake (2PSB)"),
    (b"FAKK", "Heavy Metal: FAKK 2"),
    (b"EF2!", "Elite Force II"),
    (b"2015\x13\0\0\0", "Medal of Honor: Allied Assault"),
    (b"\x1d\0\0\0", "Quake"),
    (b"\x1e\0\0\0", "Half-Life"),
];

/// Finds the lump of a number.
///
/// # Errors
/// Another format, or a lump beyond the file or not a whole number of records long.
pub fn lump<'a>(bytes: &'a [u8], file: &'a str, number: usize) -> Result<Table<'a>> {
    let row = LUMPS.iter().find(|row| row.0 == number);
    let &(_, name, record) = row.expect("a lump that is read");
    if !bytes.starts_with(b"IBSP\x2e\0\0\0") {
        let other = OTHERS.iter().find(|other| bytes.starts_with(other.0));
        let start = bytes.get(..8).unwrap_or(bytes).escape_ascii();
        let found = match other {
            Some((_, engine)) => format!("a map of {engine}"),
            None => format!("'{start}'"),
        };
        let expected = "IBSP of version 46 (Quake III), or the map as glTF or OBJ";
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
