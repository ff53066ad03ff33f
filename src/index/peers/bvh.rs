//! The crate bvh: its tree queried through `Bvh::traverse`, which returns shapes.

use std::cell::Cell;
use std::marker::PhantomData;
use std::ops::ControlFlow;

use ::bvh::aabb::{Aabb as CrateAabb, Bounded, IntersectsAabb};
use ::bvh::bounding_hierarchy::BHShape;
use ::bvh::bvh::{Bvh, BvhNode};

use crate::geometry::Aabb;
use crate::index::box_test::{BoxQuery, BoxTest, BoxTested};
use crate::index::items::{Positions, Record};
use crate::index::{BuildError, Info, Kind, MemoryUsage, NoParams, Origin};
use crate::query::{Context, ItemId, Recorder};

/// An item with its node, which the crate writes.
#[derive(Clone, Copy)]
struct Shape {
    item: Record,
    node: usize,
}

impl Bounded<f32, 3> for Shape {
    #[inline(always)]
    fn aabb(&self) -> CrateAabb<f32, 3> {
        let Aabb { min, max } = self.item.bounds;
        CrateAabb::with_bounds(min.to_array().into(), max.to_array().into())
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
        <[f32; 3]>::from(b.min).into(),
        <[f32; 3]>::from(b.max).into(),
    )
}

/// A test in the crate's form, which treats boxes of nodes and items alike.
///
/// Returned items are tested once more if the two tests can differ.
struct Query<'a, T: ?Sized, R> {
    test: &'a T,
    nodes_tested: Cell<u32>,
    recorder: PhantomData<R>,
}

impl<T: BoxTest + ?Sized, R: Recorder> IntersectsAabb<f32, 3> for Query<'_, T, R> {
    #[inline(always)]
    fn intersects_aabb(&self, b: &CrateAabb<f32, 3>) -> bool {
        if size_of::<R>() != 0 {
            self.nodes_tested.update(|count| count + 1);
        }
        !self.test.rejects(&bounds_of(b))
    }
}

/// Most reach of boxes whose areas are finite in f32.
const LARGEST: f32 = 1e18;

/// Least reach of a scene in which the crate's builder separates centres.
///
/// The builder's epsilon is 1e-5.
const SMALLEST: f32 = 1e-4;

/// Number of shapes above which an update by shapes is slow.
///
/// Above, it takes as long as a build once three eighths have moved; below, once three quarters
/// have.
const LARGE: usize = 10_000;

/// The crate's tree; true if it was built over shapes scaled to a reach of 1,000.
///
/// The nodes of such a tree are then fitted to the shapes.
///
/// If areas overflow, the crate's builder finds no cheapest split and leaves both children with
/// empty boxes; if widths overflow, it panics.
fn tree(shapes: &mut [Shape]) -> (Bvh<f32, 3>, bool) {
    let scene = Aabb::union_of(shapes.iter().map(|shape| &shape.item.bounds));
    let reach = scene.reach().max_element();
    if (SMALLEST..=LARGEST).contains(&reach) {
        return (Bvh::build(shapes), false);
    }
    let scale = (1e3 / reach).min(1e38);
    let smaller = |shape: &Shape| {
        let (mut small, b) = (*shape, shape.item.bounds);
        small.item.bounds = Aabb::new(b.min * scale, b.max * scale);
        small
    };
    let mut small: Vec<Shape> = shapes.iter().map(smaller).collect();
    let mut tree = Bvh::build(&mut small);
    for (shape, placed) in shapes.iter_mut().zip(&small) {
        shape.node = placed.node;
    }
    // Children come after their parent.
    for at in (0..tree.nodes.len()).rev() {
        if !tree.nodes[at].is_leaf() {
            let children = [tree.nodes[at].child_l(), tree.nodes[at].child_r()];
            let [left, right] = children.map(|child| tree.nodes[child].get_node_aabb(shapes));
            *tree.nodes[at].child_l_aabb_mut() = left;
            *tree.nodes[at].child_r_aabb_mut() = right;
        }
    }
    (tree, true)
}

