//! A decoded map as visibility takes it: what is solid and what is open.

use std::sync::Arc;

use super::super::pvs::Pvs;
use crate::scene::{Dispute, Linedef, Regions, Scene, WadMap};

/// Height at which sectors that move end; map units fit 16 bits.
pub(super) const HIGHEST: f64 = 32768.0;

/// A Doom map with its moving sectors open.
#[derive(Clone, Debug)]
pub struct DoomMap {
    /// The map as decoded.
    pub(super) file: Arc<WadMap>,
    /// Linedefs, in file order, those of length zero left out.
    pub lines: Vec<Linedef>,
    /// Heights of floor and ceiling of each sector, in file order; beyond all others
    /// where the sector moves.
    pub sectors: Vec<[f64; 2]>,
}

/// Tests for an action that opens or moves the sector behind its own line.
///
/// After linuxdoom 1.10, p_doors.c, EV_VerticalDoor.
fn is_door(action: u16) -> bool {
    matches!(action, 1 | 26 | 27 | 28 | 31..=34 | 117 | 118)
}

/// Tests for an action that moves no sector with its tag.
///
/// Exits, teleporters, lights, scrolling walls (linuxdoom 1.10, p_spec.c, p_switch.c).
fn is_still(action: u16) -> bool {
    matches!(
        action,
        0 | 11..=13 | 17 | 35 | 39 | 48 | 51 | 52 | 79..=81 | 97 | 104 | 124..=126 | 138 | 139
    )
}

/// Tags of sectors that the death of a boss moves.
const BOSS_TAGS: [u16; 2] = [666, 667];

impl DoomMap {
    /// The map that a scene was loaded from, if it was one.
    pub fn of_scene(scene: &Scene) -> Option<Arc<DoomMap>> {
        match &scene.regions {
            Regions::Bsp(map) => Some(Arc::new(DoomMap::of(map.clone()))),
            _ => None,
        }
    }

    /// Finds the sectors that move. O(linedefs * sectors).
    pub fn of(file: Arc<WadMap>) -> DoomMap {
        let is_moved = |tag: u16, sector: u32| {
            let moves = |line: &Linedef| {
                let is_tagged = line.tag != 0 && line.tag == tag && !is_still(line.action);
                is_tagged || is_door(line.action) && line.sectors[1] == Some(sector)
            };
            BOSS_TAGS.contains(&tag) || file.lines.iter().any(moves)
        };
        let sectors = file.sectors.iter().zip(0..);
        let sectors = sectors.map(|(sector, id)| match is_moved(sector.tag, id) {
            true => [-HIGHEST, HIGHEST],
            false => sector.heights,
        });
        let lines = file
            .lines
            .iter()
            .filter(|line| line.ends[0] != line.ends[1]);
        DoomMap {
            lines: lines.copied().collect(),
            sectors: sectors.collect(),
            file: file.clone(),
        }
    }

    /// Lowest and highest height that a linedef lets through; `None` where it is solid.
    pub fn opening(&self, line: &Linedef) -> Option<[f64; 2]> {
        let [Some(a), Some(b)] = line.sectors else {
            return None;
        };
        let [a, b] = [a, b].map(|sector| self.sectors[sector as usize]);
        let (low, high) = (a[0].max(b[0]), a[1].min(b[1]));
        (low < high).then_some([low, high])
    }

    /// The map's REJECT table: its claim of which sectors see each other. A table that
    /// is too short counts as none, as in engines.
    pub fn reject(&self) -> Option<Pvs> {
        Pvs::from_reject(&self.file.reject, self.sectors.len()).ok()
    }

    /// Places about which its linedefs disagree, by the sectors that they have there.
    pub fn disputes(&self) -> &[Dispute] {
        self.file.disputes()
    }
}
