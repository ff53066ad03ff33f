//! Regions and the openings between them.

use std::sync::Arc;

use glam::{DVec2, DVec3};

use crate::scene::WorldBox;
use crate::visibility::Rays;

/// Id of a region: its index in the graph.
pub type RegionId = u32;

/// Locator of the regions at a box.
pub trait RegionLocator: Send + Sync + std::fmt::Debug {
    /// Appends the regions that a closed box meets, some perhaps twice.
    ///
    /// Returns `false` if part of the box may be in no region.
    fn regions_at(&self, b: &WorldBox, out: &mut Vec<RegionId>) -> bool;

    /// Appends the regions that a closed box meets outside of their parts.
    ///
    /// The default appends all regions that it meets, for graphs whose regions differ from their
    /// parts or have none.
    fn more_at(&self, b: &WorldBox, out: &mut Vec<RegionId>) {
        self.regions_at(b, out);
    }
}

/// Graph of regions and openings; lines of sight cross regions only there.
#[derive(Clone, Debug)]
pub struct RegionGraph {
    /// Boxes whose union contains each region; one in most graphs.
    pub(super) parts: Vec<Vec<WorldBox>>,
    /// All openings; an exit is an index into this list.
    pub openings: Vec<Opening>,
    /// Openings on the border of each region.
    pub exits: Vec<Vec<u32>>,
    pub(super) locator: Arc<dyn RegionLocator>,
}

impl RegionGraph {
    /// Links regions by openings; `parts` are the boxes that contain each region.
    pub fn new(
        parts: Vec<Vec<WorldBox>>,
        openings: Vec<Opening>,
        locator: Arc<dyn RegionLocator>,
    ) -> RegionGraph {
        let mut exits = vec![Vec::new(); parts.len()];
        for (i, opening) in (0u32..).zip(&openings) {
            for side in opening.sides {
                exits[side as usize].push(i);
            }
        }
        RegionGraph {
            parts,
            openings,
            exits,
            locator,
        }
    }

    /// Number of regions.
    #[allow(clippy::len_without_is_empty)] // No caller needs `is_empty`.
    pub fn len(&self) -> usize {
        self.exits.len()
    }

    /// Replaces `homes` by the regions in which rays of the camera may start.
    ///
    /// These are all regions that meet the bounds of the eye and the near window, as nothing hides
    /// before the near plane. Returns `false` if rays may start in no region, or the lens is
    /// orthographic.
    pub fn homes(&self, rays: &Rays, homes: &mut Vec<RegionId>) -> bool {
        homes.clear();
        if rays.camera.lens.is_orthographic() {
            return false;
        }
        let eye = rays.camera.frame.eye;
        let corners = rays.near_corners().into_iter().chain([eye]);
        let WorldBox { min, max } = WorldBox::union_of(corners.map(WorldBox::at));
        // Bound of the rounding of the corners.
        let slack = (eye.abs() + (max - min)) * f64::EPSILON * 8.0;
        let about = WorldBox::new(min - slack, max + slack);
        let inside = self.locator.regions_at(&about, homes);
        homes.sort_unstable();
        homes.dedup();
        inside
    }
}

/// Plane of an opening, with its front side.
#[derive(Clone, Copy, PartialEq, Debug)]
pub enum OpeningPlane {
    /// Perpendicular to an axis; the front has the larger coordinates.
    Axis {
        /// 0, 1 or 2.
        axis: usize,
        /// Coordinate on the axis, world units.
        at: f64,
    },
    /// Vertical, over the line between two points; the front is right of the line.
    Upright {
        /// Start of the line, seen from above.
        from: DVec2,
        /// End of the line.
        to: DVec2,
    },
    /// One face of an opening that has a thickness: crossed in both directions.
    Undirected,
}

/// Orientation of point `c` to the line from `a` through `b`.
///
/// 1 for the left, -1 for the right, 0 if rounding hides it (Shewchuk 1997, "Adaptive precision
/// floating-point arithmetic", section 4.2: the bound is the first stage of its orient2d).
fn turn(a: DVec2, b: DVec2, c: DVec2) -> i32 {
    const BOUND: f64 = 4.0 / (1u64 << 53) as f64;
    let (left, right) = ((a.x - c.x) * (b.y - c.y), (a.y - c.y) * (b.x - c.x));
    let determinant = left - right;
    let bound = BOUND * (left.abs() + right.abs()) + f64::MIN_POSITIVE;
    i32::from(determinant > bound) - i32::from(determinant < -bound)
}

/// Opening (portal) between two regions: a flat rectangle in world coordinates.
///
/// It is vertical or horizontal.
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct Opening {
    /// Region in front of it and region behind it.
    pub sides: [RegionId; 2],
    /// Corners of the closed rectangle, in order around it.
    pub corners: [DVec3; 4],
    /// Plane of the rectangle.
    pub plane: OpeningPlane,
}

impl Opening {
    /// Certain side of the plane that a point is on.
    ///
    /// 1 in front, -1 behind, 0 on it or too close to decide.
    pub fn side(&self, p: DVec3) -> i32 {
        match self.plane {
            OpeningPlane::Axis { axis, at } => i32::from(p[axis] > at) - i32::from(p[axis] < at),
            OpeningPlane::Upright { from, to } => -turn(from, to, p.truncate()),
            OpeningPlane::Undirected => 0,
        }
    }

    /// Region that a line of sight from `eye` enters from `region` through the opening.
    ///
    /// `None` if it can only pass the other way.
    pub fn entered(&self, region: RegionId, eye: DVec3) -> Option<RegionId> {
        let [front, behind] = self.sides;
        let side = self.side(eye);
        match (region == front, region == behind) {
            (true, _) if side >= 0 => Some(behind),
            (_, true) if side <= 0 => Some(front),
            _ => None,
        }
    }
}

/// Corners of a flat rectangle perpendicular to an axis, in order around it.
pub fn rectangle(axis: usize, min: DVec3, max: DVec3) -> [DVec3; 4] {
    let next = (axis + 1) % 3;
    let mut corners = [min, min, max, max];
    corners[1][next] = max[next];
    corners[3][next] = min[next];
    corners
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_opening_is_passed_away_from_the_eye() {
        let (min, max) = (DVec3::new(4.0, 0.0, 0.0), DVec3::new(4.0, 1.0, 2.0));
        let across = Opening {
            sides: [7, 3],
            corners: rectangle(0, min, max),
            plane: OpeningPlane::Axis { axis: 0, at: 4.0 },
        };
        let upright = Opening {
            plane: OpeningPlane::Upright {
                from: DVec2::new(4.0, 0.0),
                to: DVec2::new(4.0, 1.0),
            },
            ..across
        };
        for opening in [across, upright] {
            let (high, low) = (DVec3::splat(9.0), DVec3::splat(-9.0));
            assert_eq!(opening.entered(7, high), Some(3));
            assert_eq!(opening.entered(3, high), None);
            assert_eq!(opening.entered(3, low), Some(7));
            assert_eq!(opening.entered(7, low), None);
            assert_eq!(opening.entered(5, low), None);
            // A point on the plane sees both regions.
            assert_eq!(opening.entered(7, min), Some(3));
            assert_eq!(opening.entered(3, min), Some(7));
        }
        let ring = across.corners;
        for i in 0..4 {
            let edge = ring[(i + 1) % 4] - ring[i];
            assert_eq!(edge.to_array().iter().filter(|e| **e != 0.0).count(), 1);
        }
    }
}
