//! Occluders of a scene, made once before any view.
//!
//! They are the items themselves if these are solid boxes, boxes inside the items of a mesh and
//! below its ground, or boxes in the solid of a map.

mod ground;

use std::time::Instant;

use glam::DVec3;
use serde::Serialize;

use super::occlusion::OccluderScene;
use super::{Rays, Solids};
use crate::geometry::Aabb;
use crate::scene::{Scene, WorldBox};
use crate::visibility::inscribed::{CELLS, inner_boxes};
use crate::visibility::region::doom::DoomMap;

pub use super::inscribed::InnerRow;
pub use ground::{Ground, GroundRow};

/// The occluders of a scene.
pub struct Hiders {
    all: OccluderScene,
    /// Occluders that belong to items.
    ///
    /// For eyes outside the rooms of a map or not above the ground of a mesh.
    bare: Option<OccluderScene>,
    /// The boxes inside the items of a mesh.
    pub inner: Option<InnerRow>,
    /// The ground of a mesh, with the boxes below it.
    pub ground: Option<Ground>,
    /// The boxes in the solid of a map.
    pub blocks: Option<BlocksRow>,
}

impl Hiders {
    /// The occluders of a scene.
    ///
    /// `solids` are its items if they are solid boxes; items of triangles get up to `most`
    /// boxes inside.
    pub fn of(scene: &Scene, solids: Option<&Solids>, most: usize, threads: usize) -> Hiders {
        let inner = scene.surfaces.as_ref();
        let inner = inner.map(|surfaces| inner_boxes(surfaces, CELLS, most, threads));
        let (within, inner) = inner.unzip();
        let (blocks, row) = blocks(scene).unzip();
        let ground = Ground::of(scene);
        let within = within.unwrap_or_default();
        let below = ground.as_ref().map(|ground| &ground.boxes);
        let of_no_item = below.or(blocks.as_ref());
        let among = |blocks: &[_]| OccluderScene::among(scene, &within, blocks);
        Hiders {
            all: match solids {
                Some(solids) => OccluderScene::of(solids),
                None => among(of_no_item.map_or(&[][..], |boxes| boxes)),
            },
            bare: of_no_item.map(|_| among(&[])),
            blocks: row,
            inner,
            ground,
        }
    }

    /// Returns `true` if boxes of no item hide something from the eye of these rays.
    ///
    /// The eye is above the ground where it stands and not above all of it, or in the rooms of
    /// a map.
    pub fn is_open(&self, rays: &Rays, is_inside: impl FnOnce() -> bool) -> bool {
        match &self.ground {
            Some(ground) => ground.rises_above(rays) && ground.is_below(rays),
            None => self.bare.is_none() || is_inside(),
        }
    }

    /// The occluders for an eye, [in the open](Hiders::is_open) or not.
    pub fn from_eye(&self, is_open: bool) -> &OccluderScene {
        match &self.bare {
            Some(bare) if !is_open => bare,
            _ => &self.all,
        }
    }
}

/// The boxes in the solid of a map.
#[derive(Clone, PartialEq, Debug, Serialize)]
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
    let WorldBox { min, max } = WorldBox::union_of(scene.written());
    let boxes = map.solid_boxes([min.z, max.z]);
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
