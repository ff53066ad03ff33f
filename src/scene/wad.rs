//! Doom maps: linedefs and things as boxes, the map's own BSP leaves as
//! regions, its things as camera places. It defines the WAD format (the
//! unofficial Doom specs 1.666, Matthew S. Fell 1994) and trusts no byte of it.

use glam::{DVec2, DVec3};

use super::{BspNode, BspRegions, CameraPlace, Labels, Regions, Scene, WorldBox};
use crate::input::InputError;
use crate::scene::regions::BspChild;
use crate::shown::first_of;

/// Height of a player's eyes above the floor, in map units.
const EYE_HEIGHT: f64 = 41.0;
/// Map coordinates are 16-bit.
const LOW: f64 = i16::MIN as f64;
const HIGH: f64 = i16::MAX as f64;
/// The lumps of a map in their fixed order after its marker.
const LUMPS: [&str; 8] = [
    "THINGS", "LINEDEFS", "SIDEDEFS", "VERTEXES", "SEGS", "SSECTORS", "NODES", "SECTORS",
];
/// What a map may have besides.
const MORE_LUMPS: [&str; 3] = ["REJECT", "BLOCKMAP", "BEHAVIOR"];
/// Maps that a message names.
const MOST_NAMED: usize = 8;

/// One map of a WAD file, decoded and cross-checked.
#[derive(Clone, Debug)]
pub struct WadMap {
    /// Things of the map in the order of the file.
    pub things: Vec<Thing>,
    lines: Vec<WorldBox>,
    /// Floor height under each BSP leaf.
    leaf_floors: Vec<f64>,
    bsp: BspRegions,
}

/// A thing: player start, item, lamp.
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct Thing {
    pub x: f64,
    pub y: f64,
    pub angle_deg: f64,
    pub kind: u16,
}

/// The bytes of one lump of a map (`SECTORS`, `REJECT`) as the file has them: of
/// the named map, or of the only one. `None` if the map has no such lump.
///
/// Only the lump's place in the file is checked; [`WadMap::read`] checks that the
/// lumps of a map fit each other.
///
/// # Errors
/// [`InputError::Byte`] for a file that is no WAD, has no such map, or several maps
/// where none is named.
pub fn map_lump<'a>(
    bytes: &'a [u8],
    file: &'a str,
    map: Option<&str>,
    lump: &str,
) -> Result<Option<&'a [u8]>, InputError> {
    let wad = Wad::open(bytes, file)?;
    let (_, marker) = wad.marker(map)?;
    // The next map begins with a marker, which has none of these names.
    let own = wad.lumps[marker + 1..]
        .iter()
        .take_while(|l| LUMPS.contains(&l.name.as_str()) || MORE_LUMPS.contains(&l.name.as_str()));
    let found = own.into_iter().find(|l| l.name == lump);
    Ok(found.map(|l| l.data))
}

/// The names of the maps in a WAD file, in file order.
pub fn map_names(bytes: &[u8], file: &str) -> Result<Vec<String>, InputError> {
    let wad = Wad::open(bytes, file)?;
    Ok(wad.markers().map(|(name, _)| name.to_owned()).collect())
}

impl WadMap {
    /// Decodes one map: the named one, or the only one.
    ///
    /// # Errors
    /// [`InputError::Byte`] with the offset of the first thing that is wrong.
    pub fn read(bytes: &[u8], file: &str, map: Option<&str>) -> Result<WadMap, InputError> {
        let wad = Wad::open(bytes, file)?;
        let (name, marker) = wad.marker(map)?;
        wad.map(name, marker)
    }

