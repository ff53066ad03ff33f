//! Choices of a user that all readers of scenes share.

use super::UpAxis;

named! {
    /// Parts of a scene that are its items.
    #[derive(Clone, Copy, PartialEq, Eq, Default, Debug)]
    pub enum ItemKind, ITEM_KINDS {
        #[default] Objects = "objects", "objects, groups and nodes of the file";
        Triangles = "triangles", "single triangles";
        Surfaces = "surfaces", "surfaces of a Quake III map, without its brushes";
        Brushes = "brushes", "brushes of a Quake III map, without its surfaces";
    }
}

/// How to read a scene.
#[derive(Clone, Copy, Default, Debug)]
pub struct LoadOptions {
    /// Leave out rows that are no finite box, and count them.
    pub skip_bad_items: bool,
    /// Up axis of formats that do not state it.
    pub up: Option<UpAxis>,
    /// Items of a scene with triangles.
    pub items: ItemKind,
    /// Structures that will be built over the scene: they need memory as well.
    pub structures: u64,
    /// Bytes that will be needed for each triangle of a mesh, beside the scene.
    pub per_triangle: u64,
}
