//! The boxes in the solid of a map, made once before any view: how many there are, and
//! what making them took.

use std::time::Instant;

use glam::DVec3;
use serde::Serialize;

use crate::geometry::Aabb;
use crate::scene::Scene;
use crate::visibility::region::doom::DoomMap;

/// What is known of the boxes in the solid of a map.
#[derive(Clone, PartialEq, Debug, Serialize)]
#[non_exhaustive]
pub struct BlocksRow {
    /// How many there are; none if a sector does not close.
    pub box_count: usize,
    /// Sectors whose linedefs do not close: rays leave the map there.
    pub unclosed_sector_count: usize,
    /// Wall time of finding them all.
    pub build_ns: f64,
}

/// The boxes themselves.
pub struct Blocks {
    /// Over the heights of the map's items, scene-local.
    pub boxes: Vec<Aabb>,
    /// What they are.
    pub row: BlocksRow,
}

impl Blocks {
    /// `None` for a scene that is no map.
    pub fn of(scene: &Scene) -> Option<Blocks> {
        let map = DoomMap::of_scene(scene)?;
        let begun = Instant::now();
        let all = scene.written().map(|b| [b.min.z, b.max.z]);
        let heights = all.reduce(|[low, high], [min, max]| [low.min(min), high.max(max)]);
        let boxes = heights.map_or(Vec::new(), |heights| map.solid_boxes(heights));
        // Whole numbers, so nothing is rounded.
        let about = |corner: DVec3| (corner - scene.origin).as_vec3();
        let local = boxes.iter().map(|b| Aabb::new(about(b.min), about(b.max)));
        let build_ns = begun.elapsed().as_nanos() as f64;
        Some(Blocks {
            row: BlocksRow {
                box_count: boxes.len(),
                unclosed_sector_count: map.unclosed().len(),
                build_ns,
            },
            boxes: local.collect(),
        })
    }
}
