//! The textbook quadtree: a square cut in the middle of the two axes in which the
//! scene is widest, every item at the smallest cell that wholly holds it. The
//! cells are columns through the whole scene.

use super::octree::{Cell, root_cell};
use super::{TextbookParams, answered_by_walk, memory_of};
use crate::geometry::Aabb;
use crate::index::partition::Record;
use crate::index::quadtree::widest_axes;
use crate::index::{BuildError, Info, Input, Kind, MemoryUsage, Origin, RegionIndex};

/// A quadtree (Finkel and Bentley 1974, "Quad trees: a data structure for
/// retrieval on composite keys") as the lecture on visibility means it (slides
/// "Visibility", "Region search"), over boxes: as in
/// [`OctreeTextbook`](super::OctreeTextbook) an item lies with the smallest cell
/// that holds it. O(log n + answers) per query where the scene is flat and items
/// are small against their cells; nothing is culled by height.
pub struct QuadtreeTextbook {
    root: Option<Box<Cell<4>>>,
}

impl QuadtreeTextbook {
    fn root(&self) -> Option<&Cell<4>> {
        self.root.as_deref()
    }
}

impl RegionIndex for QuadtreeTextbook {
    const INFO: Info = Info::new(
        "quadtree-textbook",
        "lecture form: items at the smallest column that holds them",
        Kind::Tree,
        Origin::Ours,
    )
    .textbook();
    type Params = TextbookParams;

    fn build(input: &Input<'_>, params: &TextbookParams) -> Result<Self, BuildError> {
        let items = input.items;
        params.check(Self::INFO.name)?;
        let records = Record::all(items)?;
        let scene = Aabb::union_of(items);
        let axes = widest_axes(&scene);
        let cell = root_cell(&scene, &axes);
        let root = (!records.is_empty()).then(|| Cell::divided(cell, &axes, records, params, 0));
        Ok(QuadtreeTextbook { root })
    }

    fn memory(&self) -> MemoryUsage {
        memory_of(self.root(), size_of::<Cell<4>>())
    }

    answered_by_walk!();
}
