//! A map as triangles: walls and things as the items of its scene.
//!
//! Floors and ceilings follow the items; they hide too.

use glam::Vec3;

use super::super::id_set::RegionId;
use super::map::DoomMap;
use super::plan::{self, Point};
use crate::scene::{Linedef, Scene, SurfaceKind, Surfaces};

/// A part of a linedef's wall: the side that it faces, lower and upper height.
type Part = (usize, [f64; 2]);

impl DoomMap {
    /// The map as triangles; `scene` is its scene, as [`WadMap::into_scene`] makes it.
    ///
    /// Items are those of the scene, by the same numbers: each linedef as its walls,
    /// seen from the side that they face, each thing as its box. A linedef of two sides
    /// has a lower part where floors differ and an upper one where ceilings do; what
    /// hangs between them (fences, bars) is left open. Things are sprites and hide
    /// nothing. An item lies within its box.
    ///
    /// Beyond the scene's items follows one for each sector, in file order: its floor,
    /// its ceiling, and the walls about it where it moves.
    ///
    /// What can move is open, as in [`DoomMap::graph`]: walls that end at a floor or
    /// ceiling which moves are seen where the file has them but hide nothing there
    /// (cut-outs); as far as they hide however it moves, they do as part of its
    /// sector's item. Such a sector has no floor and no ceiling. Heights alone decide:
    /// what is drawn as sky hides like any ceiling.
    ///
    /// A sector that its linedefs do not close, or of which they disagree where it is, has
    /// no floor and no ceiling either, which only makes more visible;
    /// [`DoomMap::unclosed`] lists them.
    ///
    /// # Panics
    /// If the scene has fewer items than the map has linedefs.
    ///
    /// [`WadMap::into_scene`]: crate::scene::WadMap::into_scene
    pub fn surfaces(&self, scene: &Scene) -> Surfaces {
        let things = &scene.items[self.file.lines.len()..];
        let mut all = Surfaces::about(scene.origin);
        let zero = scene.origin.as_vec3();
        let heights = |sector: RegionId| self.file.sectors[sector as usize].heights;
        for line in &self.file.lines {
            let mut shape = Shape::default();
            let has_length = line.ends[0] != line.ends[1];
            let moves = |sector: &RegionId| self.moves(*sector);
            let kind = match has_length && line.sectors.iter().flatten().any(moves) {
                true => SurfaceKind::CutOut,
                false => SurfaceKind::Opaque,
            };
            if has_length {
                parts(line, heights).for_each(|part| shape.wall(line, part));
            }
            shape.push(&mut all, kind, zero);
        }
        for thing in things {
            all.push_box(SurfaceKind::CutOut, false, thing);
        }
        for sector in 0..self.sectors.len() as RegionId {
            let mut shape = Shape::default();
            if self.moves(sector) {
                self.walls_about(sector, &mut shape);
            } else {
                let [floor, ceiling] = heights(sector);
                for corners in self.triangles(sector).unwrap_or_default() {
                    let [a, b, c] = corners;
                    shape.triangle([a, c, b], floor);
                    shape.triangle([a, b, c], ceiling);
                }
            }
            shape.push(&mut all, SurfaceKind::Opaque, zero);
        }
        all
    }

    /// Sectors that have no floor and no ceiling as surfaces, as it is not known where
    /// they are; ascending.
    pub fn unclosed(&self) -> Vec<RegionId> {
        let sectors = 0..self.sectors.len() as RegionId;
        sectors.filter(|&s| self.triangles(s).is_none()).collect()
    }

    /// The triangles of a sector, seen from above.
    ///
    /// `None` if its linedefs do not close or disagree with others about a part of it.
    pub(super) fn triangles(&self, sector: RegionId) -> Option<Vec<[Point; 3]>> {
        let mut disputed = self.disputes().iter().flat_map(|dispute| dispute.sectors);
        match disputed.any(|of| of == Some(sector)) {
            true => None,
            false => plan::triangles(&self.outline(sector)),
        }
    }

