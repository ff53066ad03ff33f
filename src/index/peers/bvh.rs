//! The crate bvh: its tree asked through `Bvh::traverse`, which returns references to
//! shapes in a list of its own.

use std::ops::ControlFlow;

use ::bvh::aabb::{Aabb as CrateAabb, Bounded, IntersectsAabb};
use ::bvh::bounding_hierarchy::BHShape;
use ::bvh::bvh::{Bvh, BvhNode};
use glam::Vec3;
use nalgebra::Point3;

use super::{BoxTest, BuildError, Record, Tally, peer_of_tree};
use crate::geometry::Aabb;
use crate::index::MemoryUsage;
use crate::query::{Recorder, Sink};

/// An item that the crate tells where it put it.
#[derive(Clone, Copy)]
struct Shape {
    pub item: Record,
    node: usize,
}

impl From<Record> for Shape {
    fn from(item: Record) -> Shape {
        Shape { item, node: 0 }
    }
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
                let id = shape.item.id;
                Shape::from(Record { bounds, id })
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

/// The crate's tree over shapes in a list of our own.
struct Tree {
    tree: Bvh<f32, 3>,
    shapes: Vec<Shape>,
}

impl Tree {
    fn build(_: &'static str, items: Vec<Record>, (): ()) -> Result<Self, BuildError> {
        let mut shapes: Vec<Shape> = items.into_iter().map(Shape::from).collect();
        let tree = tree_over(&mut shapes);
        Ok(Tree { tree, shapes })
    }

    fn memory(&self) -> MemoryUsage {
        MemoryUsage {
            node_bytes: self.tree.nodes.capacity() * size_of::<BvhNode<f32, 3>>(),
            item_bytes: size_of_val(&self.shapes[..]),
        }
    }

    #[inline(always)]
    fn traverse<Q: BoxTest, S: Sink, R: Recorder>(
        &self,
        test: &Q,
        sink: &mut S,
        recorder: &mut R,
    ) -> ControlFlow<()> {
        let tally = Tally::new(recorder);
        let query = Query {
            test,
            tally: &tally,
        };
        for shape in self.tree.traverse(&query, &self.shapes) {
            tally.count(|recorder| recorder.items_tested(1));
            if Q::NODES_AS_ITEMS || test.admits(&shape.item.bounds) {
                sink.accept(std::slice::from_ref(&shape.item.id))?;
            }
        }
        ControlFlow::Continue(())
    }
}

peer_of_tree!(
    /// Its tree, gone through by its own recursion.
    PeerBvh,
    "peer-bvh",
    "crate bvh, asked through Bvh::traverse",
    "bvh",
    Tree,
    (),
    traverse
);

#[cfg(test)]
mod tests {
    use super::*;
    use crate::index::{FrustumQuery, Input, NoParams, RegionIndex};

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
        let tree = PeerBvh::build(&Input::new(&items), &NoParams {}).expect("sound items");
        let (mut seen, mut found) = (Vec::new(), Vec::new());
        for i in 0..100 {
            let _ = tree.locate(point(i), &mut found);
        }
        let _ = tree.visible(&all, &mut seen);
        assert!(found.iter().copied().eq(0..100));
        assert_eq!(seen.len(), 100);
    }
}
