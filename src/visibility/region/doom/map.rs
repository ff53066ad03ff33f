//! The lumps of a map, as far as they say what is solid and what is open.

use std::sync::Arc;

use glam::DVec3;

use super::super::answer::RegionId;
use super::super::pvs::Pvs;
use crate::input::InputError;
use crate::scene::{Scene, WadMap, WorldBox, map_lump};
use crate::visibility::MapFile;

/// Height at which what moves ends; map units fit 16 bits.
const HIGHEST: f64 = 32768.0;

/// A linedef.
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct MapLine {
    /// Where it begins and ends, map units.
    pub ends: [[i32; 2]; 2],
    /// The sectors on its right (its front) and on its left.
    pub sectors: [Option<RegionId>; 2],
    /// Lowest and highest height that it lets through; `None` where it is solid.
    pub open: Option<[f64; 2]>,
}

/// A sector.
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct Sector {
    /// Height of its floor, far down where it moves.
    pub floor: f64,
    /// Height of its ceiling, far up where it moves.
    pub ceiling: f64,
}

/// What a map says of visibility.
#[derive(Clone, Debug)]
pub struct DoomMap {
    /// Its linedefs, in file order, those of length zero left out.
    pub lines: Vec<MapLine>,
    /// Its sectors, in file order.
    pub sectors: Vec<Sector>,
    /// Boxes about the leaves of the map's own tree, by sector, without a height.
    pub(super) parts: Vec<Vec<WorldBox>>,
    /// Which linedef of the file each of `lines` is, and how many the file has.
    pub(super) numbers: Vec<u32>,
    pub(super) linedefs: usize,
    /// Heights of floor and ceiling as the file has them, where they move too.
    pub(super) heights: Vec<[f64; 2]>,
    reject: Option<Pvs>,
}

/// Whether an action opens or moves the sector behind its own line (linuxdoom 1.10,
/// p_doors.c, EV_VerticalDoor).
fn is_door(action: u16) -> bool {
    matches!(action, 1 | 26 | 27 | 28 | 31..=34 | 117 | 118)
}

/// Whether an action moves nothing of the sectors with its tag: exits, teleporters,
/// lights, scrolling walls (linuxdoom 1.10, p_spec.c, p_switch.c).
fn is_still(action: u16) -> bool {
    matches!(
        action,
        0 | 11..=13 | 17 | 35 | 39 | 48 | 51 | 52 | 79..=81 | 97 | 104 | 124..=126 | 138 | 139
    )
}

/// Tags that the end of a boss moves.
const BOSS_TAGS: [u16; 2] = [666, 667];

impl DoomMap {
    /// The map that a scene was loaded from, if it was one.
    ///
    /// # Errors
    /// The map's file, read a second time.
    pub fn of_scene(scene: &Scene) -> Result<Option<Arc<DoomMap>>, InputError> {
        let file = MapFile::of(&scene.name)?;
        let map = file.map(|file| DoomMap::read(&file.bytes, &file.name, file.map.as_deref()));
        Ok(map.transpose()?.map(Arc::new))
    }