    /// The map as a scene: linedefs first, then things, in lump order.
    pub fn into_scene(self, name: impl Into<String>) -> Result<Scene, InputError> {
        let mut boxes = self.lines.clone();
        let mut kinds = Labels::new("kind");
        boxes.iter().for_each(|_| kinds.push("linedef"));
        let mut places = Vec::with_capacity(self.things.len());
        for thing in &self.things {
            let at = DVec2::new(thing.x, thing.y);
            // Things are 16-bit, so the descent always ends in a leaf.
            let leaf = self.bsp.descend(at);
            let floor = leaf.map_or(0.0, |leaf| self.leaf_floors[leaf as usize]);
            let base = at.extend(floor);
            let (edge, height) = thing.size();
            boxes.push(WorldBox::standing(base, DVec3::new(edge, edge, height)));
            kinds.push(thing.kind_name());
            let angle = thing.angle_deg.to_radians();
            places.push(CameraPlace {
                eye: base + DVec3::Z * EYE_HEIGHT,
                forward: DVec3::new(libm::cos(angle), libm::sin(angle), 0.0),
            });
        }
        // Map coordinates are small integers, exact in f32: no other origin.
        let mut scene = Scene::about(name, &boxes, DVec3::ZERO)?;
        scene.own_tree = Some(self.bsp.plane_tree());
        scene.regions = Regions::Bsp(self.bsp);
        scene.labels = vec![kinds];
        scene.places = places;
        Ok(scene)
    }
}

impl Thing {
    fn is_start(&self) -> bool {
        matches!(self.kind, 1..=4 | 11)
    }

    /// Width and height (linuxdoom 1.10, info.c: players 16 by 56, the
    /// pickups of a deathmatch map 20 by 16).
    fn size(&self) -> (f64, f64) {
        match self.is_start() {
            true => (32.0, 56.0),
            false => (40.0, 16.0),
        }
    }

    fn kind_name(&self) -> &'static str {
        if self.is_start() { "start" } else { "thing" }
    }
}

/// The file's directory.
struct Wad<'a> {
    file: &'a str,
    bytes: &'a [u8],
    lumps: Vec<Lump<'a>>,
}

struct Lump<'a> {
    name: String,
    offset: usize,
    data: &'a [u8],
}

impl<'a> Wad<'a> {
    fn open(bytes: &'a [u8], file: &'a str) -> Result<Self, InputError> {
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
        let (count, directory) = (wad.header_int(4)?, wad.header_int(8)?);
        for i in 0..count {
            let at = directory + i * 16;
            let Some(entry) = bytes.get(at..at + 16) else {
                let found = format!("the end of the file in directory entry {i} of {count}");
                return Err(wad.error(bytes.len(), found, "16 bytes an entry"));
            };
            let shown = |b: &u8| b.is_ascii_graphic().then(|| b.to_ascii_uppercase() as char);
            let name = entry[8..16].iter().take_while(|b| **b != 0);
            let name: String = name.map(|b| shown(b).unwrap_or('?')).collect();
            let (offset, size) = (i32_at(entry, 0), i32_at(entry, 4));
            let range = usize::try_from(offset).ok().zip(usize::try_from(size).ok());
            let data =
                range.and_then(|(offset, size)| bytes.get(offset..offset.checked_add(size)?));
            let Some(data) = data else {
                let found = format!("lump {name} at {offset}, {size} bytes long");
                let expected = format!("a lump within the file's {} bytes", bytes.len());
                return Err(wad.error(at, found, expected));
            };
            wad.lumps.push(Lump {
                name,
                offset: offset as usize,
                data,
            });
        }
        Ok(wad)
    }

    /// The name of the wanted map, or of the only one, and the index of its marker.
    fn marker(&self, map: Option<&str>) -> Result<(&str, usize), InputError> {
        let is_wanted = |name: &str| map.is_none_or(|map| name.eq_ignore_ascii_case(map));
        let wanted: Vec<(&str, usize)> =
            self.markers().filter(|(name, _)| is_wanted(name)).collect();
        let (found, expected) = match (&wanted[..], map) {
            ([one], _) => return Ok(*one),
            ([], None) => (
                "no map".to_owned(),
                "a map marker followed by THINGS".into(),
            ),
            ([], Some(map)) => (
                format!("no map '{map}' among {}", self.listed()),
                "one of the file's maps".into(),
            ),
            ([first, ..], None) => (
                format!("{} maps, {}", wanted.len(), self.listed()),
                format!("one of them by name, as in '{}#{}'", self.file, first.0),
            ),
            ([..], Some(map)) => (
                format!("{} maps of the name '{map}'", wanted.len()),
                "one".into(),
            ),
        };
        Err(self.error(0, found, expected))
    }

