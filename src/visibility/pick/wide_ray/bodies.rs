//! Bodies under the tree, and what a search collects of them.
//!
//! A box that the tests in f32 let pass is met, so the few boxes whose depths are within their
//! slack of the first are decided exactly at the end. A triangle fills little of its box, so
//! each one whose box may be entered before what was found is tested exactly at once.

use super::slabs::around;
use super::{Candidates, Tree};
use crate::kernel::{Isa, Kernel, Work};
use crate::visibility::Ray;
use crate::visibility::pick::exactly::{self, First};
use crate::visibility::pick::{Hit, NotBuilt, Pick};
use crate::visibility::truth::{Along, Bodies, Body};

/// A body in one cache line.
#[derive(Clone, Copy, Debug)]
#[repr(align(64))]
struct Padded<B>(B);

/// Bodies under a tree of nodes of sixteen.
///
/// Some 45 bytes of nodes and 64 of the body itself per body.
#[derive(Clone, Debug)]
pub struct WideRay<B> {
    tree: Tree,
    /// In tree order.
    bodies: Vec<Padded<B>>,
    items: usize,
}

impl<B: Body> WideRay<B> {
    /// Builds the tree; as a [`Pick`] it answers by `kernel`. O(n log n).
    ///
    /// # Errors
    /// More than 2^27 bodies.
    pub fn of(bodies: &Bodies<B>, kernel: Kernel) -> Result<WideRay<B>, NotBuilt> {
        let (tree, ids) = Tree::of(&bodies.bounds, bodies.origin, kernel)?;
        let padded = ids.iter().map(|&id| Padded(bodies.all[id as usize]));
        Ok(WideRay {
            bodies: padded.collect(),
            items: bodies.items,
            tree,
        })
    }

    /// [`Pick::first`] by the given instruction set.
    #[inline]
    pub fn first_by(&self, kernel: Kernel, ray: &Ray) -> Option<Hit> {
        match self.tree.is_passed_by(ray) {
            true => None,
            false => kernel.run(SearchFirst { of: self, ray }),
        }
    }

    /// [`Pick::nearest`] by the given instruction set.
    pub fn nearest_by(&self, kernel: Kernel, ray: &Ray, count: usize, hits: &mut Vec<Hit>) {
        if count == 0 || self.tree.is_passed_by(ray) {
            return hits.clear();
        }
        kernel.run(SearchNearest {
            of: self,
            ray,
            count,
            hits,
        });
    }

    #[inline(always)]
    fn probe(&self, ray: &Ray) -> B::Probe {
        B::probe(ray, self.tree.zero)
    }

    #[inline(always)]
    fn body(&self, place: u32) -> &B {
        &self.bodies[place as usize].0
    }
}

impl<B: Body> Pick for WideRay<B> {
    fn first(&self, ray: &Ray) -> Option<Hit> {
        self.first_by(self.tree.kernel, ray)
    }

    fn nearest(&self, ray: &Ray, count: usize, hits: &mut Vec<Hit>) {
        self.nearest_by(self.tree.kernel, ray, count, hits);
    }
}

struct SearchFirst<'a, B> {
    of: &'a WideRay<B>,
    ray: &'a Ray,
}

impl<B: Body> Work for SearchFirst<'_, B> {
    type Output = Option<Hit>;

    #[inline(always)]
    fn run<I: Isa>(self, isa: I) -> Option<Hit> {
        let SearchFirst { of, ray } = self;
        let slabs = of.tree.slabs(ray);
        let first = || First::<B>::new(of.probe(ray), ray.far);
        match slabs {
            Some(slabs) if B::IS_BOX => {
                let mut found = Foremost {
                    bound: slabs.far(),
                    few: [(0.0, 0); FEW],
                    used: 0,
                    more: Vec::new(),
                };
                of.tree.search(isa, &slabs, &mut found);
                let mut first = first();
                found.within(|place| {
                    first.offer(of.body(place));
                });
                first.hit(of.items)
            }
            Some(slabs) => {
                let mut found = FirstAtOnce {
                    of,
                    bound: slabs.far(),
                    first: first(),
                };
                of.tree.search(isa, &slabs, &mut found);
                found.first.hit(of.items)
            }
            None => {
                let mut first = first();
                of.bodies.iter().for_each(|body| {
                    first.offer(&body.0);
                });
                first.hit(of.items)
            }
        }
    }
}

/// Candidates kept without the heap.
const FEW: usize = 8;

/// The candidates for the first hit, by the bounds of their depths.
struct Foremost {
    bound: f32,
    few: [(f32, u32); FEW],
    used: usize,
    more: Vec<(f32, u32)>,
}

