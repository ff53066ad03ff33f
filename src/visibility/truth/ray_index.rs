//! Exact search along a ray, with bodies under a tree of nodes of sixteen.

use std::cmp::Ordering;

use super::super::rays::Along;
use super::body::{Bodies, Body, Boxes, Facet, Facets, SolidBox};
use super::ray_tree::{RayTree, misses};
use super::slabs::{Slabs, above};
use crate::kernel::{Isa, Kernel, Work};
use crate::query::ItemId;
use crate::scene::Surfaces;
use crate::visibility::{Ray, Rays, SampleGrid, Solids};

/// A body in one cache line.
#[derive(Clone, Copy, Debug)]
#[repr(align(64))]
struct Padded<B>(B);

/// Bodies under a tree: some 45 bytes of nodes and 64 of the body itself per body.
#[derive(Clone, Debug)]
pub struct BodyIndex<B> {
    /// The bounds of the bodies.
    pub(in crate::visibility) tree: RayTree,
    /// In tree order.
    bodies: Vec<Padded<B>>,
    /// Number of items, see [`Bodies::items`].
    pub(in crate::visibility) items: usize,
    /// Instruction set of the queries.
    pub(in crate::visibility) kernel: Kernel,
}

/// An index of solid boxes.
pub type RayIndex = BodyIndex<SolidBox>;

/// An index of triangles. Clear ones and cut-outs hide nothing.
pub type SurfaceIndex = BodyIndex<Facet>;

/// The items that are seen along a ray; its memory serves for many.
#[derive(Clone, Debug)]
pub struct Front<At> {
    /// Bodies that hide nothing, where the ray meets them.
    through: Vec<(ItemId, At)>,
    /// Items that the ray meets first among those that hide, ascending.
    ///
    /// Several are a tie. Empty if the ray meets none from near to far.
    pub front: Vec<ItemId>,
    /// Others of which a triangle that hides nothing is met before these or with them,
    /// ascending.
    pub before: Vec<ItemId>,
    /// Point where the ray meets the front items.
    pub meeting: Option<At>,
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
    /// Builds the index, whose answers are those of any `kernel`. O(n log n).
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

    /// Shows each body that a ray may meet to a visitor, nearest nodes first.
    #[inline]
    pub fn walk<V: Visit<B>>(&self, ray: &Ray, visitor: &mut V) {
        // It costs less than preparing the ray for the nodes.
        if !misses(ray, self.tree.zero, &self.tree.bounds) {
            self.kernel.run(Walk(self, ray, visitor));
        }
    }

    /// Searches for what is seen along a ray, exactly.
    pub fn front_of(&self, ray: &Ray) -> Front<B::At> {
        let mut front = Front::new();
        front.search(self, ray, &|_, _, _| true);
        front
    }

    /// Least number of tests of bodies by the rays to all samples of a grid.
    pub fn tests(&self, rays: &Rays, grid: SampleGrid) -> u64 {
        let mut tests = 0;
        for ray in rays.of_grid(grid) {
            let meeting = self.front_of(&ray).meeting;
            let end = meeting.map_or(ray.far, |at| B::Probe::at_most(&at));
            self.walk(&ray, &mut |_: &B| {
                tests += 1;
                end
            });
        }
        tests
    }

    /// Every meeting of a ray with a body that hides, from near to far, in no order.
    pub fn all_along(&self, ray: &Ray) -> Vec<(ItemId, B::At)> {
        let probe = self.probe(ray);
        let mut met = Vec::new();
        self.walk(ray, &mut |body: &B| {
            if body.hides() {
                met.extend(body.meet(&probe, ray.far).map(|at| (body.item(), at)));
            }
            ray.far
        });
        met
    }
}

/// A search that decides bodies one by one, exactly.
pub trait Visit<B> {
    /// Decides a body; returns the depth beyond which no further one is wanted.
    fn visit(&mut self, body: &B) -> f64;
}

impl<B, F: FnMut(&B) -> f64> Visit<B> for F {
    #[inline]
    fn visit(&mut self, body: &B) -> f64 {
        self(body)
    }
}

struct Walk<'a, B, V>(&'a BodyIndex<B>, &'a Ray, &'a mut V);

impl<B: Body, V: Visit<B>> Work for Walk<'_, B, V> {
    type Output = ();

    #[inline(always)]
    fn run<I: Isa>(self, isa: I) {
        let Walk(of, ray, visitor) = self;
        let Some(slabs) = Slabs::of(ray, of.tree.zero, of.tree.bounds.reach()) else {
            return of.tree.search_in_f64(ray, |place| {
                visitor.visit(&of.bodies[place as usize].0);
            });
        };
        let mut limit = f64::INFINITY;
        let mut bound = slabs.far;
        of.tree.search(isa, &slabs, |place| {
            let latest = visitor.visit(&of.bodies[place as usize].0);
            if latest < limit {
                limit = latest;
                bound = bound.min(above(limit));
            }
            bound
        });
    }
}

impl<At: Copy> Front<At> {
    pub(super) fn new() -> Front<At> {
        Front {
            through: Vec::new(),
            front: Vec::new(),
            before: Vec::new(),
            meeting: None,
        }
    }

    /// Replaces what is seen along the last ray.
    ///
    /// Rays pass through points of bodies that are not `is_opaque`.
    #[inline]
    pub(super) fn search<B: Body<At = At>>(
        &mut self,
        index: &BodyIndex<B>,
        ray: &Ray,
        is_opaque: &impl Fn(&B, &B::Probe, &At) -> bool,
    ) {
        let probe = index.probe(ray);
        let (front, through) = (&mut self.front, &mut self.through);
        front.clear();
        through.clear();
        let mut best: Option<At> = None;
        let mut limit = ray.far;
        index.walk(ray, &mut |body: &B| {
            let Some(at) = body.meet(&probe, limit) else {
                return limit;
            };
            if !body.hides() {
                through.push((body.item(), at));
                return limit;
            }
            match best.map_or(Ordering::Less, |best| probe.compare(&at, &best)) {
                Ordering::Greater => return limit,
                _ if !is_opaque(body, &probe, &at) => return limit,
                Ordering::Less => {
                    front.clear();
                    best = Some(at);
                    limit = limit.min(B::Probe::at_most(&at));
                }
                Ordering::Equal => {}
            }
            front.push(body.item());
            limit
        });
        let reached = |at: &At| best.is_none_or(|best| probe.compare(at, &best).is_le());
        self.before.clear();
        let before = through.iter().filter(|(_, at)| reached(at));
        self.before.extend(before.map(|(item, _)| *item));
        for items in [&mut self.front, &mut self.before] {
            items.sort_unstable();
            items.dedup();
        }
        self.before.retain(|item| !self.front.contains(item));
        self.meeting = best;
    }
}
