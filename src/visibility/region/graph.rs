//! Regions and the openings between them.

use std::sync::Arc;

use super::csr::Csr;
use super::id_set::{IdSet, RegionId};
use super::opening::Opening;
use crate::scene::WorldBox;
use crate::visibility::{Ray, Rays};

/// Finds the regions of a place.
pub trait Ground: Send + Sync + std::fmt::Debug {
    /// Appends the regions that a closed box meets (some perhaps twice); `false` if
    /// part of it may be in none.
    fn regions_at(&self, b: &WorldBox, out: &mut Vec<RegionId>) -> bool;

    /// Appends regions that a closed box meets outside of their parts.
    ///
    /// None unless regions differ from their parts.
    fn more_at(&self, _: &WorldBox, _: &mut Vec<RegionId>) {}

    /// Adds the regions that a ray passes before it meets what is opaque, by a
    /// search that shares nothing with the back ends.
    fn follow(&self, graph: &RegionGraph, ray: &Ray, seen: &mut IdSet);
}

/// Regions joined by openings: sight leads from one to another through these only.
#[derive(Clone, Debug)]
pub struct RegionGraph {
    /// The boxes that each region lies in.
    pub(super) parts: Csr<WorldBox>,
    openings: Vec<Opening>,
    exits: Csr<u32>,
    pub(super) ground: Arc<dyn Ground>,
}

impl RegionGraph {
    /// Links regions, each with the boxes that hold it, by openings.
    pub fn new(
        regions: &[Vec<WorldBox>],
        openings: Vec<Opening>,
        ground: Arc<dyn Ground>,
    ) -> RegionGraph {
        let mut exits = vec![Vec::new(); regions.len()];
        for (i, opening) in (0u32..).zip(&openings) {
            for side in opening.sides {
                exits[side as usize].push(i);
            }
        }
        RegionGraph {
            parts: Csr::of(regions),
            openings,
            exits: Csr::of(&exits),
            ground,
        }
    }

    /// Number of regions.
    pub fn len(&self) -> usize {
        self.exits.count()
    }

    /// Tests whether there are no regions.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// The boxes that together hold a region; one in most graphs.
    pub fn parts(&self, region: RegionId) -> &[WorldBox] {
        self.parts.list(region)
    }

    /// All openings; an exit is an index in this list.
    pub fn openings(&self) -> &[Opening] {
        &self.openings
    }

    /// The openings on a region's border.
    pub fn exits(&self, region: RegionId) -> &[u32] {
        self.exits.list(region)
    }

    /// Finder of the regions of a place.
    pub fn ground(&self) -> &dyn Ground {
        &*self.ground
    }

    /// Replaces `homes` by the regions in which rays of the camera begin to see: all
    /// that are met by the box about the eye and the near window, as what is nearer
    /// than the near plane hides nothing. `false` if rays may begin in no region, or
    /// the lens is orthographic.
    pub fn homes(&self, rays: &Rays, homes: &mut Vec<RegionId>) -> bool {
        homes.clear();
        let lens = &rays.camera().lens;
        if lens.is_orthographic() {
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
}