impl Foremost {
    /// Calls `look` with those that are still within the bound.
    #[inline(always)]
    fn within(&self, mut look: impl FnMut(u32)) {
        for list in [&self.few[..self.used], &self.more] {
            for &(low, place) in list {
                if low <= self.bound {
                    look(place);
                }
            }
        }
    }

    #[cold]
    fn make_room(&mut self) {
        let mut kept = 0;
        for i in 0..self.used {
            if self.few[i].0 <= self.bound {
                self.few[kept] = self.few[i];
                kept += 1;
            }
        }
        self.used = kept;
        if kept == FEW {
            self.more.extend(self.few);
            self.used = 0;
        }
    }
}

impl Candidates for Foremost {
    #[inline(always)]
    fn bound(&self) -> f32 {
        self.bound
    }

    #[inline(always)]
    fn offer(&mut self, low: f32, place: u32, latest: impl FnOnce() -> Option<f32>) {
        let Some(high) = latest() else {
            return;
        };
        if high < self.bound {
            self.bound = high;
        }
        if self.used == FEW {
            self.make_room();
        }
        self.few[self.used % FEW] = (low, place);
        self.used += 1;
    }
}

/// The first meeting so far.
struct FirstAtOnce<'a, B: Body> {
    of: &'a WideRay<B>,
    first: First<B>,
    /// The limit of `first` in f32, rounded up.
    bound: f32,
}

impl<B: Body> Candidates for FirstAtOnce<'_, B> {
    #[inline(always)]
    fn bound(&self) -> f32 {
        self.bound
    }

    #[inline(always)]
    fn offer(&mut self, _: f32, place: u32, _: impl FnOnce() -> Option<f32>) {
        if self.first.offer(self.of.body(place)) {
            self.bound = self.bound.min(around(self.first.limit)[1]);
        }
    }
}

struct SearchNearest<'a, B> {
    of: &'a WideRay<B>,
    ray: &'a Ray,
    count: usize,
    hits: &'a mut Vec<Hit>,
}

impl<B: Body> Work for SearchNearest<'_, B> {
    type Output = ();

    #[inline(always)]
    fn run<I: Isa>(self, isa: I) {
        let SearchNearest {
            of,
            ray,
            count,
            hits,
        } = self;
        let slabs = of.tree.slabs(ray);
        let probe = of.probe(ray);
        let meet = |body: &B| Some((body.item(), body.meet(&probe, ray.far)?));
        let met = match slabs {
            Some(slabs) if B::IS_BOX => {
                let mut found = Several {
                    lowest: Lowest::new(count, slabs.far()),
                    all: Vec::new(),
                };
                of.tree.search(isa, &slabs, &mut found);
                let bound = found.bound();
                let within = found.all.iter().filter(|(low, _)| *low <= bound);
                within
                    .filter_map(|&(_, place)| meet(of.body(place)))
                    .collect()
            }
            Some(slabs) => {
                let mut found = SeveralAtOnce {
                    of,
                    probe,
                    lowest: Lowest::new(count, ray.far),
                    met: Vec::new(),
                };
                of.tree.search(isa, &slabs, &mut found);
                found.met
            }
            None => {
                let all = of.bodies.iter().map(|body| &body.0);
                let counted = all.filter(|body| (body.item() as usize) < of.items);
                counted.filter_map(meet).collect()
            }
        };
        exactly::nearest::<B>(&probe, met, count, hits);
    }
}

/// The lowest upper bounds of depths of `count` items at most, sorted.
struct Lowest<T> {
    count: usize,
    far: T,
    all: Vec<(T, u32)>,
}

impl<T: Copy + PartialOrd> Lowest<T> {
    fn new(count: usize, far: T) -> Lowest<T> {
        let all = Vec::new();
        Lowest { count, far, all }
    }

    /// Upper bound of the depths of the first `count` items.
    #[inline(always)]
    fn limit(&self) -> T {
        match self.all.len() == self.count {
            true if self.all[self.count - 1].0 < self.far => self.all[self.count - 1].0,
            _ => self.far,
        }
    }

    #[inline(always)]
    fn insert(&mut self, high: T, item: u32) {
        self.all.truncate(self.count - 1);
        let at = self.all.partition_point(|other| other.0 <= high);
        self.all.insert(at, (high, item));
    }
}

/// The candidates for the first `count` hits, by the bounds of their depths.
struct Several {
    lowest: Lowest<f32>,
    all: Vec<(f32, u32)>,
}

impl Candidates for Several {
    #[inline(always)]
    fn bound(&self) -> f32 {
        self.lowest.limit()
    }

