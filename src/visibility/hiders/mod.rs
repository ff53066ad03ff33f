//! Occluders of a scene, made once before any view.
//!
//! They are the items themselves if these are solid boxes, boxes inside the items of a mesh and
//! below its ground, or boxes in the solid of a map.

mod blocks;
mod ground;
mod inner;

pub use blocks::BlocksRow;
pub use ground::{Ground, GroundRow};
pub use inner::InnerRow;

use super::occlusion::OccluderScene;
use super::{Rays, Solids};
use crate::scene::Scene;

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
        let (within, inner) = inner::inner(scene, most, threads).unzip();
        let (blocks, row) = blocks::blocks(scene).unzip();
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
