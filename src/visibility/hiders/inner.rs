//! The boxes inside the items of a mesh, made once before any view: what they hold of
//! their items, and what making them took.

use std::time::Instant;

use serde::Serialize;

use crate::geometry::Aabb;
use crate::query::ItemId;
use crate::scene::Scene;
use crate::visibility::inscribed::{CELLS, InnerBoxes};

/// What the boxes inside the items of a mesh hold.
#[derive(Clone, PartialEq, Debug, Serialize)]
#[non_exhaustive]
pub struct InnerRow {
    /// Items of the mesh.
    pub item_count: usize,
    /// Of them those that have a box inside: opaque, one-sided and closed.
    pub boxed_count: usize,
    /// How many boxes an item has at most.
    pub box_limit: usize,
    /// How many boxes all have.
    pub box_count: usize,
    /// Volume of the boxes / volume of the items that have one; null if none has.
    pub volume_share: Option<f64>,
    /// Wall time of finding and proving them all.
    pub build_ns: f64,
}

/// The boxes themselves.
pub struct Inner {
    /// Each with its item, by ascending item; scene-local.
    pub boxes: Vec<(ItemId, Aabb)>,
    /// What they hold.
    pub row: InnerRow,
}

impl Inner {
    /// Up to `most` for each item; `None` for a scene that is no mesh.
    pub fn of(scene: &Scene, most: usize, threads: usize) -> Option<Inner> {
        let surfaces = scene.surfaces.as_ref()?;
        let begun = Instant::now();
        let found = InnerBoxes::of(surfaces, CELLS, most, threads);
        Some(Inner {
            row: InnerRow {
                item_count: scene.items.len(),
                boxed_count: found.items,
                box_limit: most,
                box_count: found.boxes.len(),
                volume_share: found.share,
                build_ns: begun.elapsed().as_nanos() as f64,
            },
            boxes: found.boxes,
        })
    }
}
