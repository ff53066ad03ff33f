//! Regions and the openings between them.

use std::sync::Arc;

use glam::DVec3;

use super::answer::{Marks, RegionId};
use super::locate::{BoxGrid, covers};
use super::opening::{Opening, OpeningPlane, rectangle};
use super::walk::follow_boxes;
use super::witness::{Rejected, Witness, check_boxes};
use crate::camera::Lens;
use crate::scene::{Regions, Scene, Tiling, WorldBox};
use crate::visibility::{Ray, Rays};

/// Finds the regions of a place.
pub trait Ground: Send + Sync + std::fmt::Debug {
    /// Appends the regions that a closed box meets (some perhaps twice); `false` if
    /// part of it may be in none.
    fn regions_at(&self, b: &WorldBox, out: &mut Vec<RegionId>) -> bool;

    /// Adds the regions that a ray passes before it meets what is opaque, by a
    /// search that shares nothing with the back ends.
    fn follow(&self, graph: &RegionGraph, ray: &Ray, seen: &mut Marks);

    /// Checks a line of sight exactly, by a walk that shares nothing with what finds
    /// such lines.
    ///
    /// # Errors
    /// What is wrong with it.
    fn check(&self, graph: &RegionGraph, witness: &Witness) -> Result<(), Rejected>;
}

/// Regions joined by openings: what one can see from one into another is seen
/// through openings.
#[derive(Clone, Debug)]
pub struct RegionGraph {
    /// Each region lies in the boxes of its range of `parts`.
    parts: Vec<WorldBox>,
    part_starts: Vec<u32>,
    openings: Vec<Opening>,
    exit_starts: Vec<u32>,
    exits: Vec<u32>,
    ground: Arc<dyn Ground>,
}