    /// Reads the named map of a WAD file, or its first.
    ///
    /// # Errors
    /// What [`WadMap::read`] finds wrong.
    pub fn read(bytes: &[u8], file: &str, map: Option<&str>) -> Result<DoomMap, InputError> {
        // All numbers of one lump in another are checked here.
        let scene = WadMap::read(bytes, file, map)?.into_scene(file)?;
        let lump = |name: &str| -> Result<&[u8], InputError> {
            Ok(map_lump(bytes, file, map, name)?.unwrap_or_default())
        };
        let word = |record: &[u8], at: usize| u16::from_le_bytes([record[at], record[at + 1]]);
        let height = |record: &[u8], at: usize| f64::from(word(record, at) as i16);
        let lines = lump("LINEDEFS")?;
        let (sides, vertices) = (lump("SIDEDEFS")?, lump("VERTEXES")?);
        let side = |number: u16| -> Option<RegionId> {
            let record = sides.chunks_exact(30).nth(number.into())?;
            (number != u16::MAX).then(|| word(record, 28).into())
        };
        let vertex = |number: u16| -> [i32; 2] {
            let record = &vertices[usize::from(number) * 4..][..4];
            [0, 2].map(|at| i32::from(word(record, at) as i16))
        };
        let both = |line: &[u8]| [side(word(line, 10)), side(word(line, 12))];

        let records = lump("SECTORS")?;
        let mut moves = vec![false; records.len() / 26];
        for line in lines.chunks_exact(14) {
            let (action, tag) = (word(line, 6), word(line, 8));
            if let (true, [_, Some(behind)]) = (is_door(action), both(line)) {
                moves[behind as usize] = true;
            }
            for (moves, sector) in moves.iter_mut().zip(records.chunks_exact(26)) {
                let tagged = tag != 0 && word(sector, 24) == tag && !is_still(action);
                *moves |= tagged || BOSS_TAGS.contains(&word(sector, 24));
            }
        }
        let sectors = records
            .chunks_exact(26)
            .zip(&moves)
            .map(|(r, moves)| match moves {
                true => Sector {
                    floor: -HIGHEST,
                    ceiling: HIGHEST,
                },
                false => Sector {
                    floor: height(r, 0),
                    ceiling: height(r, 2),
                },
            });
        let sectors: Vec<Sector> = sectors.collect();

        let line = |record: &[u8]| {
            let sectors_of = both(record);
            let open = match sectors_of {
                [Some(a), Some(b)] => {
                    let (a, b) = (&sectors[a as usize], &sectors[b as usize]);
                    let [low, high] = [a.floor.max(b.floor), a.ceiling.min(b.ceiling)];
                    (low < high).then_some([low, high])
                }
                _ => None,
            };
            MapLine {
                ends: [vertex(word(record, 0)), vertex(word(record, 2))],
                sectors: sectors_of,
                open,
            }
        };
        let all = (0..).zip(lines.chunks_exact(14).map(line));
        let all = all.filter(|(_, l)| l.ends[0] != l.ends[1]);
        let (numbers, map_lines): (Vec<u32>, Vec<MapLine>) = all.unzip();

        let mut parts = vec![Vec::new(); sectors.len()];
        let (segs, leaves) = (lump("SEGS")?, lump("SSECTORS")?);
        let boxes = scene.regions.boxes(&scene.items);
        for (leaf, b) in leaves.chunks_exact(4).zip(boxes) {
            let seg = &segs[usize::from(word(leaf, 2)) * 12..][..12];
            let line = &lines[usize::from(word(seg, 6)) * 14..][..14];
            if let Some(sector) = both(line)[usize::from(word(seg, 8) != 0)] {
                let (min, max) = b.in_world(scene.origin);
                let all_heights = DVec3::Z * (2.0 * HIGHEST);
                let part = WorldBox::new(min - all_heights, max + all_heights);
                parts[sector as usize].push(part);
            }
        }
        let reject = map_lump(bytes, file, map, "REJECT")?;
        // A table that is too short is taken as none, as engines do.
        let reject = reject.and_then(|bytes| Pvs::from_reject(bytes, sectors.len()).ok());
        Ok(DoomMap {
            lines: map_lines,
            sectors,
            parts,
            numbers,
            linedefs: lines.len() / 14,
            heights: records
                .chunks_exact(26)
                .map(|r| [0, 2].map(|at| height(r, at)))
                .collect(),
            reject,
        })
    }

    /// Lines and sectors alone, none of which moves.
    #[cfg(test)]
    pub(super) fn of_parts(lines: Vec<MapLine>, sectors: Vec<Sector>) -> DoomMap {
        DoomMap {
            parts: vec![Vec::new(); sectors.len()],
            numbers: (0..lines.len() as u32).collect(),
            linedefs: lines.len(),
            heights: sectors.iter().map(|s| [s.floor, s.ceiling]).collect(),
            reject: None,
            lines,
            sectors,
        }
    }

    /// The map's REJECT table: its claim of which sectors see each other.
    pub fn reject(&self) -> Option<&Pvs> {
        self.reject.as_ref()
    }
}
