//! Graphs of regions that are boxes: any boxes with openings, and the rooms of a scene.

use std::sync::Arc;

use glam::DVec3;

use super::graph::{Ground, RegionGraph};
use super::locate::{BoxGrid, covers};
use super::number::{Marks, RegionId};
use super::opening::{Opening, OpeningPlane, rectangle};
use super::walk::follow_boxes;
use crate::geometry::Aabb;
use crate::scene::{Regions, Scene, Tiling, WorldBox};
use crate::visibility::Ray;

/// No regions are known of a scene.
#[derive(Clone, Copy, PartialEq, Eq, Debug, thiserror::Error)]
#[error("the scene has {0} as regions; expected a tiling of boxes with portals")]
pub struct NoRegions(pub &'static str);

/// A ground of boxes, one a region.
#[derive(Debug)]
struct Boxes {
    regions: BoxGrid,
    /// Solids that close their borders. A ray that begins in such a solid is not hidden
    /// by it, and may go on in every region that the solid meets.
    borders: BoxGrid,
}

impl Boxes {
    fn alone(regions: Vec<WorldBox>) -> Boxes {
        Boxes {
            regions: BoxGrid::new(regions),
            borders: BoxGrid::new(Vec::new()),
        }
    }
}

impl Ground for Boxes {
    fn regions_at(&self, b: &WorldBox, out: &mut Vec<RegionId>) -> bool {
        let first = out.len();
        self.regions.meeting(b, |id| out.push(id));
        let boxes = self.regions.boxes();
        let met: Vec<WorldBox> = out[first..].iter().map(|&id| boxes[id as usize]).collect();
        let inside = covers(&met, b);
        self.borders.meeting(b, |solid| {
            let solid = &self.borders.boxes()[solid as usize];
            self.regions.meeting(solid, |id| out.push(id));
        });
        inside
    }

    fn follow(&self, graph: &RegionGraph, ray: &Ray, seen: &mut Marks) {
        let start = ray.at(ray.near);
        let mut homes = Vec::new();
        self.regions
            .meeting(&WorldBox::new(start, start), |id| homes.push(id));
        for home in homes {
            follow_boxes(graph, home, ray, seen);
        }
    }
}

/// What is strictly within one box closes no border.
fn is_within_one(boxes: &BoxGrid, item: &WorldBox) -> bool {
    let mut within = false;
    boxes.meeting(item, |id| {
        let b = &boxes.boxes()[id as usize];
        within |= b.min.cmplt(item.min).all() && item.max.cmplt(b.max).all();
    });
    within
}

impl RegionGraph {
    /// Regions that are boxes themselves.
    pub fn of_boxes(boxes: Vec<WorldBox>, openings: Vec<Opening>) -> RegionGraph {
        let regions: Vec<Vec<WorldBox>> = boxes.iter().map(|b| vec![*b]).collect();
        RegionGraph::new(&regions, openings, Arc::new(Boxes::alone(boxes)))
    }

    /// The regions of a scene that is a tiling of boxes whose borders, but for the
    /// openings, lie in solid items. An opening is as the tiling has it, flat: the wall
    /// about it has a thickness, so less is seen through it.
    ///
    /// # Errors
    /// A scene whose regions are not a tiling.
    pub fn of_scene(scene: &Scene) -> Result<RegionGraph, NoRegions> {
        match &scene.regions {
            Regions::Tiling(tiling) => {
                let mut graph = RegionGraph::of_tiling(tiling, scene.origin);
                let regions = BoxGrid::new(graph.parts.all.clone());
                let items = scene.items.iter();
                let world = items.map(|item| WorldBox::of(item, scene.origin));
                let borders = world.filter(|item| !is_within_one(&regions, item));
                graph.ground = Arc::new(Boxes {
                    borders: BoxGrid::new(borders.collect()),
                    regions,
                });
                Ok(graph)
            }
            other => Err(NoRegions(other.kind())),
        }
    }

    /// By item: whether it may close a border between regions; furniture does not.
    pub fn borders(&self, scene: &Scene) -> Vec<bool> {
        let boxes = BoxGrid::new(self.parts.all.clone());
        let closes = |item: &Aabb| !is_within_one(&boxes, &WorldBox::of(item, scene.origin));
        scene.items.iter().map(closes).collect()
    }

    /// The same for a tiling about an origin.
    pub fn of_tiling(tiling: &Tiling, origin: DVec3) -> RegionGraph {
        let world = |b: &Aabb| WorldBox::of(b, origin);
        let boxes: Vec<WorldBox> = tiling.boxes.iter().map(world).collect();
        let mut openings = Vec::with_capacity(tiling.portals.len());
        for portal in &tiling.portals {
            let hole = world(&portal.opening);
            let [a, b] = portal.between;
            let size = hole.max - hole.min;
            let flat = (0..3).find(|&axis| size[axis] == 0.0);
            // The front is the region that goes on to larger coordinates.
            let front = flat.and_then(|axis| {
                let (a, b) = (&boxes[a as usize], &boxes[b as usize]);
                let at = hole.min[axis];
                if a.min[axis] == at && b.max[axis] == at {
                    Some((axis, false))
                } else if b.min[axis] == at && a.max[axis] == at {
                    Some((axis, true))
                } else {
                    None
                }
            });
            if let Some((axis, swap)) = front {
                openings.push(Opening {
                    sides: if swap { [b, a] } else { [a, b] },
                    corners: rectangle(axis, hole.min, hole.max),
                    plane: OpeningPlane::Axis {
                        axis,
                        at: hole.min[axis],
                    },
                });
                continue;
            }
            // A line through a box passes one of its faces.
            for axis in 0..3 {
                for (from, to) in [(hole.min, hole.max), (hole.max, hole.min)] {
                    let (mut low, mut high) = (hole.min, hole.max);
                    (low[axis], high[axis]) = (from[axis], from[axis]);
                    openings.push(Opening {
                        sides: [a, b],
                        corners: rectangle(axis, low, high),
                        plane: OpeningPlane::Undirected,
                    });
                    if from[axis] == to[axis] {
                        break;
                    }
                }
            }
        }
        RegionGraph::of_boxes(boxes, openings)
    }
}