    /// Tests for a sector whose floor or ceiling may move.
    fn moves(&self, sector: RegionId) -> bool {
        let sector = sector as usize;
        self.sectors[sector] != self.file.sectors[sector].heights
    }

    /// The linedefs about a sector, which lies on the right of each.
    ///
    /// They are split at all of their ends.
    fn outline(&self, sector: RegionId) -> Vec<[[i32; 2]; 2]> {
        let mut edges = Vec::new();
        for Linedef { ends, sectors, .. } in &self.lines {
            let [front, behind] = sectors.map(|side| side == Some(sector));
            let [from, to] = *ends;
            match (front, behind) {
                (true, false) => edges.push([from, to]),
                (false, true) => edges.push([to, from]),
                _ => {}
            }
        }
        let ends: Vec<Point> = edges.iter().map(|[from, _]| *from).collect();
        edges
            .iter()
            .flat_map(|edge| plan::parted(*edge, &ends))
            .collect()
    }

    /// The walls of linedefs about a sector that moves, as far as they hide however it
    /// does; those between two such sectors belong to the lower number.
    fn walls_about(&self, sector: RegionId, shape: &mut Shape) {
        let open = |of: RegionId| self.sectors[of as usize];
        for line in &self.lines {
            let moving = line.sectors.iter().flatten().filter(|&&s| self.moves(s));
            if moving.min() == Some(&sector) {
                parts(line, open).for_each(|part| shape.wall(line, part));
            }
        }
    }
}

/// The parts of a linedef's wall between sectors of these heights.
fn parts(line: &Linedef, heights: impl Fn(RegionId) -> [f64; 2]) -> impl Iterator<Item = Part> {
    let parts = match line.sectors.map(|sector| sector.map(&heights)) {
        [Some(a), Some(b)] => {
            // The side of the lower floor sees the lower part, that of the higher
            // ceiling the upper one.
            let lower = (usize::from(b[0] < a[0]), [a[0].min(b[0]), a[0].max(b[0])]);
            let upper = (usize::from(b[1] > a[1]), [a[1].min(b[1]), a[1].max(b[1])]);
            [Some(lower), Some(upper)]
        }
        [front, behind] => {
            let side = usize::from(front.is_none());
            [front.or(behind).map(|heights| (side, heights)), None]
        }
    };
    let parts = parts.into_iter().flatten();
    parts.filter(|(_, [low, high])| low < high)
}

/// The triangles of an item in the making, map coordinates.
///
/// Whole numbers of 17 bits, exact in f32.
#[derive(Default)]
struct Shape {
    points: Vec<Vec3>,
    triangles: Vec<[u32; 3]>,
}

impl Shape {
    fn point(&mut self, [x, y]: [i32; 2], z: f64) -> u32 {
        self.points.push(Vec3::new(x as f32, y as f32, z as f32));
        self.points.len() as u32 - 1
    }

    fn wall(&mut self, line: &Linedef, (side, [low, high]): Part) {
        let [mut from, mut to] = line.ends;
        // Seen from the right, a linedef runs to the right.
        if side == 1 {
            (from, to) = (to, from);
        }
        let corners = [(from, low), (to, low), (to, high), (from, high)];
        let [a, b, c, d] = corners.map(|(at, z)| self.point(at, z));
        self.triangles.extend([[a, b, c], [a, c, d]]);
    }

    fn triangle(&mut self, corners: [[i32; 2]; 3], z: f64) {
        let corners = corners.map(|at| self.point(at, z));
        self.triangles.push(corners);
    }

    fn push(mut self, all: &mut Surfaces, kind: SurfaceKind, zero: Vec3) {
        self.points.iter_mut().for_each(|p| *p -= zero);
        all.push(kind, false, &self.points, &self.triangles);
    }
}
