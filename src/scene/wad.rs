//! Doom maps: linedefs and things as boxes.
//!
//! The map's own BSP leaves are regions, its things are camera places.

use std::sync::{Arc, OnceLock};

use glam::{DVec2, DVec3};

use super::bsp::{BspChild, BspNode, BspTree};
use super::disputes::{Dispute, Linedef, disputes};
use super::lumps::Wad;
use super::records::Table;
use super::{CameraPlace, Labels, Regions, Scene, WorldBox};
use crate::input::Result;

/// Height of a player's eyes above the floor, in map units.
const EYE_HEIGHT: f64 = 41.0;
/// Least and greatest map coordinate: 16 bits.
const EXTENT: [f64; 2] = [i16::MIN as f64, i16::MAX as f64];

/// One map of a WAD file, decoded and cross-checked.
#[derive(Clone, Debug)]
pub struct WadMap {
    /// Things of the map in the order of the file.
    pub things: Vec<Thing>,
    /// Its linedefs, in the order of the file; each has at least one side.
    pub lines: Vec<Linedef>,
    /// Its sectors, in the order of the file.
    pub sectors: Vec<SectorRecord>,
    /// The sector of each BSP leaf: that of its first seg.
    pub leaf_sectors: Vec<u32>,
    /// The lump REJECT, empty if there is none.
    pub reject: Vec<u8>,
    /// The BSP tree of the map.
    pub tree: BspTree,
    disputes: OnceLock<Vec<Dispute>>,
}

/// A sector as in the file.
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct SectorRecord {
    /// Heights of its floor and its ceiling, which may lie below the floor.
    pub heights: [f64; 2],
    pub tag: u16,
}

/// A thing: player start, item, lamp.
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct Thing {
    /// Position, map units.
    pub at: DVec2,
    pub angle_deg: f64,
    pub kind: u16,
}

/// The names of the maps in a WAD file, in file order.
///
/// If several maps have the same name, only the last counts.
pub fn map_names(bytes: &[u8], file: &str) -> Result<Vec<String>> {
    let wad = Wad::open(bytes, file)?;
    let names = wad.markers().into_iter().map(|(name, _)| name.to_owned());
    Ok(names.collect())
}

impl WadMap {
    /// Decodes one map: the named one, or the only one.
    ///
    /// # Errors
    /// The first error in the file, by its byte.
    pub fn read(bytes: &[u8], file: &str, map: Option<&str>) -> Result<WadMap> {
        let wad = Wad::open(bytes, file)?;
        let [things, linedefs, sides, vertices, rest @ ..] = wad.tables(map)?;
        let [segs, leaves, nodes, sectors, reject] = rest;
        let vertex = |table: &Table, i: usize, at: usize| -> Result<[i32; 2]> {
            let v = table.index16(i, at, &vertices)?;
            Ok([0, 2].map(|at| vertices.short(v, at) as i32))
        };
        // The sector on a side of a line (0 right, 1 left), if there is one.
        let sector_of = |line: usize, side: usize| -> Result<Option<u32>> {
            let at = 10 + 2 * side;
            if linedefs.word(line, at) == u16::MAX {
                return Ok(None);
            }
            let side = linedefs.index16(line, at, &sides)?;
            Ok(Some(sides.index16(side, 28, &sectors)? as u32))
        };
        let linedef = |i: usize| -> Result<Linedef> {
            let sectors = [sector_of(i, 0)?, sector_of(i, 1)?];
            if sectors == [None; 2] {
                let found = "a linedef without a side";
                return Err(linedefs.error(i, 10, found, "at least one side"));
            }
            Ok(Linedef {
                ends: [vertex(&linedefs, i, 0)?, vertex(&linedefs, i, 2)?],
                action: linedefs.word(i, 6),
                tag: linedefs.word(i, 8),
                sectors,
            })
        };
        let lines = (0..linedefs.len()).map(linedef);
        let lines = lines.collect::<Result<Vec<_>, _>>()?;
        for i in 0..segs.len() {
            vertex(&segs, i, 0)?;
            vertex(&segs, i, 2)?;
            segs.index16(i, 6, &linedefs)?;
        }
        let leaf_sector = |i: usize| -> Result<u32> {
            let (count, first) = (leaves.word(i, 0), leaves.index16(i, 2, &segs)?);
            if count == 0 || first + usize::from(count) > segs.len() {
                let found = format!("a subsector of {count} segs from {first} on");
                let expected = format!("at least one, of {}", segs.len());
                return Err(leaves.error(i, 0, found, expected));
            }
            let line = segs.index16(first, 6, &linedefs)?;
            let side = usize::from(segs.word(first, 8) != 0);
            lines[line].sectors[side].ok_or_else(|| {
                let found = format!("a seg on the missing side of linedef {line}");
                segs.error(first, 8, found, "a side that exists")
            })
        };
        let leaf_sectors = (0..leaves.len()).map(leaf_sector);
        let child = |word: u16| match u32::from(word & 0x7FFF) {
            node if word & 0x8000 == 0 => BspChild::Node(node),
            leaf => BspChild::Leaf(leaf),
        };
        let split = (0..nodes.len()).map(|i| BspNode {
            start: nodes.point(i, 0),
            direction: nodes.point(i, 4),
            children: [24, 26].map(|at| child(nodes.word(i, at))),
        });
        // The root is the last node; a map of one leaf has none.
        let root = match nodes.len() {
            0 => BspChild::Leaf(0),
            count => BspChild::Node(count as u32 - 1),
        };
        let things = (0..things.len()).map(|i| Thing {
            at: things.point(i, 0),
            angle_deg: things.short(i, 4),
            kind: things.word(i, 6),
        });
        let sectors = (0..sectors.len()).map(|i| SectorRecord {
            heights: [0, 2].map(|at| sectors.short(i, at)),
            tag: sectors.word(i, 24),
        });
        Ok(WadMap {
            leaf_sectors: leaf_sectors.collect::<Result<_, _>>()?,
            tree: BspTree::new(split.collect(), root, leaves.len(), EXTENT)
                .map_err(|found| nodes.error(0, 0, found, "a BSP tree"))?,
            things: things.collect(),
            sectors: sectors.collect(),
            reject: reject.data.to_vec(),
            disputes: OnceLock::new(),
            lines,
        })
    }

