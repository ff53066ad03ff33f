//! The crate bvh: its tree asked through `Bvh::traverse`, and flattened. Both
//! hand back references to shapes in a list of their own.

use std::ops::ControlFlow;

use ::bvh::aabb::{Aabb as CrateAabb, Bounded, IntersectsAabb};
use ::bvh::bounding_hierarchy::{BHShape, BoundingHierarchy};
use ::bvh::bvh::{Bvh, BvhNode};
use ::bvh::flat_bvh::{FlatBvh, FlatNode};
use glam::Vec3;
use nalgebra::Point3;

use super::{BoxTest, Item, PeerParams, Tally, indexable, located_box_by_box, seen_box_by_box};
use crate::geometry::{Aabb, PlaneTree};
use crate::index::{BuildError, MemoryUsage, RegionIndex};
use crate::query::{Recorder, Sink};

/// An item that the crate tells where it put it.
#[derive(Clone, Copy)]
struct Shape {
    item: Item,
    node: usize,
}

impl Bounded<f32, 3> for Shape {
    #[inline(always)]
    fn aabb(&self) -> CrateAabb<f32, 3> {
        let point = |v: Vec3| Point3::new(v.x, v.y, v.z);
        CrateAabb {
            min: point(self.item.bounds.min),
            max: point(self.item.bounds.max),
        }
    }
}

impl BHShape<f32, 3> for Shape {
    fn set_bh_node_index(&mut self, node: usize) {
        self.node = node;
    }
    fn bh_node_index(&self) -> usize {
        self.node
    }
}

#[inline(always)]
fn bounds_of(b: &CrateAabb<f32, 3>) -> Aabb {
    Aabb::new(
        Vec3::new(b.min.x, b.min.y, b.min.z),
        Vec3::new(b.max.x, b.max.y, b.max.z),
    )
}

/// A test as the crate takes it. It does not say whether a box is a node's or
/// an item's, so items are tested once more when they come out if the two
/// tests can differ.
struct Query<'a, 'r, T, R> {
    test: &'a T,
    tally: &'a Tally<'r, R>,
}

impl<T: BoxTest, R: Recorder> IntersectsAabb<f32, 3> for Query<'_, '_, T, R> {
    #[inline(always)]
    fn intersects_aabb(&self, b: &CrateAabb<f32, 3>) -> bool {
        self.tally.node(self.test);
        !self.test.rejects(&bounds_of(b))
    }
}

fn shapes(items: &[Aabb]) -> Result<Vec<Shape>, BuildError> {
    let items = indexable(items)?;
    Ok(items
        .into_iter()
        .map(|item| Shape { item, node: 0 })
        .collect())
}

/// The crate's tree. Where areas overflow (coordinates beyond 1e18) it finds no
/// cheapest split and leaves both children with empty boxes, in which nothing
/// would be found: these are fitted anew.
fn tree_over(shapes: &mut [Shape]) -> Bvh<f32, 3> {
    let mut tree = Bvh::build(shapes);
    let is_empty = |b: &CrateAabb<f32, 3>| bounds_of(b).is_empty();
    let broken = |node: &BvhNode<f32, 3>| match node {
        BvhNode::Node {
            child_l_aabb,
            child_r_aabb,
            ..
        } => is_empty(child_l_aabb) || is_empty(child_r_aabb),
        BvhNode::Leaf { .. } => false,
    };
    if tree.nodes.iter().any(broken) {
        let mut fitted = vec![CrateAabb::empty(); tree.nodes.len()];
        // Children come after their parent.
        for at in (0..tree.nodes.len()).rev() {
            fitted[at] = match &mut tree.nodes[at] {
                BvhNode::Leaf { shape_index, .. } => shapes[*shape_index].aabb(),
                BvhNode::Node {
                    child_l_index,
                    child_l_aabb,
                    child_r_index,
                    child_r_aabb,
                    ..
                } => {
                    (*child_l_aabb, *child_r_aabb) =
                        (fitted[*child_l_index], fitted[*child_r_index]);
                    child_l_aabb.join(child_r_aabb)
                }
            };
        }
    }
    tree
}

