//! Items of a scene, prepared once for occlusion.
//!
//! They are in a packed tree of blocks of sixteen, each with its occluders.

use glam::{BVec3, DVec3, Vec3};

use crate::geometry::{Aabb, BoxBlock, BoxBlocks};
use crate::kernel::{LANES, LaneMask, first_lanes};
use crate::query::ItemId;
use crate::scene::{Scene, WorldBox};
use crate::visibility::Solids;

/// Set of a box's six faces.
///
/// Bit `axis` is the lower face, bit `3 + axis` the upper face.
pub type Faces = u8;

/// A box that hides what is behind it.
#[derive(Clone, Copy, Debug)]
pub struct Occluder {
    /// Scene-local box, inside the item or solid that it stands for.
    pub inner: Aabb,
    /// Faces of the scene's bounds that it reaches, compared exactly as written.
    pub faces: Faces,
}

/// Items of a scene in a packed 16-wide tree.
///
/// Every node except the last of a level has sixteen children: the children of box `j` of a level
/// are block `j` of the level below.
#[derive(Clone, Debug)]
pub struct OccluderTree {
    /// World position of the boxes' origin.
    pub(super) origin: DVec3,
    /// Level 0 holds the items' outer boxes; the last level is one block.
    pub levels: Vec<BoxBlocks>,
    /// Box numbers in tree order; numbers from `items` on are occluders only.
    ids: Vec<ItemId>,
    /// All occluders, in tree order.
    occluders: Vec<Occluder>,
    /// First occluder of each position, then the number of occluders.
    first_occluders: Vec<u32>,
    /// Number of items; boxes of higher number are occluders only.
    items: usize,
    /// Union of the boxes as written.
    pub(super) bounds: WorldBox,
}

impl OccluderTree {
    /// Tree of solid boxes, which are their own occluders. O(n log n).
    pub fn of(solids: &Solids) -> OccluderTree {
        let written = solids.boxes.iter().copied();
        let bounds = WorldBox::union_of(written.clone());
        let occluders = (0..).zip(solids.inner.iter().copied().zip(written));
        let occluders = occluders.filter(|(_, (inner, _))| !inner.is_empty());
        OccluderTree::build(solids.origin, &solids.outer, occluders, bounds)
    }

    /// Tree of items with inner boxes, and of occluders that are not items.
    ///
    /// O(n log n). `inner` pairs each inner box with its item, by ascending item. `blocks` are
    /// below ground or in the rock between the rooms of a map. All are scene-local.
    pub fn with_inner_boxes(scene: &Scene, inner: &[(ItemId, Aabb)], blocks: &[Aabb]) -> Self {
        let bounds = WorldBox::union_of(scene.written());
        let numbered = (scene.items.len() as ItemId..).zip(blocks.iter().copied());
        let occluders = inner.iter().copied().chain(numbered);
        // Rounded inward: the solid reaches a face if the rounded box does.
        let within = |inner: Aabb| (inner, WorldBox::within(&inner, scene.origin));
        let occluders = occluders.map(|(number, inner)| (number, within(inner)));
        let outer = [&scene.items[..], blocks].concat();
        let mut tree = OccluderTree::build(scene.origin, &outer, occluders, bounds);
        tree.items = scene.items.len();
        tree
    }

    /// Builds the tree over `outer` boxes, numbered by index.
    ///
    /// Each of `occluders` is a box, rounded and as written, with the number of its outer box,
    /// by ascending number.
    fn build(
        origin: DVec3,
        outer: &[Aabb],
        occluders: impl Iterator<Item = (ItemId, (Aabb, WorldBox))>,
        bounds: WorldBox,
    ) -> OccluderTree {
        let by_number = occluders.map(|(number, (inner, b))| {
            let faces = faces(b.min.cmple(bounds.min), b.max.cmpge(bounds.max));
            (number, Occluder { inner, faces })
        });
        let by_number: Vec<(ItemId, Occluder)> = by_number.collect();
        let mut ids: Vec<ItemId> = (0..outer.len() as ItemId).collect();
        let centres: Vec<_> = outer.iter().map(Aabb::centre).collect();
        sort_into(&mut ids, LANES.pow(8), &centres);
        let mut levels: Vec<BoxBlocks> = vec![ids.iter().map(|&id| &outer[id as usize]).collect()];
        while let Some(last) = levels.last().filter(|last| last.blocks().len() > 1) {
            let unions: Vec<Aabb> = last.blocks().iter().map(BoxBlock::union).collect();
            levels.push(unions.iter().collect());
        }
        let mut occluders = Vec::with_capacity(by_number.len());
        let mut first_occluders = vec![0];
        for &id in &ids {
            let first = by_number.partition_point(|(number, _)| *number < id);
            let end = by_number.partition_point(|(number, _)| *number <= id);
            occluders.extend(by_number[first..end].iter().map(|(_, own)| *own));
            first_occluders.push(occluders.len() as u32);
        }
        OccluderTree {
            origin,
            levels,
            occluders,
            first_occluders,
            items: ids.len(),
            ids,
            bounds,
        }
    }

    /// Number of boxes in the tree, occluders that are not items included.
    #[allow(clippy::len_without_is_empty)] // No caller needs `is_empty`.
    pub fn len(&self) -> usize {
        self.ids.len()
    }

    /// Item at a position in tree order; `None` for an occluder that is not an item.
    #[inline(always)]
    pub fn item(&self, position: usize) -> Option<ItemId> {
        let id = self.ids[position];
        ((id as usize) < self.items).then_some(id)
    }

    /// Lanes of a block that hold a box.
    #[inline(always)]
    pub fn lanes(&self, level: usize, block: usize) -> LaneMask {
        first_lanes(self.levels[level].len() - block * LANES)
    }

    /// Outer box at a position, which is tested for being hidden.
    #[inline(always)]
    pub fn outer(&self, position: usize) -> Aabb {
        self.levels[0].get(position)
    }

    /// Occluders at a position; none if the item is not solid.
    #[inline(always)]
    pub fn occluders(&self, position: usize) -> &[Occluder] {
        let [first, end] = [position, position + 1].map(|at| self.first_occluders[at] as usize);
        &self.occluders[first..end]
    }
}

/// Sorts the items so that each run of `capacity` is compact.
///
/// The last run may be shorter. Each sixteenth of a run is compact too, recursively.
fn sort_into(ids: &mut [ItemId], capacity: usize, centres: &[Vec3]) {
    if ids.len() <= capacity {
        if capacity > LANES {
            sort_into(ids, capacity / LANES, centres);
        }
        return;
    }
    let bounds = Aabb::of_points(ids.iter().map(|&id| centres[id as usize]));
    let axis = bounds.extent().max_position();
    let centre = |id: ItemId| centres[id as usize][axis];
    let left = ids.len().div_ceil(capacity) / 2 * capacity;
    ids.select_nth_unstable_by(left, |&a, &b| {
        centre(a).total_cmp(&centre(b)).then(a.cmp(&b))
    });
    let (before, behind) = ids.split_at_mut(left);
    sort_into(before, capacity, centres);
    sort_into(behind, capacity, centres);
}

/// Set of the lower faces of some axes and the upper faces of others.
pub fn faces(low: BVec3, high: BVec3) -> Faces {
    (low.bitmask() | high.bitmask() << 3) as Faces
}
