//! The WAD format: the lumps of a file, and those of a map.
//!
//! From the unofficial Doom specs 1.666, Matthew S. Fell 1994. No byte is trusted.

use std::collections::HashSet;
use std::fmt::Display;

use super::records::{Table, int_at};
use crate::input::{InputError, Result};
use crate::shown::{first_of, part_hint};

/// The lumps of a map in their fixed order, that of UDMF first.
const LUMPS: [&str; 13] = [
    "TEXTMAP", "THINGS", "LINEDEFS", "SIDEDEFS", "VERTEXES", "SEGS", "SSECTORS", "NODES",
    "SECTORS", "REJECT", "BLOCKMAP", "BEHAVIOR", "SCRIPTS",
];
/// Names of the first lump after a map's marker.
const FIRST: [&str; 2] = ["THINGS", "TEXTMAP"];
/// Lumps filled by a node builder.
const BUILT: [&str; 3] = ["SEGS", "SSECTORS", "NODES"];
/// Lumps that may be missing: as good as empty.
const MAY_LACK: [&str; 4] = ["SEGS", "SSECTORS", "NODES", "REJECT"];
/// First bytes of nodes in formats other than Doom's own.
const NODE_KINDS: [(&str, &str); 9] = [
    ("XNOD", "extended"),
    ("ZNOD", "compressed extended"),
    ("XGLN", "extended GL"),
    ("ZGLN", "compressed GL"),
    ("XGL2", "extended GL"),
    ("ZGL2", "compressed GL"),
    ("XGL3", "extended GL"),
    ("ZGL3", "compressed GL"),
    ("xNd4", "DeePBSP's"),
];
const OWN_NODES: &str = "nodes in Doom's own format, as node builders (ZDBSP, ZenNode) write them \
                         unless told otherwise";
/// Most maps that a message names.
const MOST_NAMED: usize = 32;

/// A file's directory.
pub struct Wad<'a> {
    file: &'a str,
    bytes: &'a [u8],
    lumps: Vec<Lump>,
}

struct Lump {
    name: String,
    /// Offset of its directory entry in the file.
    entry: usize,
}

impl<'a> Wad<'a> {
    /// Reads the directory.
    ///
    /// The range of a lump is checked when the lump is read: damage elsewhere does not affect a
    /// map.
    pub fn open(bytes: &'a [u8], file: &'a str) -> Result<Self> {
        let mut wad = Wad {
            file,
            bytes,
            lumps: Vec::new(),
        };
        let magic = bytes.get(..4).unwrap_or(bytes);
        if magic != b"IWAD" && magic != b"PWAD" {
            let found = format!("'{}'", magic.escape_ascii());
            return Err(wad.error(0, found, "the magic IWAD or PWAD"));
        }
        if bytes.len() < 12 {
            return Err(wad.error(bytes.len(), "the end of the file", "a 12 byte header"));
        }
        let int = |at: usize| {
            let value = int_at(bytes, at);
            let expected = "a count or offset of at least 0";
            usize::try_from(value).map_err(|_| wad.error(at, value.to_string(), expected))
        };
        let (count, directory) = (int(4)?, int(8)?);
        for i in 0..count {
            let at = directory + i * 16;
            let Some(entry) = bytes.get(at..at + 16) else {
                let found = format!("the end of the file in directory entry {i} of {count}");
                return Err(wad.error(bytes.len(), found, "16 bytes an entry"));
            };
            let shown = |b: &u8| b.is_ascii_graphic().then(|| b.to_ascii_uppercase() as char);
            let name = entry[8..16].iter().take_while(|b| **b != 0);
            let name = name.map(|b| shown(b).unwrap_or('?')).collect();
            wad.lumps.push(Lump { name, entry: at });
        }
        Ok(wad)
    }

    /// The names of the maps and the indices of their markers, in file order.
    ///
    /// The last of several maps with one name counts, as in engines.
    pub fn markers(&self) -> Vec<(&str, usize)> {
        let mut seen = HashSet::new();
        let all = (0..self.lumps.len()).rev().filter(|&at| self.is_marker(at));
        let named = all.map(|at| (&self.lumps[at].name[..], at));
        let mut last: Vec<_> = named.filter(|(name, _)| seen.insert(*name)).collect();
        last.reverse();
        last
    }

    fn is_marker(&self, at: usize) -> bool {
        let (name, next) = (&self.lumps[at].name[..], self.lumps.get(at + 1));
        !LUMPS.contains(&name) && next.is_some_and(|next| FIRST.contains(&&next.name[..]))
    }

