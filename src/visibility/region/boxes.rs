//! Region graphs of boxes, such as the rooms of a scene.
//!
//! Solids close the regions' borders.

use std::sync::Arc;

use glam::DVec3;

use super::box_grid::{BoxGrid, covers};
use super::graph::{Opening, OpeningPlane, RegionGraph, RegionId, RegionLocator, rectangle};
use crate::geometry::Aabb;
use crate::scene::{Regions, Scene, Tiling, WorldBox};

/// Region locator for graphs with one box per region.
#[derive(Debug)]
struct BoxLocator {
    regions: BoxGrid,
    /// Solids that close the regions' borders.
    ///
    /// A ray that starts inside such a solid is not hidden by it, and may continue in every region
    /// that the solid meets.
    borders: BoxGrid,
}

impl RegionLocator for BoxLocator {
    fn regions_at(&self, b: &WorldBox, out: &mut Vec<RegionId>) -> bool {
        let first = out.len();
        self.regions.meeting(b, |id| out.push(id));
        let boxes = &self.regions.boxes;
        let met: Vec<WorldBox> = out[first..].iter().map(|&id| boxes[id as usize]).collect();
        let inside = covers(&met, b);
        self.borders.meeting(b, |solid| {
            let solid = &self.borders.boxes[solid as usize];
            self.regions.meeting(solid, |id| out.push(id));
        });
        inside
    }

    /// Appends none: each region equals its part.
    fn more_at(&self, _: &WorldBox, _: &mut Vec<RegionId>) {}
}

impl RegionGraph {
    /// Graph whose regions are boxes.
    pub fn of_boxes(boxes: Vec<WorldBox>, openings: Vec<Opening>) -> RegionGraph {
        let regions: Vec<Vec<WorldBox>> = boxes.iter().map(|b| vec![*b]).collect();
        let locator = BoxLocator {
            regions: BoxGrid::new(boxes),
            borders: BoxGrid::new(Vec::new()),
        };
        RegionGraph::new(regions, openings, Arc::new(locator))
    }

    /// Regions of a scene that is a tiling of boxes.
    ///
    /// Except for the openings, the boxes' borders must lie in solid items. An opening is flat, as
    /// in the tiling; the wall around it has a thickness, so less is seen through it than the graph
    /// allows.
    ///
    /// `None` for a scene whose regions are not a tiling.
    pub fn of_scene(scene: &Scene) -> Option<RegionGraph> {
        let Regions::Tiling(tiling) = &scene.regions else {
            return None;
        };
        let mut graph = RegionGraph::of_tiling(tiling, scene.origin);
        let borders = graph.borders(scene).into_iter().zip(&scene.items);
        let borders = borders.filter_map(|(is_border, item)| is_border.then_some(item));
        let borders = borders.map(|item| WorldBox::of(item, scene.origin));
        graph.locator = Arc::new(BoxLocator {
            borders: BoxGrid::new(borders.collect()),
            regions: BoxGrid::new(graph.parts.concat()),
        });
        Some(graph)
    }

    /// Tests each item for being a possible border between regions.
    ///
    /// Furniture, which is strictly inside one box, is no border.
    pub fn borders(&self, scene: &Scene) -> Vec<bool> {
        let boxes = BoxGrid::new(self.parts.concat());
        let is_border = |item: &Aabb| {
            let (item, mut is_within) = (WorldBox::of(item, scene.origin), false);
            boxes.meeting(&item, |id| {
                let b = &boxes.boxes[id as usize];
                is_within |= b.min.cmplt(item.min).all() && item.max.cmplt(b.max).all();
            });
            !is_within
        };
        scene.items.iter().map(is_border).collect()
    }

    /// Rooms of a tiling whose coordinates are relative to `origin`.
    pub fn of_tiling(tiling: &Tiling, origin: DVec3) -> RegionGraph {
        let world = |b: &Aabb| WorldBox::of(b, origin);
        let boxes: Vec<WorldBox> = tiling.boxes.iter().map(world).collect();
        let openings = tiling.portals.iter().flat_map(|portal| {
            let hole = world(&portal.opening);
            match flat(&boxes, portal.between, &hole) {
                Some(opening) => vec![opening],
                None => thick(portal.between, &hole),
            }
        });
        let openings = openings.collect();
        RegionGraph::of_boxes(boxes, openings)
    }
}

/// Opening for a flat hole in the common border of two boxes; else `None`.
fn flat(boxes: &[WorldBox], [a, b]: [RegionId; 2], hole: &WorldBox) -> Option<Opening> {
    let axis = (0..3).find(|&axis| hole.min[axis] == hole.max[axis])?;
    let at = hole.min[axis];
    // The front region extends to larger coordinates.
    let is_front = |&[front, behind]: &[RegionId; 2]| {
        boxes[front as usize].min[axis] == at && boxes[behind as usize].max[axis] == at
    };
    Some(Opening {
        sides: [[a, b], [b, a]].into_iter().find(is_front)?,
        corners: rectangle(axis, hole.min, hole.max),
        plane: OpeningPlane::Axis { axis, at },
    })
}

/// Faces of a hole with a thickness: a line through the hole crosses one of them.
fn thick(sides: [RegionId; 2], hole: &WorldBox) -> Vec<Opening> {
    let faces = (0..3).flat_map(|axis| {
        let mut ends = vec![hole.min[axis], hole.max[axis]];
        ends.dedup();
        ends.into_iter().map(move |at| (axis, at))
    });
    let opening = |(axis, at): (usize, f64)| {
        let (mut low, mut high) = (hole.min, hole.max);
        (low[axis], high[axis]) = (at, at);
        Opening {
            sides,
            corners: rectangle(axis, low, high),
            plane: OpeningPlane::Undirected,
        }
    };
    faces.map(opening).collect()
}
