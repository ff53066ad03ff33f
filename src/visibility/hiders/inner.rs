//! The boxes inside the items of a mesh, made once before any view.

use std::time::Instant;

use serde::Serialize;

use crate::geometry::Aabb;
use crate::query::ItemId;
use crate::scene::Scene;
use crate::visibility::inscribed::{CELLS, InnerBoxes};

/// The boxes inside the items of a mesh.
#[derive(Clone, PartialEq, Debug, Serialize)]
#[non_exhaustive]
pub struct InnerRow {
    /// Items of the mesh.
    pub item_count: usize,
    /// Items that have a box inside: opaque, one-sided and closed.
    pub boxed_count: usize,
    /// Most boxes of an item.
    pub box_limit: usize,
    /// Number of boxes of all items.
    pub box_count: usize,
    /// Volume of the boxes / volume of the items that have one; null if none has.
    pub volume_share: Option<f64>,
    /// Wall time of finding and proving them all.
    pub build_ns: f64,
}

/// Up to `most` boxes for each item, scene-local and by ascending item.
///
/// `None` for a scene that is no mesh.
pub fn inner(
    scene: &Scene,
    most: usize,
    threads: usize,
) -> Option<(Vec<(ItemId, Aabb)>, InnerRow)> {
    let surfaces = scene.surfaces.as_ref()?;
    let begun = Instant::now();
    let found = InnerBoxes::of(surfaces, CELLS, most, threads);
    let row = InnerRow {
        item_count: scene.items.len(),
        boxed_count: found.items,
        box_limit: most,
        box_count: found.boxes.len(),
        volume_share: found.share,
        build_ns: begun.elapsed().as_nanos() as f64,
    };
    Some((found.boxes, row))
}