    /// The names of the maps and the indices of their markers, in file order.
    fn markers(&self) -> impl Iterator<Item = (&str, usize)> {
        let pairs = self.lumps.windows(2).zip(0..);
        let markers = pairs.filter(|(pair, _)| pair[1].name == LUMPS[0]);
        markers.map(|(pair, at)| (&pair[0].name[..], at))
    }

    /// The names of the maps for a message.
    fn listed(&self) -> String {
        let names: Vec<&str> = self.markers().map(|(name, _)| name).collect();
        first_of(&names, MOST_NAMED)
    }

    fn header_int(&self, at: usize) -> Result<usize, InputError> {
        let Some(field) = self.bytes.get(at..at + 4) else {
            let end = self.bytes.len();
            return Err(self.error(end, "the end of the file", "a 12 byte header"));
        };
        let value = i32_at(field, 0);
        usize::try_from(value)
            .map_err(|_| self.error(at, value.to_string(), "a count or offset of at least 0"))
    }

    fn error(
        &self,
        offset: usize,
        found: impl Into<String>,
        expected: impl Into<String>,
    ) -> InputError {
        InputError::Byte {
            file: self.file.to_owned(),
            offset: offset as u64,
            found: found.into(),
            expected: expected.into(),
        }
    }

    fn map(&self, name: &str, marker: usize) -> Result<WadMap, InputError> {
        let here: Vec<&Lump> = self.lumps[marker..].iter().skip(1).take(11).collect();
        if let Some(hexen) = here.iter().find(|l| l.name == "BEHAVIOR") {
            let found = "a Hexen map (BEHAVIOR)";
            return Err(self.error(hexen.offset, found, "Doom's map format"));
        }
        let mut tables = Vec::with_capacity(LUMPS.len());
        for (lump, record) in LUMPS.iter().zip([10, 14, 30, 4, 12, 4, 28, 26]) {
            let Some(found) = here.iter().find(|l| l.name == *lump) else {
                let at = self.lumps[marker].offset;
                let found = format!("map {name} without {lump}");
                return Err(self.error(at, found, "all lumps of a Doom map"));
            };
            if found.data.len() % record != 0 {
                let what = format!("{lump} of {} bytes", found.data.len());
                let expected = format!("a multiple of {record} bytes");
                return Err(self.error(found.offset, what, expected));
            }
            tables.push(Table {
                wad: self,
                lump: found,
                record,
            });
        }
        let [things, lines, sides, vertices, segs, leaves, nodes, sectors] = &tables[..] else {
            unreachable!("one table for each of the eight lumps");
        };
        let vertex = |table: &Table, i: usize, at: usize| -> Result<DVec2, InputError> {
            let v = table.index(i, at, vertices)?;
            Ok(DVec2::new(vertices.int(v, 0), vertices.int(v, 2)))
        };
        // Side i of a line (0 right, 1 left) -> its sector, if it has one.
        let sector_of = |line: usize, side: usize| -> Result<Option<usize>, InputError> {
            let at = 10 + 2 * side;
            if lines.word(line, at) == u16::MAX {
                return Ok(None);
            }
            let side = lines.index(line, at, sides)?;
            sides.index(side, 28, sectors).map(Some)
        };
        let mut line_boxes = Vec::with_capacity(lines.len());
        for i in 0..lines.len() {
            let (a, b) = (vertex(lines, i, 0)?, vertex(lines, i, 2)?);
            let (mut low, mut high) = (f64::INFINITY, f64::NEG_INFINITY);
            for side in 0..2 {
                if let Some(sector) = sector_of(i, side)? {
                    // A closed door's ceiling may lie below its floor.
                    for height in [sectors.int(sector, 0), sectors.int(sector, 2)] {
                        (low, high) = (low.min(height), high.max(height));
                    }
                }
            }
            if low > high {
                return Err(lines.error(i, 10, "a linedef without a side", "at least one side"));
            }
            line_boxes.push(WorldBox::new(a.min(b).extend(low), a.max(b).extend(high)));
        }
        let mut leaf_floors = Vec::with_capacity(leaves.len());
        for i in 0..leaves.len() {
            let count = leaves.word(i, 0);
            if count == 0 {
                return Err(leaves.error(i, 0, "a subsector of 0 segs", "at least one"));
            }
            let seg = leaves.index(i, 2, segs)?;
            let line = segs.index(seg, 6, lines)?;
            let side = usize::from(segs.word(seg, 8) != 0);
            let Some(sector) = sector_of(line, side)? else {
                let found = format!("a seg on the missing side of linedef {line}");
                return Err(segs.error(seg, 8, found, "a side that exists"));
            };
            leaf_floors.push(sectors.int(sector, 0));
        }
        let child = |i: usize, at: usize| -> BspChild {
            let word = nodes.word(i, at);
            let index = u32::from(word & 0x7FFF);
            match word & 0x8000 {
                0 => BspChild::Node(index),
                _ => BspChild::Leaf(index),
            }
        };
        let tree: Vec<BspNode> = (0..nodes.len())
            .map(|i| BspNode {
                x: nodes.int(i, 0),
                y: nodes.int(i, 2),
                dx: nodes.int(i, 4),
                dy: nodes.int(i, 6),
                children: [child(i, 24), child(i, 26)],
            })
            .collect();
        // The root is the last node; a map of one leaf has none.
        let root = match tree.len() {
            0 => BspChild::Leaf(0),
            count => BspChild::Node(count as u32 - 1),
        };
        let bsp = BspRegions::new(tree, root, leaves.len(), LOW, HIGH)
            .map_err(|found| self.error(nodes.lump.offset, found, "a BSP tree"))?;
        Ok(WadMap {
            things: (0..things.len())
                .map(|i| Thing {
                    x: things.int(i, 0),
                    y: things.int(i, 2),
                    angle_deg: things.int(i, 4),
                    kind: things.word(i, 6),
                })
                .collect(),
            lines: line_boxes,
            leaf_floors,
            bsp,
        })
    }
}