/// The crate's tree over a list of shapes, traversed by the crate's own recursion.
pub struct PeerBvh {
    tree: Bvh<f32, 3>,
    shapes: Vec<Shape>,
    scaled: bool,
    positions: Positions,
}

impl BoxTested for PeerBvh {
    const ABOUT: Info = Info::new(
        "peer-bvh",
        "crate bvh, queried through Bvh::traverse",
        Kind::Tree,
        Origin::Crate("bvh"),
    )
    .refits();
    type Params = NoParams;

    fn of(items: Vec<Record>, _: &NoParams) -> Result<Self, BuildError> {
        let shapes = items.into_iter().map(|item| Shape { item, node: 0 });
        let mut shapes: Vec<Shape> = shapes.collect();
        let (tree, scaled) = tree(&mut shapes);
        Ok(PeerBvh {
            tree,
            shapes,
            scaled,
            positions: Positions::default(),
        })
    }

    /// `remove_shape` and `add_shape`, as `update_shapes` calls them, or a build.
    ///
    /// A build is faster if most shapes have moved, and needed if areas overflow. The shape of an
    /// item that is gone stays in the list, empty and without a node.
    fn follow(&mut self, items: &[Aabb], moved: &[ItemId]) -> Option<()> {
        let ids = self.shapes.iter().map(|shape| &shape.item.id);
        self.positions.prepare(ids, items.len());
        let mut moved = moved.to_vec();
        // The crate adds a shape once per mention.
        moved.sort_unstable();
        moved.dedup();
        let (mut removed, mut added, mut overflows) = (Vec::new(), Vec::new(), false);
        for id in moved {
            let at = self.positions.of(id).unwrap_or(self.shapes.len());
            if at == self.shapes.len() {
                self.positions.set(id, at as u32);
                let bounds = Aabb::EMPTY;
                let item = Record { bounds, id };
                self.shapes.push(Shape { item, node: 0 });
            }
            let new = items[id as usize];
            let old = std::mem::replace(&mut self.shapes[at].item.bounds, new);
            removed.extend((!old.is_empty()).then_some(at));
            added.extend((!new.is_empty()).then_some(at));
            overflows |= !new.is_empty() && new.reach().max_element() > LARGEST;
        }
        let count = self.shapes.len();
        let eighths = if count > LARGE { 3 } else { 6 };
        let changed = removed.len().max(added.len());
        if changed * 8 >= count * eighths || self.scaled || overflows {
            self.shapes.retain(|shape| !shape.item.bounds.is_empty());
            if self.shapes.len() < count {
                self.positions = Positions::default();
            }
            (self.tree, self.scaled) = tree(&mut self.shapes);
            return Some(());
        }
        for at in removed {
            self.tree.remove_shape(&mut self.shapes, at, false);
        }
        for at in added {
            self.tree.add_shape(&mut self.shapes, at);
        }
        Some(())
    }

    fn used(&self) -> MemoryUsage {
        MemoryUsage {
            node_bytes: self.tree.nodes.capacity() * size_of::<BvhNode<f32, 3>>(),
            item_bytes: size_of_val(&self.shapes[..]) + self.positions.bytes(),
        }
    }

    #[inline(always)]
    fn search<T: BoxTest + ?Sized, C: Context>(&self, ask: &mut BoxQuery<T, C>) -> ControlFlow<()> {
        let query = Query::<_, C::Recorder> {
            test: ask.test,
            nodes_tested: Cell::new(0),
            recorder: PhantomData,
        };
        let found = self.tree.traverse(&query, &self.shapes);
        ask.count_nodes(query.nodes_tested.get());
        for shape in found {
            ask.cx.recorder().items_tested(1);
            if ask.test.nodes_as_items() || ask.test.admits(&shape.item.bounds) {
                ask.cx.accept(std::slice::from_ref(&shape.item.id))?;
            }
        }
        ControlFlow::Continue(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::index::{FrustumQuery, Input, RegionIndex};
    use glam::Vec3;

    /// The crate alone finds nothing if areas overflow and panics if widths do.
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
        assert!((0..100_u16).all(|i| tree.locate(point(i)) == [u32::from(i)]));
        assert_eq!(tree.visible(&all).len(), 100);
    }
}
