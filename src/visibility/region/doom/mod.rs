//! Doom maps: sectors as regions, two-sided linedefs as openings.
//!
//! One-sided linedefs are solid, and so are those between sectors whose heights leave no opening.
//! Sectors that a linedef's action moves count as open at any height. For the eye, floors and
//! ceilings are opaque.
//!
//! This is the world of the game. If items are treated as solid boxes, rays pass over and under
//! them, as floors and ceilings are not items; there is no guarantee for items that such a ray
//! meets beyond a ceiling.
//!
//! [`DoomMap::surfaces`] is the same map as triangles, with floors and ceilings;
//! [`DoomMap::solid_boxes`] are boxes in the solid space that these enclose.

mod solid;
mod surfaces;

use std::collections::HashSet;
use std::sync::Arc;

use glam::{DVec2, DVec3};

use super::back_ends::Pvs;
use super::box_grid::BoxGrid;
use super::graph::{Opening, OpeningPlane, RegionGraph, RegionId, RegionLocator};
use crate::scene::{Dispute, Linedef, Regions, Scene, WadMap, WorldBox};

pub use surfaces::surfaces_of;

/// Height bound of sectors that move; map units fit 16 bits.
const HIGHEST: f64 = 32768.0;

/// Doom map with its moving sectors open.
#[derive(Clone, Debug)]
pub struct DoomMap {
    /// Map as decoded.
    file: Arc<WadMap>,
    /// Linedefs in file order, without those of length zero.
    pub lines: Vec<Linedef>,
    /// Heights of floor and ceiling of each sector, in file order.
    ///
    /// If the sector moves, they lie beyond all other heights.
    pub sectors: Vec<[f64; 2]>,
    /// Linedefs around each sector, directed so that the sector is on their right.
    edges: Vec<Vec<[[i32; 2]; 2]>>,
}

