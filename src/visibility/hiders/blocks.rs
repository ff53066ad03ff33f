//! The boxes in the solid of a map, made once before any view.

use std::time::Instant;

use glam::DVec3;
use serde::Serialize;

use crate::geometry::Aabb;
use crate::scene::Scene;
use crate::visibility::region::doom::DoomMap;

/// The boxes in the solid of a map.
#[derive(Clone, PartialEq, Debug, Serialize)]
#[non_exhaustive]
pub struct BlocksRow {
    /// Number of boxes; none if a sector does not close.
    pub box_count: usize,
    /// Sectors whose linedefs do not close: rays leave the map there.
    pub unclosed_sector_count: usize,
    /// Wall time of finding them all.
    pub build_ns: f64,
}

/// Boxes over the heights of a map's items, scene-local; `None` for other scenes.
pub fn blocks(scene: &Scene) -> Option<(Vec<Aabb>, BlocksRow)> {
    let map = DoomMap::of_scene(scene)?;
    let begun = Instant::now();
    let all = scene.written().map(|b| [b.min.z, b.max.z]);
    let heights = all.reduce(|[low, high], [min, max]| [low.min(min), high.max(max)]);
    let boxes = heights.map_or(Vec::new(), |heights| map.solid_boxes(heights));
    let row = BlocksRow {
        box_count: boxes.len(),
        unclosed_sector_count: map.unclosed().len(),
        build_ns: begun.elapsed().as_nanos() as f64,
    };
    // Whole numbers, so nothing is rounded.
    let about = |corner: DVec3| (corner - scene.origin).as_vec3();
    let local = boxes.iter().map(|b| Aabb::new(about(b.min), about(b.max)));
    Some((local.collect(), row))
}