    #[inline(always)]
    fn offer(&mut self, low: f32, place: u32, latest: impl FnOnce() -> Option<f32>) {
        let Some(high) = latest() else {
            return;
        };
        self.all.push((low, place));
        if high < self.bound() {
            self.lowest.insert(high, place);
        }
    }
}

/// The meetings with the first `count` items so far.
struct SeveralAtOnce<'a, B: Body> {
    of: &'a WideRay<B>,
    probe: B::Probe,
    lowest: Lowest<f64>,
    met: Vec<(u32, B::At)>,
}

impl<B: Body> Candidates for SeveralAtOnce<'_, B> {
    #[inline(always)]
    fn bound(&self) -> f32 {
        around(self.lowest.limit())[1]
    }

    #[inline(always)]
    fn offer(&mut self, _: f32, place: u32, _: impl FnOnce() -> Option<f32>) {
        let (body, limit) = (self.of.body(place), self.lowest.limit());
        let item = body.item();
        if item as usize >= self.of.items {
            return;
        }
        let Some(at) = body.meet(&self.probe, limit) else {
            return;
        };
        self.met.push((item, at));
        let latest = B::Probe::at_most(&at);
        if latest < limit {
            let lowest = &mut self.lowest.all;
            match lowest.iter().position(|of| of.1 == item) {
                Some(same) if lowest[same].0 <= latest => return,
                Some(same) => drop(lowest.remove(same)),
                None => {}
            }
            self.lowest.insert(latest, item);
        }
    }
}

#[cfg(test)]
mod tests {
    use glam::{DVec3, Vec3};

    use super::*;
    use crate::geometry::Aabb;
    use crate::query::ItemId;
    use crate::scene::SeededRng;
    use crate::visibility::pick::Linear;
    use crate::visibility::truth::{Facet, Facets};

    fn grid(rng: &mut SeededRng, most: usize) -> Vec3 {
        let mut along = || rng.below(most) as f32 - (most / 2) as f32;
        Vec3::new(along(), along(), along())
    }

    /// Corners on a grid: depths are equal, rays lie in planes, triangles have no area.
    ///
    /// Directions hardly move along an axis, and origins lie beyond the error analysis.
    #[test]
    fn every_instruction_set_finds_what_testing_all_finds() {
        let mut rng = SeededRng::new(17);
        let sizes = [0.0, 1e-30, -6e-17, 0.25, -1.0, 1.0, 3000.0];
        let (mut met, mut several) = (0, 0);
        let [mut found, mut wanted] = [Vec::new(), Vec::new()];
        for n in [0, 1, 15, 300] {
            let mut facet = |i: usize| {
                let at = grid(&mut rng, 12);
                Facet {
                    corners: [at, at + grid(&mut rng, 5), at + grid(&mut rng, 5)],
                    item: (i / 2) as ItemId,
                    two_sided: i % 3 != 1,
                    hides: true,
                }
            };
            let all: Vec<Facet> = (0..n).map(&mut facet).collect();
            let bounds = all.iter().map(|facet| {
                let [a, b, c] = facet.corners;
                Aabb::new(a.min(b).min(c), a.max(b).max(c))
            });
            let facets = Facets {
                bounds: bounds.collect(),
                all,
                origin: DVec3::new(3.0, -7.0, 0.5),
                // The last few are no items.
                items: n * 2 / 5,
            };
            let wide = WideRay::of(&facets, Kernel::best()).unwrap();
            let linear = Linear(facets.clone());
            for _ in 0..1200 {
                let mut ray = Ray {
                    origin: facets.origin + grid(&mut rng, 20).as_dvec3() * 0.5,
                    direction: grid(&mut rng, 7).as_dvec3(),
                    near: 0.25,
                    far: 40.0,
                };
                if rng.below(4) == 0 {
                    ray.direction = DVec3::from([(); 3].map(|()| sizes[rng.below(sizes.len())]));
                    ray.origin *= [1.0, -1e12][rng.below(2)];
                }
                let first = linear.first(&ray);
                met += usize::from(first.is_some());
                for count in [0, 1, 3, 9] {
                    linear.nearest(&ray, count, &mut wanted);
                    several += usize::from(wanted.len() > 1);
                    for kernel in Kernel::available() {
                        wide.nearest_by(kernel, &ray, count, &mut found);
                        assert_eq!(found, wanted, "{kernel} {count} {ray:?}");
                        assert_eq!(wide.first_by(kernel, &ray), first, "{kernel} {ray:?}");
                    }
                }
            }
        }
        assert!(met > 300 && several > 300, "the premise: {met} {several}");
    }
}