    /// Points for which the linedefs disagree; with any, sectors are not regions.
    pub fn disputes(&self) -> &[Dispute] {
        self.disputes.get_or_init(|| disputes(&self.lines))
    }

    /// The box of a linedef: over the heights of the sectors on its sides.
    fn line_box(&self, line: &Linedef) -> WorldBox {
        let sectors = line.sectors.iter().flatten();
        // A closed door's ceiling may lie below its floor.
        let heights = sectors.flat_map(|&sector| self.sectors[sector as usize].heights);
        let [a, b] = line.ends.map(|[x, y]| DVec2::new(x.into(), y.into()));
        let corners = heights.flat_map(|z| [a, b].map(|end| WorldBox::at(end.extend(z))));
        WorldBox::union_of(corners)
    }

    /// The map as a scene: linedefs first, then things, in lump order.
    pub fn into_scene(self, name: impl Into<String>) -> Result<Scene> {
        let lines = self.lines.iter().map(|line| self.line_box(line));
        let mut boxes: Vec<WorldBox> = lines.collect();
        let mut kinds = Labels::new("kind");
        boxes.iter().for_each(|_| kinds.push("linedef"));
        let mut places = Vec::with_capacity(self.things.len());
        for thing in &self.things {
            // Coordinates of things have 16 bits, so the descent always ends in a leaf.
            let leaf = self.tree.descend(thing.at);
            let sector = leaf.map(|leaf| self.leaf_sectors[leaf as usize] as usize);
            let floor = sector.map_or(0.0, |sector| self.sectors[sector].heights[0]);
            let base = thing.at.extend(floor);
            // linuxdoom 1.10, info.c: players 16 by 56, the pickups of a deathmatch map 20 by 16.
            let (kind, edge, height) = match thing.kind {
                1..=4 | 11 => ("start", 32.0, 56.0),
                _ => ("thing", 40.0, 16.0),
            };
            boxes.push(WorldBox::standing(base, DVec3::new(edge, edge, height)));
            kinds.push(kind);
            let angle = thing.angle_deg.to_radians();
            places.push(CameraPlace {
                eye: base + DVec3::Z * EYE_HEIGHT,
                forward: DVec3::new(libm::cos(angle), libm::sin(angle), 0.0),
                view: None,
            });
        }
        // Map coordinates are small integers, exact in f32: the origin is zero.
        let scene = Scene::about(name, &boxes, DVec3::ZERO)?;
        Ok(Scene {
            own_tree: Some(self.tree.plane_tree()),
            regions: Regions::Bsp(Arc::new(self)),
            labels: vec![kinds],
            places,
            ..scene
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    impl WadMap {
        /// Static sectors between lines, all of them in one leaf.
        pub fn at_rest(lines: Vec<Linedef>, heights: Vec<[f64; 2]>) -> WadMap {
            let sectors = heights.into_iter();
            WadMap {
                sectors: sectors
                    .map(|heights| SectorRecord { heights, tag: 0 })
                    .collect(),
                lines,
                things: Vec::new(),
                leaf_sectors: Vec::new(),
                reject: Vec::new(),
                tree: BspTree::new(Vec::new(), BspChild::Leaf(0), 1, EXTENT).unwrap(),
                disputes: OnceLock::new(),
            }
        }
    }

    const MAP12: &[u8] = include_bytes!("../../datasets/freedm_map12.wad");
    const MAP20: &[u8] = include_bytes!("../../datasets/freedm_map20.wad");

    #[test]
    fn both_maps_have_their_published_size() {
        for (bytes, leaves, things) in [(MAP12, 87, 21), (MAP20, 825, 108)] {
            let map = WadMap::read(bytes, "m.wad", None).unwrap();
            assert_eq!((map.tree.boxes.len(), map.things.len()), (leaves, things));
        }
        assert_eq!(map_names(MAP12, "m.wad").unwrap(), ["MAP12"]);
    }

    #[test]
    fn every_thing_lies_in_the_box_of_its_leaf() {
        for bytes in [MAP12, MAP20] {
            let map = WadMap::read(bytes, "m.wad", None).unwrap();
            for thing in &map.things {
                let leaf = map.tree.descend(thing.at).unwrap();
                let bounds = map.tree.boxes[leaf as usize];
                assert!(
                    bounds.contains_point(thing.at.as_vec2().extend(0.0)),
                    "{thing:?}"
                );
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
