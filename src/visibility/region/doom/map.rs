//! The lumps of a map, as far as they say what is solid and what is open.

use std::sync::Arc;

use glam::DVec3;

use super::super::answer::RegionId;
use super::super::pvs::Pvs;
use crate::input::InputError;
use crate::scene::{Dispute, Linedef, Scene, WadMap, WorldBox, disputes};
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
    /// Places about which its linedefs disagree.
    disputes: Vec<Dispute>,
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

fn disputed(lines: &[MapLine]) -> Vec<Dispute> {
    disputes(lines.iter().map(|line| (line.ends, line.sectors)))
}

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
        Ok(DoomMap::of(&WadMap::read(bytes, file, map)?))
    }

    /// What a decoded map says.
    fn of(map: &WadMap) -> DoomMap {
        let mut moves = vec![false; map.sectors.len()];
        for line in &map.lines {
            if let (true, [_, Some(behind)]) = (is_door(line.action), line.sectors) {
                moves[behind as usize] = true;
            }
            for (moves, sector) in moves.iter_mut().zip(&map.sectors) {
                let tagged = line.tag != 0 && sector.tag == line.tag && !is_still(line.action);
                *moves |= tagged || BOSS_TAGS.contains(&sector.tag);
            }
        }
        let sectors = map.sectors.iter().zip(&moves);
        let sectors = sectors.map(|(sector, moves)| match (moves, sector.heights) {
            (true, _) => Sector {
                floor: -HIGHEST,
                ceiling: HIGHEST,
            },
            (false, [floor, ceiling]) => Sector { floor, ceiling },
        });
        let sectors: Vec<Sector> = sectors.collect();

        let line = |line: &Linedef| {
            let open = match line.sectors {
                [Some(a), Some(b)] => {
                    let (a, b) = (&sectors[a as usize], &sectors[b as usize]);
                    let [low, high] = [a.floor.max(b.floor), a.ceiling.min(b.ceiling)];
                    (low < high).then_some([low, high])
                }
                _ => None,
            };
            MapLine {
                ends: line.ends,
                sectors: line.sectors,
                open,
            }
        };
        let all = (0..).zip(map.lines.iter().map(line));
        let all = all.filter(|(_, l)| l.ends[0] != l.ends[1]);
        let (numbers, lines): (Vec<u32>, Vec<MapLine>) = all.unzip();

        let mut parts = vec![Vec::new(); sectors.len()];
        for (&sector, b) in map.leaf_sectors.iter().zip(map.leaf_boxes()) {
            let all_heights = DVec3::Z * (2.0 * HIGHEST);
            let (min, max) = (b.min.as_dvec3(), b.max.as_dvec3());
            parts[sector as usize].push(WorldBox::new(min - all_heights, max + all_heights));
        }
        DoomMap {
            disputes: disputed(&lines),
            lines,
            parts,
            numbers,
            linedefs: map.lines.len(),
            heights: map.sectors.iter().map(|sector| sector.heights).collect(),
            // A table that is too short is taken as none, as engines do.
            reject: Pvs::from_reject(&map.reject, sectors.len()).ok(),
            sectors,
        }
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
            disputes: disputed(&lines),
            lines,
            sectors,
        }
    }

    /// The map's REJECT table: its claim of which sectors see each other.
    pub fn reject(&self) -> Option<&Pvs> {
        self.reject.as_ref()
    }

    /// Places about which its linedefs disagree, by the sectors that they have there.
    pub fn disputes(&self) -> &[Dispute] {
        &self.disputes
    }
}
