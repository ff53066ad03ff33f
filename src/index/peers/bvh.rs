//! The crate bvh: its tree asked through `Bvh::traverse`, and flattened. Both
//! hand back references to shapes in a list of their own.

use std::ops::ControlFlow;

use ::bvh::aabb::{Aabb as CrateAabb, Bounded, IntersectsAabb};
use ::bvh::bounding_hierarchy::{BHShape, BoundingHierarchy};
use ::bvh::bvh::{Bvh, BvhNode};
use ::bvh::flat_bvh::{FlatBvh, FlatNode};
use glam::Vec3;
use nalgebra::Point3;

use super::{BoxByBox, BoxTest, Item, PeerParams, Tally, indexable};
use crate::geometry::Aabb;
use crate::index::{BuildError, Info, Input, Kind, MemoryUsage, Origin, RegionIndex};
use crate::query::{Context, QueryVolume, Recorder, Sink};

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

/// Boxes of this reach have areas that are still numbers in f32.
const LARGEST: f32 = 1e18;

/// The crate's tree. Where areas overflow its builder finds no cheapest split
/// and leaves both children with empty boxes, in which nothing would be found;
/// where widths do, it panics. It is given such a scene made smaller, and the
/// nodes are then fitted to the true boxes.
fn tree_over(shapes: &mut [Shape]) -> Bvh<f32, 3> {
    let scene = Aabb::union_of(shapes.iter().map(|shape| &shape.item.bounds));
    let too_large = !shapes.is_empty() && scene.reach().max_element() > LARGEST;
    let mut tree = match too_large {
        false => Bvh::build(shapes),
        true => {
            let smaller = |shape: &Shape| {
                let b = shape.item.bounds;
                let bounds = Aabb::new(b.min / LARGEST, b.max / LARGEST);
                Shape {
                    item: Item {
                        bounds,
                        ..shape.item
                    },
                    ..*shape
                }
            };
            let mut all: Vec<Shape> = shapes.iter().map(smaller).collect();
            let tree = Bvh::build(&mut all);
            for (shape, placed) in shapes.iter_mut().zip(&all) {
                shape.node = placed.node;
            }
            tree
        }
    };
    if too_large {
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

        impl BoxByBox for $peer {
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
            const INFO: Info = Info::new($name, $summary, Kind::Tree, Origin::Crate("bvh"));
            type Params = PeerParams;

            fn build(input: &Input<'_>, _: &PeerParams) -> Result<Self, BuildError> {
                let items = input.items;
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

            #[inline(always)]
    fn query<Q: QueryVolume, C: Context>(&self, volume: &Q, cx: &mut C) -> ControlFlow<()> {
        super::box_by_box::query(self, volume, cx)
    }
        }

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

    /// Left to the crate, nothing is found where areas overflow, and where
    /// widths do there is no tree.
    #[test]
    fn points_without_an_area_or_too_far_apart_for_one_are_found() {
        found(|i| Vec3::X * f32::from(i));
        for step in [1e20, 6.8e36] {
            found(|i| (Vec3::splat(f32::from(i)) - 50.0) * step);
        }
    }

    fn found(point: impl Fn(u16) -> Vec3) {
        let items: Vec<Aabb> = (0..100).map(|i| Aabb::new(point(i), point(i))).collect();
        let all = crate::geometry::ConvexVolume::from_planes(&[]).expect("no planes");
        let tree = PeerBvh::build(&Input::new(&items), &PeerParams {}).expect("sound items");
        let flat = PeerBvhFlat::build(&Input::new(&items), &PeerParams {}).expect("sound items");
        let (mut seen, mut found) = (Vec::new(), Vec::new());
        for i in 0..100 {
            let _ = tree.locate(point(i), &mut found);
            let _ = flat.locate(point(i), &mut found);
        }
        let _ = tree.visible(&all, &mut seen);
        assert!(found.chunks(2).zip(0..).all(|(pair, id)| pair == [id, id]) && found.len() == 200);
        assert_eq!(seen.len(), 100);
    }
}
