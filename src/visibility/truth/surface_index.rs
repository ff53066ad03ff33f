//! The triangles of a scene in a tree for rays. It finds what is seen along a ray:
//! the nearest opaque items, and what lies before them and can be seen through.

use std::cmp::Ordering;

use glam::{DVec3, Vec3};

use super::ray_tree::RayTree;
use super::ray_triangle::{Meeting, TriangleProbe};
use crate::geometry::Aabb;
use crate::query::ItemId;
use crate::scene::{SurfaceKind, Surfaces};
use crate::visibility::Ray;

/// A triangle as a leaf needs it.
#[derive(Clone, Copy, Debug)]
struct Facet {
    corners: [Vec3; 3],
    item: ItemId,
    hides: bool,
    two_sided: bool,
}

/// A tree over the triangles of a scene.
///
/// An opaque triangle hides what is behind it; clear ones and cut-outs hide nothing,
/// so that no cut-out is taken for more than it may hide. One-sided triangles are met
/// from their front only. What a ray meets before its near end is not there.
#[derive(Clone, Debug)]
pub struct SurfaceIndex {
    origin: DVec3,
    items: usize,
    tree: RayTree,
    /// By place in the tree.
    facets: Vec<Facet>,
}

/// What is seen along a ray.
#[derive(Clone, PartialEq, Debug)]
#[non_exhaustive]
pub struct SurfaceFront {
    /// The opaque items that the ray meets first, ascending: more than one of them is
    /// a tie. Empty if it meets none from near to far.
    pub front: Vec<ItemId>,
    /// Items that hide nothing and are met before that or with it, ascending.
    pub before: Vec<ItemId>,
    /// Where it meets the front ones.
    pub meeting: Option<Meeting>,
}

impl SurfaceIndex {
    /// Builds the tree. O(t log t).
    pub fn build(surfaces: &Surfaces) -> SurfaceIndex {
        let mut facets = Vec::with_capacity(surfaces.triangles.len());
        for item in 0..surfaces.items() {
            facets.extend(surfaces.of(item).map(|corners| Facet {
                corners,
                item: item as ItemId,
                hides: surfaces.kinds[item] == SurfaceKind::Opaque,
                two_sided: surfaces.two_sided[item],
            }));
        }
        let bounds = |facet: &Facet| {
            let [a, b, c] = facet.corners;
            Aabb::new(a.min(b).min(c), a.max(b).max(c))
        };
        let boxes: Vec<Aabb> = facets.iter().map(bounds).collect();
        let tree = RayTree::build(&boxes, surfaces.origin);
        SurfaceIndex {
            origin: surfaces.origin,
            items: surfaces.items(),
            facets: tree.ids.iter().map(|&id| facets[id as usize]).collect(),
            tree,
        }
    }

    /// How many items the triangles are of.
    pub fn items(&self) -> usize {
        self.items
    }

    /// What is seen along a ray, exactly.
    pub fn front_of(&self, ray: &Ray) -> SurfaceFront {
        let mut search = Search::default();
        let meeting = search.front(self, ray);
        SurfaceFront {
            front: search.front,
            before: search.before,
            meeting,
        }
    }
}

impl SurfaceIndex {
    /// Every meeting of the ray with a triangle from near to far, each with its item, in no
    /// order.
    pub fn all_along(&self, ray: &Ray) -> Vec<(ItemId, Meeting)> {
        let probe = TriangleProbe::new(*ray, self.origin);
        let mut met = Vec::new();
        self.tree.walk(ray, &mut Vec::new(), |places| {
            let facets = self.facets[places].iter();
            met.extend(facets.filter_map(|facet| {
                let at = probe.meet(facet.corners, facet.two_sided, ray.far)?;
                Some((facet.item, at))
            }));
            ray.far
        });
        met
    }
}

/// The memory of a search, kept from ray to ray.
#[derive(Default)]
pub(super) struct Search {
    stack: Vec<(f64, u32)>,
    through: Vec<(ItemId, Meeting)>,
    /// The front items of the last ray, ascending.
    pub front: Vec<ItemId>,
    /// What hides nothing and is met before them or with them, ascending.
    pub before: Vec<ItemId>,
}

impl Search {
    /// Where the front items of the ray are met; what is seen is in `front` and
    /// `before`.
    pub fn front(&mut self, index: &SurfaceIndex, ray: &Ray) -> Option<Meeting> {
        let probe = TriangleProbe::new(*ray, index.origin);
        let (front, through) = (&mut self.front, &mut self.through);
        front.clear();
        through.clear();
        let mut best: Option<Meeting> = None;
        let mut limit = ray.far;
        index.tree.walk(ray, &mut self.stack, |places| {
            for facet in &index.facets[places] {
                let Some(at) = probe.meet(facet.corners, facet.two_sided, limit) else {
                    continue;
                };
                if !facet.hides {
                    through.push((facet.item, at));
                    continue;
                }
                match best.map_or(Ordering::Less, |best| probe.compare(&at, &best)) {
                    Ordering::Less => {
                        front.clear();
                        best = Some(at);
                        limit = limit.min(at.at_most());
                    }
                    Ordering::Equal => {}
                    Ordering::Greater => continue,
                }
                front.push(facet.item);
            }
            limit
        });
        let reached = |at: &Meeting| best.is_none_or(|best| probe.compare(at, &best).is_le());
        self.before.clear();
        let before = through.iter().filter(|(_, at)| reached(at));
        self.before.extend(before.map(|(item, _)| *item));
        for items in [&mut self.front, &mut self.before] {
            items.sort_unstable();
            items.dedup();
        }
        best
    }
}
