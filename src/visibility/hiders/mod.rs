//! What hides the items of a scene, made once before any view: themselves if they are solid
//! boxes, the boxes inside those of a mesh, the boxes in the solid of a map.

mod blocks;
mod inner;

pub use blocks::BlocksRow;
pub use inner::InnerRow;

use self::blocks::Blocks;
use self::inner::Inner;
use super::Solids;
use super::occlusion::OccluderScene;
use crate::geometry::Aabb;
use crate::input::InputError;
use crate::query::ItemId;
use crate::scene::Scene;

/// The occluders of a scene.
pub struct Hiders {
    all: OccluderScene,
    /// Of a map: the same without what hides, for eyes outside its rooms.
    bare: Option<OccluderScene>,
    inner: Option<Inner>,
    blocks: Option<BlocksRow>,
}

impl Hiders {
    /// Those of a scene; `solids` are its items if they are solid boxes, `most` the boxes
    /// inside each item if they are triangles.
    ///
    /// # Errors
    /// The map's file, read a second time.
    pub fn of(
        scene: &Scene,
        solids: Option<&Solids>,
        most: usize,
        threads: usize,
    ) -> Result<Hiders, InputError> {
        let inner = Inner::of(scene, most, threads);
        let blocks = Blocks::of(scene)?;
        let all = match (solids, &inner) {
            (Some(solids), _) => OccluderScene::of(solids),
            (None, Some(inner)) => OccluderScene::within(scene, &inner.boxes),
            (None, None) => {
                let boxes = blocks.as_ref().map_or(&[][..], |blocks| &blocks.boxes);
                OccluderScene::among(scene, boxes)
            }
        };
        Ok(Hiders {
            bare: blocks.as_ref().map(|_| OccluderScene::among(scene, &[])),
            blocks: blocks.map(|blocks| blocks.row),
            inner,
            all,
        })
    }

    /// Those that hide from an eye: in the rooms of the scene or not.
    pub fn from_eye(&self, is_inside: impl FnOnce() -> bool) -> &OccluderScene {
        match &self.bare {
            Some(bare) if !is_inside() => bare,
            _ => &self.all,
        }
    }

    /// The boxes inside the items of a mesh, each with its item, by ascending item;
    /// scene-local.
    pub fn inner(&self) -> &[(ItemId, Aabb)] {
        self.inner.as_ref().map_or(&[], |inner| &inner.boxes)
    }

    /// What is known of those boxes.
    pub fn inner_row(&self) -> Option<&InnerRow> {
        self.inner.as_ref().map(|inner| &inner.row)
    }

    /// What is known of the boxes in the solid of a map.
    pub fn blocks_row(&self) -> Option<&BlocksRow> {
        self.blocks.as_ref()
    }
}