/// A lump of fixed-size records.
struct Table<'a> {
    wad: &'a Wad<'a>,
    lump: &'a Lump<'a>,
    record: usize,
}

impl Table<'_> {
    fn len(&self) -> usize {
        self.lump.data.len() / self.record
    }

    /// The unsigned 16-bit field at byte `at` of record `i`.
    fn word(&self, i: usize, at: usize) -> u16 {
        let start = i * self.record + at;
        u16::from_le_bytes([self.lump.data[start], self.lump.data[start + 1]])
    }

    /// The signed 16-bit field, as a coordinate.
    fn int(&self, i: usize, at: usize) -> f64 {
        f64::from(self.word(i, at) as i16)
    }

    /// A field that counts records of another table.
    fn index(&self, i: usize, at: usize, of: &Table) -> Result<usize, InputError> {
        let index = usize::from(self.word(i, at));
        if index < of.len() {
            return Ok(index);
        }
        let found = format!("{} {index} in {} {i}", of.lump.name, self.lump.name);
        Err(self.error(i, at, found, format!("less than {}", of.len())))
    }

    fn error(
        &self,
        i: usize,
        at: usize,
        found: impl Into<String>,
        expected: impl Into<String>,
    ) -> InputError {
        let offset = self.lump.offset + i * self.record + at;
        self.wad.error(offset, found, expected)
    }
}

