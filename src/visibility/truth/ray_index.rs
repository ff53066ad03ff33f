//! Exact ray search over bodies in a tree of sixteen-wide nodes.

use std::cmp::Ordering;

use super::body::{Bodies, Body, Boxes, Facet, Facets, SolidBox};
use super::ray_tree::{RayTree, misses};
use super::slabs::{RaySlabTest, round_up};
use crate::kernel::{Isa, Kernel, Work};
use crate::query::ItemId;
use crate::scene::Surfaces;
use crate::visibility::{Ray, RayProbe, Rays, SampleGrid, Solids};

/// A body padded to cache lines.
#[derive(Clone, Copy, Debug)]
#[repr(align(64))]
struct Padded<B>(B);

/// Bodies in a tree: some 45 bytes of nodes and 64 of the body itself per body.
#[derive(Clone, Debug)]
pub struct BodyIndex<B> {
    /// Tree over the bounds of the bodies.
    pub(in crate::visibility) tree: RayTree,
    /// Bodies in tree order.
    bodies: Vec<Padded<B>>,
    /// Number of items, see [`Bodies::items`].
    pub(in crate::visibility) items: usize,
    /// Instruction set of the queries.
    pub(in crate::visibility) kernel: Kernel,
}

/// Index of solid boxes.
pub type RayIndex = BodyIndex<SolidBox>;

/// Index of triangles; clear ones and cut-outs hide nothing.
pub type SurfaceIndex = BodyIndex<Facet>;

/// Items visible along a ray; its memory is reused from ray to ray.
#[derive(Clone, Debug)]
pub struct Front<Hit> {
    /// Meetings with bodies that hide nothing.
    transparent: Vec<(ItemId, Hit)>,
    /// Hiding items that the ray meets first, ascending.
    ///
    /// More than one is a tie. Empty if the ray meets none from near to far.
    pub front: Vec<ItemId>,
    /// Other items seen in front of these or at the same depth, ascending.
    ///
    /// The ray meets one of their triangles that hide nothing.
    pub before: Vec<ItemId>,
    /// Point where the ray meets the front items.
    pub hit: Option<Hit>,
}

impl RayIndex {
    /// Builds the index of solid boxes. O(n log n).
    pub fn build(solids: &Solids) -> RayIndex {
        BodyIndex::of(&Boxes::of(solids), Kernel::best())
    }
}

impl SurfaceIndex {
    /// Builds the index of triangles. O(t log t).
    pub fn build(surfaces: &Surfaces) -> SurfaceIndex {
        BodyIndex::of(&Facets::of(surfaces), Kernel::best())
    }
}

impl<B: Body> BodyIndex<B> {
    /// Builds the index. O(n log n). Its answers do not depend on the `kernel`.
    pub fn of(bodies: &Bodies<B>, kernel: Kernel) -> BodyIndex<B> {
        let (tree, ids) = RayTree::of(&bodies.bounds, bodies.origin);
        let padded = ids.iter().map(|&id| Padded(bodies.all[id as usize]));
        BodyIndex {
            bodies: padded.collect(),
            items: bodies.items,
            kernel,
            tree,
        }
    }

    /// Prepares a ray for exact tests against these bodies.
    #[inline(always)]
    pub fn probe(&self, ray: &Ray) -> B::Probe {
        B::probe(ray, self.tree.zero)
    }

    /// Calls `visitor` for each body that the ray may meet, nearest nodes first.
    #[inline]
    pub fn walk<V: Visit<B>>(&self, ray: &Ray, visitor: &mut V) {
        // Cheaper than preparing the ray for the nodes.
        if !misses(ray, self.tree.zero, &self.tree.bounds) {
            self.kernel.run(Traversal(self, ray, visitor));
        }
    }

    /// Finds the items visible along a ray, exactly.
    pub fn front_of(&self, ray: &Ray) -> Front<B::Hit> {
        let mut front = Front::new();
        front.search(self, ray, &|_, _, _| true);
        front
    }

