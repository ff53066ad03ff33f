//! Doom maps: linedefs and things as boxes, the map's own BSP leaves as
//! regions, its things as camera places.

use glam::{DVec2, DVec3};

use super::disputes::Linedef;
use super::lumps::{MapTables, Table, Wad};
use super::{BspNode, BspRegions, CameraPlace, Labels, Regions, Scene, WorldBox};
use crate::geometry::Aabb;
use crate::input::InputError;
use crate::query::ItemId;
use crate::scene::regions::BspChild;

/// Height of a player's eyes above the floor, in map units.
const EYE_HEIGHT: f64 = 41.0;
/// Map coordinates are 16-bit.
const LOW: f64 = i16::MIN as f64;
const HIGH: f64 = i16::MAX as f64;
/// One map of a WAD file, decoded and cross-checked.
#[derive(Clone, Debug)]
pub struct WadMap {
    /// Things of the map in the order of the file.
    pub things: Vec<Thing>,
    /// Its linedefs, in the order of the file; each has a side.
    pub lines: Vec<Linedef>,
    /// Its sectors, in the order of the file.
    pub sectors: Vec<SectorRecord>,
    /// The sector of each BSP leaf: that of its first seg.
    pub leaf_sectors: Vec<u32>,
    /// The lump REJECT, empty if there is none.
    pub reject: Vec<u8>,
    bsp: BspRegions,
}

/// A sector as the file has it.
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct SectorRecord {
    /// Of its floor and its ceiling, which may lie below the floor.
    pub heights: [f64; 2],
    pub tag: u16,
}

/// A thing: player start, item, lamp.
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct Thing {
    pub x: f64,
    pub y: f64,
    pub angle_deg: f64,
    pub kind: u16,
}

/// The names of the maps in a WAD file, in file order; of several of one name there is
/// but the last.
pub fn map_names(bytes: &[u8], file: &str) -> Result<Vec<String>, InputError> {
    let wad = Wad::open(bytes, file)?;
    let names = wad.markers().into_iter().map(|(name, _)| name.to_owned());
    Ok(names.collect())
}

impl WadMap {
    /// Decodes one map: the named one, or the only one.
    ///
    /// # Errors
    /// [`InputError::Byte`] with the offset of the first thing that is wrong.
    pub fn read(bytes: &[u8], file: &str, map: Option<&str>) -> Result<WadMap, InputError> {
        let wad = Wad::open(bytes, file)?;
        let MapTables {
            things,
            lines,
            sides,
            vertices,
            segs,
            leaves,
            nodes,
            sectors,
            reject,
        } = &wad.tables(map)?;
        let vertex = |table: &Table, i: usize, at: usize| -> Result<[i32; 2], InputError> {
            let v = table.index(i, at, vertices)?;
            Ok([0, 2].map(|at| vertices.int(v, at) as i32))
        };
        // The sector on a side of a line (0 right, 1 left), if there is one.
        let sector_of = |line: usize, side: usize| -> Result<Option<u32>, InputError> {
            let at = 10 + 2 * side;
            if lines.word(line, at) == u16::MAX {
                return Ok(None);
            }
            let side = lines.index(line, at, sides)?;
            Ok(Some(sides.index(side, 28, sectors)? as u32))
        };
        let linedef = |i: usize| -> Result<Linedef, InputError> {
            let sectors = [sector_of(i, 0)?, sector_of(i, 1)?];
            if sectors == [None; 2] {
                return Err(lines.error(i, 10, "a linedef without a side", "at least one side"));
            }
            Ok(Linedef {
                ends: [vertex(lines, i, 0)?, vertex(lines, i, 2)?],
                action: lines.word(i, 6),
                tag: lines.word(i, 8),
                sectors,
            })
        };
        let linedefs = (0..lines.len()).map(linedef);
        let linedefs = linedefs.collect::<Result<Vec<_>, _>>()?;
        for i in 0..segs.len() {
            vertex(segs, i, 0)?;
            vertex(segs, i, 2)?;
            segs.index(i, 6, lines)?;
        }
        let leaf_sector = |i: usize| -> Result<u32, InputError> {
            let (count, first) = (leaves.word(i, 0), leaves.index(i, 2, segs)?);
            if count == 0 || first + usize::from(count) > segs.len() {
                let found = format!("a subsector of {count} segs from {first} on");
                let expected = format!("at least one, of {}", segs.len());
                return Err(leaves.error(i, 0, found, expected));
            }
            let line = segs.index(first, 6, lines)?;
            let side = usize::from(segs.word(first, 8) != 0);
            linedefs[line].sectors[side].ok_or_else(|| {
                let found = format!("a seg on the missing side of linedef {line}");
                segs.error(first, 8, found, "a side that exists")
            })
        };
        let leaf_sectors = (0..leaves.len()).map(leaf_sector);
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
        Ok(WadMap {
            leaf_sectors: leaf_sectors.collect::<Result<_, _>>()?,
            bsp: BspRegions::new(tree, root, leaves.len(), LOW, HIGH)
                .map_err(|found| nodes.error(0, 0, found, "a BSP tree"))?,
            things: (0..things.len())
                .map(|i| Thing {
                    x: things.int(i, 0),
                    y: things.int(i, 2),
                    angle_deg: things.int(i, 4),
                    kind: things.word(i, 6),
                })
                .collect(),
            lines: linedefs,
            sectors: (0..sectors.len())
                .map(|i| SectorRecord {
                    heights: [0, 2].map(|at| sectors.int(i, at)),
                    tag: sectors.word(i, 24),
                })
                .collect(),
            reject: reject.to_vec(),
        })
    }

    /// A box about each BSP leaf, without a height.
    pub fn leaf_boxes(&self) -> &[Aabb] {
        &self.bsp.boxes
    }

    /// The box of a linedef: over the heights of the sectors on its sides.
    fn line_box(&self, line: &Linedef) -> WorldBox {
        let (mut low, mut high) = (f64::INFINITY, f64::NEG_INFINITY);
        for &sector in line.sectors.iter().flatten() {
            // A closed door's ceiling may lie below its floor.
            for height in self.sectors[sector as usize].heights {
                (low, high) = (low.min(height), high.max(height));
            }
        }
        let [a, b] = line.ends.map(|[x, y]| DVec2::new(x.into(), y.into()));
        WorldBox::new(a.min(b).extend(low), a.max(b).extend(high))
    }

    /// The map as a scene: linedefs first, then things, in lump order.
    pub fn into_scene(mut self, name: impl Into<String>) -> Result<Scene, InputError> {
        let lines = self.lines.iter().map(|line| self.line_box(line));
        let mut boxes: Vec<WorldBox> = lines.collect();
        let mut kinds = Labels::new("kind");
        boxes.iter().for_each(|_| kinds.push("linedef"));
        let mut places = Vec::with_capacity(self.things.len());
        for thing in &self.things {
            let at = DVec2::new(thing.x, thing.y);
            // Things are 16-bit, so the descent always ends in a leaf.
            let leaf = self.bsp.descend(at);
            let sector = leaf.map(|leaf: ItemId| self.leaf_sectors[leaf as usize] as usize);
            let floor = sector.map_or(0.0, |sector| self.sectors[sector].heights[0]);
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
        self.bsp.lines = self.lines;
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
    fn an_unknown_map_name_lists_what_is_there() {
        let error = WadMap::read(MAP12, "m.wad", Some("E1M1"))
            .unwrap_err()
            .to_string();
        assert!(error.contains("no map 'E1M1' among MAP12"), "{error}");
    }
}