fn i32_at(bytes: &[u8], at: usize) -> i32 {
    i32::from_le_bytes([bytes[at], bytes[at + 1], bytes[at + 2], bytes[at + 3]])
}

#[cfg(test)]
mod tests {
    use super::*;

    const MAP12: &[u8] = include_bytes!("../../datasets/freedm_map12.wad");
    const MAP20: &[u8] = include_bytes!("../../datasets/freedm_map20.wad");

    #[test]
    fn both_maps_have_their_published_size() {
        for (bytes, leaves, things) in [(MAP12, 87, 21), (MAP20, 825, 108)] {
            let map = WadMap::read(bytes, "m.wad", None).unwrap();
            assert_eq!((map.bsp.len(), map.things.len()), (leaves, things));
        }
        assert_eq!(map_names(MAP12, "m.wad").unwrap(), ["MAP12"]);
    }

    #[test]
    fn every_thing_lies_in_exactly_the_leaf_that_the_descent_finds() {
        for bytes in [MAP12, MAP20] {
            let map = WadMap::read(bytes, "m.wad", None).unwrap();
            for thing in &map.things {
                let at = DVec2::new(thing.x, thing.y);
                let owners: Vec<u32> = (0..map.bsp.len() as u32)
                    .filter(|&leaf| map.bsp.holds(leaf, at))
                    .collect();
                assert_eq!(owners, [map.bsp.descend(at).unwrap()], "{thing:?}");
            }
        }
    }

    #[test]
    fn things_stand_in_their_sector_and_look_along_their_angle() {
        let scene = WadMap::read(MAP12, "m.wad", None)
            .unwrap()
            .into_scene("m")
            .unwrap();
        let kinds = scene.labels[0].histogram();
        assert_eq!(kinds.iter().map(|k| k.1).sum::<usize>(), scene.items.len());
        assert_eq!(scene.places.len(), 21);
        for place in &scene.places {
            assert!((place.forward.length() - 1.0).abs() < 1e-12);
            let eye = place.eye.as_vec3();
            assert!(scene.bounds.contains_point(eye), "{eye}");
        }
    }

    #[test]
    fn no_truncation_and_no_flipped_byte_panics() {
        for length in (0..MAP12.len())
            .step_by(7)
            .chain(MAP12.len() - 40..MAP12.len())
        {
            let result = WadMap::read(&MAP12[..length], "m.wad", None);
            let error = result.expect_err("a truncated file is no map").to_string();
            assert!(
                error.contains("m.wad, byte ") && error.contains("expected"),
                "{error}"
            );
        }
        let mut bytes = MAP12.to_vec();
        for at in (0..bytes.len()).step_by(11) {
            let kept = bytes[at];
            for value in [0, 0x7F, 0x80, 0xFF] {
                bytes[at] = value;
                if let Ok(map) = WadMap::read(&bytes, "m.wad", None) {
                    let _ = map.into_scene("m");
                }
            }
            bytes[at] = kept;
        }
    }

    #[test]
    fn a_lump_is_found_by_map_and_name() {
        // One bit for each pair of sectors.
        for (bytes, sectors) in [(MAP12, 49usize), (MAP20, 191)] {
            let lump = |name| map_lump(bytes, "m.wad", None, name).unwrap();
            assert_eq!(lump("SECTORS").unwrap().len(), sectors * 26);
            assert_eq!(
                lump("REJECT").unwrap().len(),
                (sectors * sectors).div_ceil(8)
            );
            assert_eq!(lump("PWADINFO"), None);
        }
        assert!(map_lump(MAP12, "m.wad", Some("E1M1"), "SECTORS").is_err());
    }

    #[test]
    fn an_unknown_map_name_lists_what_is_there() {
        let error = WadMap::read(MAP12, "m.wad", Some("E1M1"))
            .unwrap_err()
            .to_string();
        assert!(error.contains("no map 'E1M1' among MAP12"), "{error}");
    }
}