/// No regions are known of a scene.
#[derive(Clone, Copy, PartialEq, Eq, Debug, thiserror::Error)]
#[error("the scene has {0} as regions; expected a tiling of boxes with portals")]
pub struct NoRegions(pub &'static str);

/// A ground of boxes.
#[derive(Debug)]
pub(super) struct Boxes(pub(super) BoxGrid);

impl Ground for Boxes {
    fn regions_at(&self, b: &WorldBox, out: &mut Vec<RegionId>) -> bool {
        let first = out.len();
        self.0.meeting(b, |id| out.push(id));
        let boxes = self.0.boxes();
        let met: Vec<WorldBox> = out[first..].iter().map(|&id| boxes[id as usize]).collect();
        covers(&met, b)
    }

    fn follow(&self, graph: &RegionGraph, ray: &Ray, seen: &mut Marks) {
        let start = ray.at(ray.near);
        let mut homes = Vec::new();
        self.0
            .meeting(&WorldBox::new(start, start), |id| homes.push(id));
        for home in homes {
            follow_boxes(graph, home, ray, seen);
        }
    }

    fn check(&self, graph: &RegionGraph, witness: &Witness) -> Result<(), Rejected> {
        check_boxes(graph, witness)
    }
}

/// Boxes, and the solids that close their borders. A ray that begins in such a solid
/// is not hidden by it, and may go on in every region that the solid meets.
#[derive(Debug)]
struct Rooms {
    boxes: Boxes,
    borders: BoxGrid,
}

impl Ground for Rooms {
    fn regions_at(&self, b: &WorldBox, out: &mut Vec<RegionId>) -> bool {
        let inside = self.boxes.regions_at(b, out);
        self.borders.meeting(b, |solid| {
            let solid = &self.borders.boxes()[solid as usize];
            self.boxes.0.meeting(solid, |id| out.push(id));
        });
        inside
    }

    fn follow(&self, graph: &RegionGraph, ray: &Ray, seen: &mut Marks) {
        self.boxes.follow(graph, ray, seen);
    }

    fn check(&self, graph: &RegionGraph, witness: &Witness) -> Result<(), Rejected> {
        self.boxes.check(graph, witness)
    }
}

impl RegionGraph {
    /// Links regions, each with the boxes that hold it, by openings.
    pub fn new(
        regions: &[Vec<WorldBox>],
        openings: Vec<Opening>,
        ground: Arc<dyn Ground>,
    ) -> RegionGraph {
        let mut part_starts = vec![0];
        for parts in regions {
            part_starts.push(part_starts[part_starts.len() - 1] + parts.len() as u32);
        }
        let mut lists = vec![Vec::new(); regions.len()];
        for (i, opening) in (0u32..).zip(&openings) {
            for side in opening.sides {
                lists[side as usize].push(i);
            }
        }
        let mut exit_starts = vec![0];
        for list in &lists {
            exit_starts.push(exit_starts[exit_starts.len() - 1] + list.len() as u32);
        }
        RegionGraph {
            parts: regions.concat(),
            part_starts,
            openings,
            exit_starts,
            exits: lists.concat(),
            ground,
        }
    }

    /// Regions that are boxes themselves.
    pub fn of_boxes(boxes: Vec<WorldBox>, openings: Vec<Opening>) -> RegionGraph {
        let regions: Vec<Vec<WorldBox>> = boxes.iter().map(|b| vec![*b]).collect();
        RegionGraph::new(&regions, openings, Arc::new(Boxes(BoxGrid::new(boxes))))
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
                let boxes = BoxGrid::new(graph.parts.clone());
                // What is strictly within one box closes no border.
                let closes = |item: &WorldBox| {
                    let mut within = false;
                    boxes.meeting(item, |id| {
                        let b = &boxes.boxes()[id as usize];
                        within |= b.min.cmplt(item.min).all() && item.max.cmplt(b.max).all();
                    });
                    !within
                };
                let world = scene.items.iter().map(|item| {
                    let (min, max) = item.in_world(scene.origin);
                    WorldBox::new(min, max)
                });
                let borders = BoxGrid::new(world.filter(closes).collect());
                let boxes = Boxes(boxes);
                graph.ground = Arc::new(Rooms { boxes, borders });
                Ok(graph)
            }
            other => Err(NoRegions(other.kind())),
        }
    }

    /// The same for a tiling about an origin.
    pub fn of_tiling(tiling: &Tiling, origin: DVec3) -> RegionGraph {
        let world = |b: &crate::geometry::Aabb| {
            let (min, max) = b.in_world(origin);
            WorldBox::new(min, max)
        };
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

    /// Number of regions.
    pub fn len(&self) -> usize {
        self.exit_starts.len() - 1
    }

    /// Whether there are no regions.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// The boxes that together hold a region; one in most graphs.
    pub fn parts(&self, region: RegionId) -> &[WorldBox] {
        let at = region as usize;
        &self.parts[self.part_starts[at] as usize..self.part_starts[at + 1] as usize]
    }

    /// All openings; an exit is an index in this list.
    pub fn openings(&self) -> &[Opening] {
        &self.openings
    }

    /// The openings on a region's border.
    pub fn exits(&self, region: RegionId) -> &[u32] {
        let at = region as usize;
        &self.exits[self.exit_starts[at] as usize..self.exit_starts[at + 1] as usize]
    }

    /// Checks a line of sight between two regions, exactly.
    ///
    /// # Errors
    /// What is wrong with it.
    pub fn check_witness(&self, witness: &Witness) -> Result<(), Rejected> {
        self.ground.check(self, witness)
    }

    /// What finds the regions of a place.
    pub fn ground(&self) -> &dyn Ground {
        &*self.ground
    }

    /// The same graph without one of its openings: wrong on purpose, so that tests
    /// can see who notices.
    #[doc(hidden)]
    pub fn without_opening(&self, index: usize) -> RegionGraph {
        let mut openings = self.openings.clone();
        openings.remove(index);
        let regions: Vec<Vec<WorldBox>> = (0..self.len() as u32)
            .map(|r| self.parts(r).to_vec())
            .collect();
        RegionGraph::new(&regions, openings, self.ground.clone())
    }

    /// Replaces `homes` by the regions in which rays of the camera begin to see: all
    /// that are met by the box about the eye and the near window, as what is nearer
    /// than the near plane hides nothing. `false` if rays may begin in no region, or
    /// the lens is orthographic.
    pub fn homes(&self, rays: &Rays, homes: &mut Vec<RegionId>) -> bool {
        homes.clear();
        let lens = &rays.camera().lens;
        if matches!(lens, Lens::Orthographic { .. }) {
            return false;
        }
        let eye = rays.camera().frame.eye;
        let (mut low, mut high) = (eye, eye);
        for (x, y) in [(0.0, 0.0), (1.0, 0.0), (0.0, 1.0), (1.0, 1.0)] {
            let corner = rays.through(x, y).at(lens.near());
            (low, high) = (low.min(corner), high.max(corner));
        }
        // Corners are rounded, by less than this.
        let slack = (eye.abs() + (high - low)) * f64::EPSILON * 8.0;
        let inside = self
            .ground
            .regions_at(&WorldBox::new(low - slack, high + slack), homes);
        homes.sort_unstable();
        homes.dedup();
        inside
    }

    /// Replaces `out` by the regions that can be reached from one, ascending.
    pub fn component(&self, region: RegionId, out: &mut Vec<RegionId>) {
        let mut seen = vec![false; self.len()];
        seen[region as usize] = true;
        out.clear();
        out.push(region);
        let mut next = 0;
        while let Some(&at) = out.get(next) {
            next += 1;
            for &exit in self.exits(at) {
                let other = self.openings[exit as usize].other(at);
                if !std::mem::replace(&mut seen[other as usize], true) {
                    out.push(other);
                }
            }
        }
        out.sort_unstable();
    }
}