/// Tests for an action that opens or moves the sector behind its own line.
///
/// After linuxdoom 1.10, p_doors.c, EV_VerticalDoor.
fn is_door(action: u16) -> bool {
    // Boom's generalized actions (boomref.txt, section 14): 6 and 7 are pushed.
    let is_pushed = (0x2F80..0x8000).contains(&action) && action & 6 == 6;
    matches!(action, 1 | 26 | 27 | 28 | 31..=34 | 117 | 118) || is_pushed
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

/// Tags of sectors that move when a boss dies.
const BOSS_TAGS: [u16; 2] = [666, 667];

impl DoomMap {
    /// Map that a scene was loaded from, if it was loaded from one.
    pub fn of_scene(scene: &Scene) -> Option<Arc<DoomMap>> {
        match &scene.regions {
            Regions::Bsp(map) => Some(Arc::new(DoomMap::of(map.clone()))),
            _ => None,
        }
    }

    /// Finds the sectors that move and the linedefs of each. O(linedefs + sectors).
    pub fn of(file: Arc<WadMap>) -> DoomMap {
        let acts = |line: &&Linedef| line.tag != 0 && !is_still(line.action);
        let tags = file.lines.iter().filter(acts).map(|line| line.tag);
        let tags: HashSet<u16> = tags.chain(BOSS_TAGS).collect();
        let doors = file.lines.iter().filter(|line| is_door(line.action));
        let doors: HashSet<u32> = doors.filter_map(|line| line.sectors[1]).collect();
        let is_moved = |tag: &u16, sector: &u32| tags.contains(tag) || doors.contains(sector);
        let sectors = file.sectors.iter().zip(0..);
        let sectors = sectors.map(|(sector, id)| match is_moved(&sector.tag, &id) {
            true => [-HIGHEST, HIGHEST],
            false => sector.heights,
        });
        let has_length = |line: &&Linedef| line.ends[0] != line.ends[1];
        let lines: Vec<Linedef> = file.lines.iter().filter(has_length).copied().collect();
        let mut edges = vec![Vec::new(); file.sectors.len()];
        let borders = |line: &&Linedef| line.sectors[0] != line.sectors[1];
        for line in lines.iter().filter(borders) {
            let ([front, behind], [from, to]) = (line.sectors, line.ends);
            for (sector, edge) in [(front, [from, to]), (behind, [to, from])] {
                if let Some(sector) = sector {
                    edges[sector as usize].push(edge);
                }
            }
        }
        DoomMap {
            lines,
            edges,
            sectors: sectors.collect(),
            file: file.clone(),
        }
    }

    /// Lowest and highest height that a linedef leaves open; `None` if it is solid.
    pub fn opening(&self, line: &Linedef) -> Option<[f64; 2]> {
        let sides = [line.sectors[0]?, line.sectors[1]?];
        let [a, b] = sides.map(|sector| self.sectors[sector as usize]);
        let (low, high) = (a[0].max(b[0]), a[1].min(b[1]));
        (low < high).then_some([low, high])
    }

    /// The map's REJECT table: pairs of sectors that see each other.
    ///
    /// `None` if the table is too short, as in engines. The table is a claim, not a proof.
    pub fn reject(&self) -> Option<Pvs> {
        Pvs::from_reject(&self.file.reject, self.sectors.len())
    }

    /// Graph with sectors as regions and open linedefs as openings.
    ///
    /// A sector's parts have unlimited height.
    ///
    /// # Errors
    /// A place about which linedefs disagree: its openings are unknown.
    pub fn graph(self: &Arc<Self>) -> Result<RegionGraph, Dispute> {
        if let Some(dispute) = self.file.disputes().first() {
            return Err(*dispute);
        }
        let opening = |line: &Linedef| {
            let [low, high] = self.opening(line)?;
            let [front, behind] = [line.sectors[0]?, line.sectors[1]?];
            let [from, to] = line.ends.map(plan);
            let corners = [(from, low), (to, low), (to, high), (from, high)];
            let corners = corners.map(|(at, z)| at.extend(z));
            (front != behind).then_some(Opening {
                sides: [front, behind],
                corners,
                plane: OpeningPlane::Upright { from, to },
            })
        };
        let openings = self.lines.iter().filter_map(opening).collect();
        // Boxes of the leaves of the map's own tree, of unlimited height.
        let all_heights = DVec3::Z * (2.0 * HIGHEST);
        let mut parts = vec![Vec::new(); self.sectors.len()];
        for (&sector, b) in self.file.leaf_sectors.iter().zip(&self.file.tree.boxes) {
            let (min, max) = (b.min.as_dvec3(), b.max.as_dvec3());
            parts[sector as usize].push(WorldBox::new(min - all_heights, max + all_heights));
        }
        let locator = Arc::new(SectorLocator::new(self.clone()));
        Ok(RegionGraph::new(parts, openings, locator))
    }
}

/// Region locator of a map.
#[derive(Debug)]
struct SectorLocator {
    map: Arc<DoomMap>,
    /// Boxes of its linedefs, at height zero.
    lines: BoxGrid,
}

fn plan([x, y]: [i32; 2]) -> DVec2 {
    DVec2::new(x.into(), y.into())
}

impl SectorLocator {
    fn new(map: Arc<DoomMap>) -> SectorLocator {
        let end = |end| WorldBox::at(plan(end).extend(0.0));
        let about = |line: &Linedef| WorldBox::union_of(line.ends.map(end));
        let lines = BoxGrid::new(map.lines.iter().map(about).collect());
        SectorLocator { map, lines }
    }

    /// Sector at a point: the near side of the first linedef towards larger x.
    ///
    /// The ray runs slightly above the point; among coincident linedefs the first in file order
    /// counts.
    fn sector_at(&self, mut p: DVec2) -> Option<RegionId> {
        // Vertices have integer y: y is snapped, so that rounding misses none.
        if (p.y - p.y.round()).abs() < 1e-9 {
            p.y = p.y.round();
        }
        let ahead = WorldBox::new(p.extend(0.0), DVec3::new(f64::INFINITY, p.y, 0.0));
        let (mut nearest, mut found) = ((f64::INFINITY, 0.0, 0), None);
        self.lines.meeting(&ahead, |id| {
            let line = &self.map.lines[id as usize];
            let [a, b] = line.ends.map(plan);
            let slope = (b.x - a.x) / (b.y - a.y);
            let x = a.x + (b.x - a.x) * ((p.y - a.y) / (b.y - a.y));
            let is_crossed = (a.y <= p.y) != (b.y <= p.y);
            // At a common vertex, the line of least slope is the first above it.
            if is_crossed && x >= p.x && (x, slope, id) < nearest {
                // The left of a line that goes up is the side of smaller x.
                (nearest, found) = ((x, slope, id), line.sectors[usize::from(b.y > a.y)]);
            }
        });
        found
    }
}

/// Tests in plan view whether a linedef may meet a closed box.
///
/// Their bounding boxes are known to meet.
fn meets(line: &Linedef, b: &WorldBox) -> bool {
    let [from, to] = line.ends.map(plan);
    let (low, high) = (b.min.truncate(), b.max.truncate());
    let d = to - from;
    let side = |x: f64, y: f64| d.x * (y - from.y) - d.y * (x - from.x);
    let sides = [low.x, high.x].map(|x| [low.y, high.y].map(|y| side(x, y)));
    let sides = sides.as_flattened();
    // Bound of the rounding of a side: |d| and distances are below 2^18.
    let slack = 1e-4;
    sides.iter().any(|s| *s <= slack) && sides.iter().any(|s| *s >= -slack)
}

/// Leaves of the map's tree differ from its sectors by a node builder's rounding.
impl RegionLocator for SectorLocator {
    fn regions_at(&self, b: &WorldBox, out: &mut Vec<RegionId>) -> bool {
        let mut inside = true;
        let first = out.len();
        let level = WorldBox::new(b.min.with_z(0.0), b.max.with_z(0.0));
        self.lines.meeting(&level, |id| {
            let line = &self.map.lines[id as usize];
            if meets(line, b) {
                inside &= line.sectors[1].is_some();
                out.extend(line.sectors.iter().flatten());
            }
        });
        let sector = self.sector_at((b.min + b.max).truncate() * 0.5);
        inside &= sector.is_some();
        out.extend(sector);
        // Below a floor or above a ceiling there is no region.
        inside
            && out[first..].iter().all(|&sector| {
                let [floor, ceiling] = self.map.sectors[sector as usize];
                floor <= b.min.z && b.max.z <= ceiling
            })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::load;
    use std::collections::BTreeSet;

    /// Rooms have their corners, and eyes stand, at integer y.
    #[test]
    fn the_sector_at_the_height_of_a_vertex_is_that_of_a_point_beside_it() {
        for (name, least) in [("freedm-map12", 2000), ("freedm-map20", 10_000)] {
            let map = DoomMap::of_scene(&load(name, &Default::default()).unwrap()).unwrap();
            let locator = SectorLocator::new(map.clone());
            let ends = map.lines.iter().flat_map(|line| line.ends);
            let (heights, places): (BTreeSet<i32>, BTreeSet<i32>) =
                ends.map(|[x, y]| (y, x / 32)).unzip();
            let mut checked = 0;
            for &y in &heights {
                for x in places.iter().map(|x| x * 32) {
                    let p = plan([x, y]);
                    let about = WorldBox::new((p - 0.01).extend(0.0), (p + 0.01).extend(0.0));
                    let mut is_clear = true;
                    let all = |id| is_clear &= !meets(&map.lines[id as usize], &about);
                    locator.lines.meeting(&about, all);
                    if is_clear {
                        let beside = locator.sector_at(p + DVec2::Y * 0.01);
                        assert_eq!(locator.sector_at(p), beside, "{name} {p}");
                        let near = locator.sector_at(p + DVec2::Y * 6e-17);
                        assert_eq!(near, beside, "{name} {p}");
                        checked += 1;
                    }
                }
            }
            assert!(checked > least, "{name}: {checked}");
        }
    }

    #[test]
    fn pushed_doors_of_boom_move_the_sector_behind_their_line() {
        assert!([1, 0x3C06, 0x3C07].into_iter().all(is_door));
        assert!(![0, 141, 0x3C05, 0x8007].into_iter().any(is_door));
    }
}
