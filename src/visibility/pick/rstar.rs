//! The crate rstar: it casts no rays; its selection function is given a slab
//! test, and the first is taken from all that lies on the ray.

use ::rstar::{AABB, ParentNode, RTree, RTreeNode, RTreeObject, SelectionFunction};
use glam::{DVec3, Vec3};

use super::contract::{About, Hit, NotBuilt, Pick, keep_nearest};
use super::rounded::RoundedRay;
use crate::geometry::Aabb;
use crate::index::Origin;
use crate::query::ItemId;
use crate::visibility::{Guarantee, Ray, Solids};

/// As typed on the command line.
pub const NAME: &str = "rstar";
/// One line for tables and help.
pub const SUMMARY: &str = "crate rstar, selection by a slab test, then the first";

/// What it declares of itself.
pub const ABOUT: About = About {
    name: NAME,
    summary: SUMMARY,
    origin: Origin::Crate("rstar"),
    guarantee: Guarantee::Unproven,
};

#[derive(Clone, Copy)]
struct Item {
    bounds: Aabb,
    id: ItemId,
}

impl RTreeObject for Item {
    type Envelope = AABB<[f32; 3]>;

    fn envelope(&self) -> AABB<[f32; 3]> {
        AABB::from_corners(self.bounds.min.to_array(), self.bounds.max.to_array())
    }
}

struct Line(RoundedRay);

impl SelectionFunction<Item> for Line {
    #[inline(always)]
    fn should_unpack_parent(&self, envelope: &AABB<[f32; 3]>) -> bool {
        let corner = Vec3::from_array;
        let b = Aabb::new(corner(envelope.lower()), corner(envelope.upper()));
        self.0.meets(&b, self.0.far)
    }

    #[inline(always)]
    fn should_unpack_leaf(&self, item: &Item) -> bool {
        self.0.entry(&item.bounds).is_finite()
    }
}

/// Its tree, bulk-loaded.
pub struct PickRstar {
    tree: RTree<Item>,
    zero: DVec3,
}

/// Builds it for the table of back ends.
pub(super) fn build(solids: &Solids) -> Result<Box<dyn Pick>, NotBuilt> {
    let item = |(id, &bounds): (usize, &Aabb)| Item {
        bounds,
        id: id as ItemId,
    };
    Ok(Box::new(PickRstar {
        tree: RTree::bulk_load(solids.outer.iter().enumerate().map(item).collect()),
        zero: solids.origin,
    }))
}

impl PickRstar {
    fn met(&self, ray: &Ray) -> impl Iterator<Item = Hit> {
        let rounded = RoundedRay::of(ray, self.zero);
        let found = self.tree.locate_with_selection_function(Line(rounded));
        found.map(move |item| Hit {
            item: item.id,
            depth: f64::from(rounded.entry(&item.bounds)),
        })
    }
}

impl Pick for PickRstar {
    fn about(&self) -> About {
        ABOUT
    }

    fn first(&self, ray: &Ray) -> Option<Hit> {
        self.met(ray)
            .min_by(|a, b| a.depth.total_cmp(&b.depth).then(a.item.cmp(&b.item)))
    }

    fn nearest(&self, ray: &Ray, count: usize, hits: &mut Vec<Hit>) {
        hits.clear();
        hits.extend(self.met(ray));
        keep_nearest(hits, count);
    }

    fn memory(&self) -> usize {
        fn children(node: &ParentNode<Item>) -> usize {
            let below = node.children().iter().map(|child| match child {
                RTreeNode::Leaf(_) => 0,
                RTreeNode::Parent(parent) => children(parent),
            });
            node.children().len() + below.sum::<usize>()
        }
        children(self.tree.root()) * size_of::<RTreeNode<Item>>()
    }
}
