//! Exact search along a ray, with the bodies of a scene in the leaves of a tree.

use std::cmp::Ordering;

use super::along::Along;
use super::body::{Bodies, Body, Boxes, Facet, Facets, SolidBox};
use super::ray_tree::RayTree;
use crate::query::ItemId;
use crate::scene::Surfaces;
use crate::visibility::{Ray, Solids};

/// A tree over the bounds of bodies with the bodies in its leaves.
#[derive(Clone, Debug)]
pub struct BodyIndex<B> {
    tree: RayTree,
    /// In tree order.
    bodies: Vec<B>,
    items: usize,
}

/// An index of solid boxes.
pub type RayIndex = BodyIndex<SolidBox>;

/// An index of triangles. Clear ones and cut-outs hide nothing.
pub type SurfaceIndex = BodyIndex<Facet>;

/// The items that are seen along a ray.
#[derive(Clone, PartialEq, Debug)]
#[non_exhaustive]
pub struct Front<At> {
    /// Items that the ray meets first among those that hide, ascending.
    ///
    /// Several are a tie. Empty if the ray meets none from near to far.
    pub front: Vec<ItemId>,
    /// Items that hide nothing and are met before these or with them, ascending.
    pub before: Vec<ItemId>,
    /// Point where the ray meets the front items.
    pub meeting: Option<At>,
}

impl RayIndex {
    /// Builds the index of solid boxes. O(n log n).
    pub fn build(solids: &Solids) -> RayIndex {
        BodyIndex::of(&Boxes::of(solids))
    }
}

impl SurfaceIndex {
    /// Builds the index of triangles. O(t log t).
    pub fn build(surfaces: &Surfaces) -> SurfaceIndex {
        BodyIndex::of(&Facets::of(surfaces))
    }
}

impl<B: Body> BodyIndex<B> {
    /// Builds the index. O(n log n).
    pub fn of(bodies: &Bodies<B>) -> BodyIndex<B> {
        let tree = RayTree::build(&bodies.bounds, bodies.origin);
        let placed = tree.ids.iter().map(|&id| bodies.all[id as usize]);
        BodyIndex {
            bodies: placed.collect(),
            items: bodies.items,
            tree,
        }
    }

    /// Number of items, see [`Bodies::items`].
    pub fn items(&self) -> usize {
        self.items
    }

    /// Prepares a ray for exact tests against these bodies.
    pub fn probe(&self, ray: &Ray) -> B::Probe {
        B::probe(ray, self.tree.origin)
    }

    /// Searches for what is seen along a ray, exactly.
    pub fn front_of(&self, ray: &Ray) -> Front<B::At> {
        let mut search = Search::new();
        let meeting = search.front(self, ray, &|_, _, _| true);
        Front {
            front: search.front,
            before: search.before,
            meeting,
        }
    }

    /// Every meeting of a ray with a body from near to far, in no order.
    pub fn all_along(&self, ray: &Ray) -> Vec<(ItemId, B::At)> {
        let probe = self.probe(ray);
        let mut met = Vec::new();
        self.tree.walk(ray, &mut Vec::new(), |places| {
            let bodies = self.bodies[places].iter();
            met.extend(bodies.filter_map(|b| Some((b.item(), b.meet(&probe, ray.far)?))));
            ray.far
        });
        met
    }
}

/// Memory of a search, kept from ray to ray.
pub(super) struct Search<At> {
    stack: Vec<(f64, u32)>,
    through: Vec<(ItemId, At)>,
    /// [`Front::front`] of the last ray.
    pub front: Vec<ItemId>,
    /// [`Front::before`] of the last ray.
    pub before: Vec<ItemId>,
}

impl<At: Copy> Search<At> {
    pub fn new() -> Search<At> {
        Search {
            stack: Vec::new(),
            through: Vec::new(),
            front: Vec::new(),
            before: Vec::new(),
        }
    }

    /// Sets `front` and `before`; returns where the ray meets the front items.
    ///
    /// Rays pass through points of bodies that are not `is_opaque`.
    #[inline]
    pub fn front<B: Body<At = At>>(
        &mut self,
        index: &BodyIndex<B>,
        ray: &Ray,
        is_opaque: &impl Fn(&B, &B::Probe, &At) -> bool,
    ) -> Option<At> {
        let probe = index.probe(ray);
        let (front, through) = (&mut self.front, &mut self.through);
        front.clear();
        through.clear();
        let mut best: Option<At> = None;
        let mut limit = ray.far;
        index.tree.walk(ray, &mut self.stack, |places| {
            for body in &index.bodies[places] {
                let Some(at) = body.meet(&probe, limit) else {
                    continue;
                };
                if !body.hides() {
                    through.push((body.item(), at));
                    continue;
                }
                match best.map_or(Ordering::Less, |best| probe.order(&at, &best)) {
                    Ordering::Greater => continue,
                    _ if !is_opaque(body, &probe, &at) => continue,
                    Ordering::Less => {
                        front.clear();
                        best = Some(at);
                        limit = limit.min(B::Probe::at_most(&at));
                    }
                    Ordering::Equal => {}
                }
                front.push(body.item());
            }
            limit
        });
        let reached = |at: &At| best.is_none_or(|best| probe.order(at, &best).is_le());
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
