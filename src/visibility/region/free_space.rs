//! Regions for any scene of boxes: the cells of a grid, joined by the faces that are
//! not wholly within one solid. Flooding from cell to cell tells which cells the eye
//! can see into at all.

use glam::DVec3;

use super::answer::RegionId;
use super::boxes::Boxes;
use super::graph::RegionGraph;
use super::locate::BoxGrid;
use super::opening::{Opening, OpeningPlane, rectangle};
use crate::scene::WorldBox;
use crate::visibility::Solids;

impl RegionGraph {
    /// About so many equal cells over the bounds of all solids, numbered along x, then
    /// y, then z. O(cells + solids * faces that each meets).
    ///
    /// A face is closed where it lies wholly in one solid, which a ray then has
    /// entered before: what only lies beyond is hidden. What touches the face from
    /// beyond, at the same depth, lies on this side too.
    pub fn of_free_space(solids: &Solids, cells: usize) -> RegionGraph {
        let WorldBox {
            min: low,
            max: high,
        } = WorldBox::union_of(solids.boxes.iter().copied());
        if !(low.is_finite() && high.is_finite()) {
            return RegionGraph::of_boxes(Vec::new(), Vec::new());
        }
        let size = (high - low).max(DVec3::splat(f64::MIN_POSITIVE));
        let edge = libm::cbrt(size.x * size.y * size.z / cells.max(1) as f64);
        let count = [0, 1, 2].map(|k| ((size[k] / edge).round() as usize).clamp(1, 1024));
        // The lines of the grid, the outermost those of the bounds.
        let lines = [0, 1, 2].map(|k| {
            let at = |i: usize| match i == count[k] {
                true => high[k],
                false => low[k] + (high[k] - low[k]) * (i as f64 / count[k] as f64),
            };
            (0..=count[k]).map(at).collect::<Vec<f64>>()
        });
        let corner = |i: [usize; 3]| DVec3::new(lines[0][i[0]], lines[1][i[1]], lines[2][i[2]]);
        let number = |i: [usize; 3]| ((i[2] * count[1] + i[1]) * count[0] + i[0]) as RegionId;
        let walls = BoxGrid::new(solids.boxes.clone());
        let (mut boxes, mut openings) = (Vec::new(), Vec::new());
        for z in 0..count[2] {
            for y in 0..count[1] {
                for x in 0..count[0] {
                    let here = [x, y, z];
                    let cell = WorldBox::new(corner(here), corner([x + 1, y + 1, z + 1]));
                    boxes.push(cell);
                    for axis in 0..3 {
                        if here[axis] == 0 {
                            continue;
                        }
                        let mut face = cell;
                        face.max[axis] = face.min[axis];
                        let mut closed = false;
                        walls.meeting(&face, |id| {
                            let wall = &walls.boxes()[id as usize];
                            let holds =
                                wall.min.cmple(face.min).all() && face.max.cmple(wall.max).all();
                            closed |= holds;
                        });
                        let mut before = here;
                        before[axis] -= 1;
                        if !closed {
                            openings.push(Opening {
                                sides: [number(here), number(before)],
                                corners: rectangle(axis, face.min, face.max),
                                plane: OpeningPlane::Axis {
                                    axis,
                                    at: face.min[axis],
                                },
                            });
                        }
                    }
                }
            }
        }
        let ground = Boxes {
            regions: BoxGrid::new(boxes),
            borders: BoxGrid::new(Vec::new()),
            solids: walls,
        };
        RegionGraph::over(ground, openings)
    }
}
