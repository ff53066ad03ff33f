//! What hides the items of a scene, made once before any view: themselves if they are solid
//! boxes, the boxes inside those of a mesh and below its ground, the boxes in the solid of a
//! map.

mod blocks;
mod ground;
mod inner;

pub use blocks::BlocksRow;
pub use ground::{Ground, GroundRow};
pub use inner::InnerRow;

use self::blocks::Blocks;
use self::inner::Inner;
use super::occlusion::OccluderScene;
use super::{Rays, Solids};
use crate::scene::Scene;

/// The occluders of a scene.
pub struct Hiders {
    all: OccluderScene,
    /// The same without boxes that are of no item, for eyes that these do not hide from:
    /// outside the rooms of a map, not above the ground of a mesh.
    bare: Option<OccluderScene>,
    inner: Option<InnerRow>,
    ground: Option<Ground>,
    blocks: Option<BlocksRow>,
}

impl Hiders {
    /// Those of a scene; `solids` are its items if they are solid boxes, `most` the boxes
    /// inside each item if they are triangles.
    pub fn of(scene: &Scene, solids: Option<&Solids>, most: usize, threads: usize) -> Hiders {
        let inner = Inner::of(scene, most, threads);
        let blocks = Blocks::of(scene);
        let ground = Ground::of(scene);
        let within = inner.as_ref().map_or(&[][..], |inner| &inner.boxes);
        let below = ground.as_ref().map(|ground| &ground.boxes[..]);
        let of_no_item = below.or(blocks.as_ref().map(|blocks| &blocks.boxes[..]));
        let all = match solids {
            Some(solids) => OccluderScene::of(solids),
            None => OccluderScene::among(scene, within, of_no_item.unwrap_or(&[])),
        };
        Hiders {
            bare: of_no_item.map(|_| OccluderScene::among(scene, within, &[])),
            blocks: blocks.map(|blocks| blocks.row),
            inner: inner.map(|inner| inner.row),
            ground,
            all,
        }
    }

    /// Whether boxes that are of no item hide from the eye of these rays, and are worth
    /// drawing: it is above the ground where it stands and not above all of it, or in the
    /// rooms of a map.
    pub fn is_open(&self, rays: &Rays, is_inside: impl FnOnce() -> bool) -> bool {
        match &self.ground {
            Some(ground) => ground.rises_above(rays) && ground.is_below(rays),
            None => self.bare.is_none() || is_inside(),
        }
    }

    /// Those that hide from an eye, [in the open](Hiders::is_open) or not.
    pub fn from_eye(&self, is_open: bool) -> &OccluderScene {
        match &self.bare {
            Some(bare) if !is_open => bare,
            _ => &self.all,
        }
    }

    /// The ground of a mesh, with the boxes below it.
    pub fn ground(&self) -> Option<&Ground> {
        self.ground.as_ref()
    }

    /// What is known of those boxes.
    pub fn inner_row(&self) -> Option<&InnerRow> {
        self.inner.as_ref()
    }

    /// What is known of the boxes in the solid of a map.
    pub fn blocks_row(&self) -> Option<&BlocksRow> {
        self.blocks.as_ref()
    }
}