    /// The name of the wanted map, or of the only one, and the index of its marker.
    fn marker(&self, map: Option<&str>) -> Result<(&str, usize)> {
        let is_wanted = |name: &str| map.is_none_or(|map| name.eq_ignore_ascii_case(map));
        let maps = self.markers();
        let listed = || first_of(&maps.iter().map(|m| m.0).collect::<Vec<_>>(), MOST_NAMED);
        let mut wanted = maps.iter().filter(|(name, _)| is_wanted(name));
        Err(match (wanted.next(), wanted.next(), map) {
            (Some(one), None, _) => return Ok(*one),
            (Some(first), _, _) => {
                let found = format!("{} maps, {}", maps.len(), listed());
                self.error(0, found, part_hint(self.file, first.0))
            }
            (None, _, None) => self.error(0, "no map", "a map marker followed by THINGS"),
            (None, _, Some(map)) => {
                let lump = self.lumps.iter().any(|lump| is_wanted(&lump.name));
                let lump = lump.then_some(" (THINGS does not follow the lump of that name)");
                let found = format!("no map '{map}' among {}{}", listed(), lump.unwrap_or(""));
                self.error(0, found, "one of the file's maps")
            }
        })
    }

    /// The tables of the named map, or of the only one, from THINGS to REJECT.
    ///
    /// REJECT is empty if the map has none. A map's lumps are found by name after its marker, up to
    /// the next marker or the first lump out of order; other lumps are skipped.
    pub fn tables(&self, map: Option<&str>) -> Result<[Table<'_>; 9]> {
        let (name, marker) = self.marker(map)?;
        let mut last = None;
        let is_own = |&at: &usize| {
            let place = LUMPS.iter().position(|name| *name == self.lumps[at].name);
            let is_next = place.is_none() || std::mem::replace(&mut last, place) < place;
            is_next && !self.is_marker(at)
        };
        let own = (marker + 1..self.lumps.len()).take_while(is_own);
        let own: Vec<&Lump> = own.map(|at| &self.lumps[at]).collect();
        let lump = |name: &str| own.iter().find(|lump| lump.name == name);
        for (other, format) in [("TEXTMAP", "UDMF"), ("BEHAVIOR", "Hexen")] {
            if let Some(lump) = lump(other) {
                let found = format!("map {name} in the format of {format} ({other})");
                return Err(self.error(lump.entry, found, "Doom's map format"));
            }
        }
        let table = |of: &'static str, record: usize| -> Result<Table<'_>> {
            let at = self.lumps[marker].entry;
            let table = match lump(of) {
                Some(lump) => Table::of_entry(self.file, of, self.bytes, lump.entry)?,
                None if MAY_LACK.contains(&of) => Table::new(self.file, of, self.bytes, at..at),
                None => {
                    let found = format!("map {name} without {of}");
                    return Err(self.error(at, found, "all lumps of a Doom map, in their order"));
                }
            };
            let begins = |kind: &&(&str, &str)| table.data.starts_with(kind.0.as_bytes());
            if let Some((magic, kind)) = NODE_KINDS.iter().find(begins)
                && BUILT.contains(&of)
            {
                let found = format!("map {name} with {kind} nodes ({magic} in {of})");
                return Err(self.error(table.start, found, OWN_NODES));
            }
            table.of_records(record)
        };
        let [segs, leaves] = [table("SEGS", 12)?, table("SSECTORS", 4)?];
        let nodes = table("NODES", 28)?;
        // A map of one leaf has no nodes.
        let is_empty =
            |table: &&Table| table.len() == 0 && (table.name != "NODES" || leaves.len() != 1);
        if let Some(empty) = [&segs, &leaves, &nodes].into_iter().find(is_empty) {
            let gl = format!("GL_{name}");
            let gl = self.lumps.iter().any(|lump| lump.name == gl);
            let which = match gl {
                true => "with GL nodes alone",
                false => "whose nodes are not built",
            };
            let found = format!("map {name} {which} (no {})", empty.name);
            return Err(self.error(empty.start, found, OWN_NODES));
        }
        Ok([
            table("THINGS", 10)?,
            table("LINEDEFS", 14)?,
            table("SIDEDEFS", 30)?,
            table("VERTEXES", 4)?,
            segs,
            leaves,
            nodes,
            table("SECTORS", 26)?,
            table("REJECT", 1)?,
        ])
    }

    fn error(&self, offset: usize, found: impl Display, expected: impl Display) -> InputError {
        InputError::byte(self.file, offset, found, expected)
    }
}

#[cfg(test)]
mod tests;