    /// Minimum number of body tests for the rays of all samples of a grid.
    pub fn min_body_tests(&self, rays: &Rays, grid: SampleGrid) -> u64 {
        let mut tests = 0;
        for ray in rays.of_grid(grid) {
            let hit = self.front_of(&ray).hit;
            let end = hit.map_or(ray.far, |at| B::Probe::max_depth(&at));
            self.walk(&ray, &mut |_: &B| {
                tests += 1;
                end
            });
        }
        tests
    }

    /// All meetings of a ray with hiding bodies from near to far, unordered.
    pub fn all_hits(&self, ray: &Ray) -> Vec<(ItemId, B::Hit)> {
        let probe = self.probe(ray);
        let mut hits = Vec::new();
        self.walk(ray, &mut |body: &B| {
            if body.hides() {
                hits.extend(body.hit(&probe, ray.far).map(|at| (body.item(), at)));
            }
            ray.far
        });
        hits
    }
}

/// A search that tests bodies one by one, exactly.
pub trait Visit<B> {
    /// Tests a body; returns the depth beyond which no further body is needed.
    fn visit(&mut self, body: &B) -> f64;
}

impl<B, F: FnMut(&B) -> f64> Visit<B> for F {
    #[inline]
    fn visit(&mut self, body: &B) -> f64 {
        self(body)
    }
}

struct Traversal<'a, B, V>(&'a BodyIndex<B>, &'a Ray, &'a mut V);

impl<B: Body, V: Visit<B>> Work for Traversal<'_, B, V> {
    type Output = ();

    #[inline(always)]
    fn run<I: Isa>(self, isa: I) {
        let Traversal(of, ray, visitor) = self;
        let Some(slabs) = RaySlabTest::of(ray, of.tree.zero, of.tree.bounds.reach()) else {
            return of.tree.search_in_f64(ray, |position| {
                visitor.visit(&of.bodies[position as usize].0);
            });
        };
        let mut limit = f64::INFINITY;
        let mut bound = slabs.far;
        of.tree.search(isa, &slabs, |position| {
            let latest = visitor.visit(&of.bodies[position as usize].0);
            if latest < limit {
                limit = latest;
                bound = bound.min(round_up(limit));
            }
            bound
        });
    }
}

impl<Hit: Copy> Front<Hit> {
    pub(super) fn new() -> Front<Hit> {
        Front {
            transparent: Vec::new(),
            front: Vec::new(),
            before: Vec::new(),
            hit: None,
        }
    }

    /// Replaces the result by the items visible along `ray`.
    ///
    /// The ray passes through a point of a hiding body that is not `is_opaque`.
    #[inline]
    pub(super) fn search<B: Body<Hit = Hit>>(
        &mut self,
        index: &BodyIndex<B>,
        ray: &Ray,
        is_opaque: &impl Fn(&B, &B::Probe, &Hit) -> bool,
    ) {
        let probe = index.probe(ray);
        let (front, transparent) = (&mut self.front, &mut self.transparent);
        front.clear();
        transparent.clear();
        let mut best: Option<Hit> = None;
        let mut limit = ray.far;
        index.walk(ray, &mut |body: &B| {
            let Some(at) = body.hit(&probe, limit) else {
                return limit;
            };
            if !body.hides() {
                transparent.push((body.item(), at));
                return limit;
            }
            match best.map_or(Ordering::Less, |best| probe.compare(&at, &best)) {
                Ordering::Greater => return limit,
                _ if !is_opaque(body, &probe, &at) => return limit,
                Ordering::Less => {
                    front.clear();
                    best = Some(at);
                    limit = limit.min(B::Probe::max_depth(&at));
                }
                Ordering::Equal => {}
            }
            front.push(body.item());
            limit
        });
        let reached = |at: &Hit| best.is_none_or(|best| probe.compare(at, &best).is_le());
        self.before.clear();
        let before = transparent.iter().filter(|(_, at)| reached(at));
        self.before.extend(before.map(|(item, _)| *item));
        for items in [&mut self.front, &mut self.before] {
            items.sort_unstable();
            items.dedup();
        }
        self.before.retain(|item| !self.front.contains(item));
        self.hit = best;
    }
}
