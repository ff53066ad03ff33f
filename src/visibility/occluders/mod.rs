//! Occluders of a scene, built once before any view.
//!
//! These are the items themselves if they are solid boxes, boxes inside the items of a mesh and
//! below its ground, or boxes in the solid space of a map.

mod ground;

use std::time::Instant;

use glam::DVec3;
use serde::Serialize;

use super::occlusion::OccluderTree;
use super::{Rays, Solids};
use crate::geometry::Aabb;
use crate::scene::{Scene, WorldBox};
use crate::visibility::inner_boxes::{CELLS, inner_boxes};
use crate::visibility::region::doom::DoomMap;

pub use super::inner_boxes::InnerBoxStats;
pub use ground::{Ground, GroundStats};

/// The occluders of a scene.
pub struct SceneOccluders {
    all: OccluderTree,
    /// Occluders that belong to items.
    ///
    /// Used for eyes outside the rooms of a map or not above the ground of a mesh.
    items_only: Option<OccluderTree>,
    /// Statistics of the boxes inside the items of a mesh.
    pub inner: Option<InnerBoxStats>,
    /// Ground of a mesh with the boxes below it.
    pub ground: Option<Ground>,
    /// Statistics of the boxes in the solid space of a map.
    pub blocks: Option<BlockStats>,
}

impl SceneOccluders {
    /// Builds the occluders of a scene.
    ///
    /// `solids` are the items if they are solid boxes; items of triangles get up to `most` inner
    /// boxes each.
    pub fn of(scene: &Scene, solids: Option<&Solids>, most: usize, threads: usize) -> Self {
        let inner = scene.surfaces.as_ref();
        let inner = inner.map(|surfaces| inner_boxes(surfaces, CELLS, most, threads));
        let (within, inner) = inner.unzip();
        let (blocks, row) = blocks(scene).unzip();
        let ground = Ground::of(scene);
        let within = within.unwrap_or_default();
        let below = ground.as_ref().map(|ground| &ground.boxes);
        let of_no_item = below.or(blocks.as_ref());
        let tree = |blocks: &[_]| OccluderTree::with_inner_boxes(scene, &within, blocks);
        SceneOccluders {
            all: match solids {
                Some(solids) => OccluderTree::of(solids),
                None => tree(of_no_item.map_or(&[][..], |boxes| boxes)),
            },
            items_only: of_no_item.map(|_| tree(&[])),
            blocks: row,
            inner,
            ground,
        }
    }

    /// Returns `true` if occluders that belong to no item are valid for this eye.
    ///
    /// In a mesh, the near window must be above the ground, but some ground must be higher than the
    /// eye. In a map, the eye must be in the rooms (`is_inside`).
    pub fn is_open(&self, rays: &Rays, is_inside: impl FnOnce() -> bool) -> bool {
        match &self.ground {
            Some(ground) => ground.rises_above(rays) && ground.is_below(rays),
            None => self.items_only.is_none() || is_inside(),
        }
    }

    /// Occluders for an eye that is [in the open](SceneOccluders::is_open) or not.
    pub fn from_eye(&self, is_open: bool) -> &OccluderTree {
        match &self.items_only {
            Some(items_only) if !is_open => items_only,
            _ => &self.all,
        }
    }
}

/// Statistics of the boxes in the solid space of a map.
#[derive(Clone, PartialEq, Debug, Serialize)]
pub struct BlockStats {
    /// Number of boxes; 0 if a sector is not closed.
    pub box_count: usize,
    /// Number of sectors whose linedefs are not closed: rays leave the map there.
    pub unclosed_sector_count: usize,
    /// Wall time of finding all boxes.
    pub build_ns: f64,
}

/// Solid boxes of a map over its items' heights, scene-local; else `None`.
pub fn blocks(scene: &Scene) -> Option<(Vec<Aabb>, BlockStats)> {
    let map = DoomMap::of_scene(scene)?;
    let begun = Instant::now();
    let WorldBox { min, max } = WorldBox::union_of(scene.written());
    let boxes = map.solid_boxes([min.z, max.z]);
    let row = BlockStats {
        box_count: boxes.len(),
        unclosed_sector_count: map.unclosed().len(),
        build_ns: begun.elapsed().as_nanos() as f64,
    };
    // Integer coordinates: nothing is rounded.
    let about = |corner: DVec3| (corner - scene.origin).as_vec3();
    let local = boxes.iter().map(|b| Aabb::new(about(b.min), about(b.max)));
    Some((local.collect(), row))
}