macro_rules! peer {
    ($(#[$doc:meta])* $peer:ident, $name:literal, $summary:literal, $tree:ty, $node:ty, $make:expr) => {
        $(#[$doc])*
        pub struct $peer {
            tree: $tree,
            shapes: Vec<Shape>,
        }

        impl $peer {
            #[inline(always)]
            fn search<T: BoxTest, S: Sink, R: Recorder>(
                &self,
                test: &T,
                sink: &mut S,
                recorder: &mut R,
            ) -> ControlFlow<()> {
                let tally = Tally::new(recorder);
                let query = Query { test, tally: &tally };
                for shape in BoundingHierarchy::traverse(&self.tree, &query, &self.shapes) {
                    tally.count(|recorder| recorder.items_tested(1));
                    if T::NODES_AS_ITEMS || test.admits(&shape.item.bounds) {
                        sink.accept(std::slice::from_ref(&shape.item.id))?;
                    }
                }
                ControlFlow::Continue(())
            }
        }

        impl RegionIndex for $peer {
            const NAME: &'static str = $name;
            const SUMMARY: &'static str = $summary;
            type Params = PeerParams;

            fn build(
                items: &[Aabb],
                _: Option<&PlaneTree>,
                _: &PeerParams,
            ) -> Result<Self, BuildError> {
                let mut shapes = shapes(items)?;
                let tree = $make(tree_over(&mut shapes));
                Ok($peer { tree, shapes })
            }

            fn memory(&self) -> MemoryUsage {
                MemoryUsage {
                    node_bytes: self.tree.list().capacity() * size_of::<$node>(),
                    item_bytes: size_of_val(&self.shapes[..]),
                }
            }

            located_box_by_box!();
        }

        seen_box_by_box!($peer);
    };
}

/// Where each kind of tree keeps its nodes.
trait Nodes<N> {
    fn list(&self) -> &Vec<N>;
}

impl Nodes<BvhNode<f32, 3>> for Bvh<f32, 3> {
    fn list(&self) -> &Vec<BvhNode<f32, 3>> {
        &self.nodes
    }
}

impl Nodes<FlatNode<f32, 3>> for FlatBvh<f32, 3> {
    fn list(&self) -> &Vec<FlatNode<f32, 3>> {
        self
    }
}

peer!(
    /// Its tree, gone through by its own recursion.
    PeerBvh,
    "peer-bvh",
    "crate bvh, asked through Bvh::traverse",
    Bvh<f32, 3>,
    BvhNode<f32, 3>,
    |tree| tree
);

peer!(
    /// Its tree as a list with places to jump to.
    PeerBvhFlat,
    "peer-bvh-flat",
    "crate bvh, flattened, asked through FlatBvh::traverse",
    FlatBvh<f32, 3>,
    FlatNode<f32, 3>,
    |tree: Bvh<f32, 3>| tree.flatten()
);

#[cfg(test)]
mod tests {
    use super::*;
    use crate::index::FrustumQuery;
    use crate::query::NoRecorder;

    /// Without the mending nothing is found here: every area overflows.
    #[test]
    fn points_too_far_apart_for_an_area_are_found() {
        let point = |i: u16| Vec3::splat(f32::from(i)) * 1e20;
        let items: Vec<Aabb> = (0..100).map(|i| Aabb::new(point(i), point(i))).collect();
        let all = crate::geometry::ConvexVolume::from_planes(&[]).expect("no planes");
        let tree = PeerBvh::build(&items, None, &PeerParams {}).expect("sound items");
        let flat = PeerBvhFlat::build(&items, None, &PeerParams {}).expect("sound items");
        let (mut seen, mut found) = (Vec::new(), Vec::new());
        for i in 0..100 {
            let _ = tree.locate(point(i), &mut found, &mut NoRecorder);
            let _ = flat.locate(point(i), &mut found, &mut NoRecorder);
        }
        let _ = tree.visible(&all, &mut seen, &mut NoRecorder);
        assert!(found.chunks(2).zip(0..).all(|(pair, id)| pair == [id, id]) && found.len() == 200);
        assert_eq!(seen.len(), 100);
    }
}
