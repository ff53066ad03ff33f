//! Triangles under the tree: each whose box may be entered before what was found is asked
//! at once, exactly.

use super::slabs::around;
use super::{Candidates, Tree};
use crate::kernel::{Isa, Kernel, Work};
use crate::query::ItemId;
use crate::visibility::Ray;
use crate::visibility::pick::contract::{Hit, NotBuilt, Pick};
use crate::visibility::pick::exactly;
use crate::visibility::pick::facets::{Facet, Facets};
use crate::visibility::truth::{Meeting, TriangleProbe};

/// A triangle in one cache line.
#[derive(Clone, Copy, Debug)]
#[repr(align(64))]
struct Padded(Facet);

/// Triangles under a tree of nodes of sixteen. Some 45 bytes of nodes and 64 of the corners
/// per triangle.
#[derive(Clone, Debug)]
pub(in crate::visibility::pick) struct WideTriangles {
    tree: Tree,
    /// In tree order.
    facets: Vec<Padded>,
    /// How many items count.
    items: usize,
}

impl WideTriangles {
    /// Builds the tree. O(n log n).
    ///
    /// # Errors
    /// More than 2^27 triangles.
    pub fn of(facets: &Facets, kernel: Kernel) -> Result<WideTriangles, NotBuilt> {
        let (tree, ids) = Tree::of(&facets.bounds(), facets.origin, kernel)?;
        let padded = |&id: &u32| Padded(facets.all[id as usize]);
        Ok(WideTriangles {
            tree,
            facets: ids.iter().map(padded).collect(),
            items: facets.items,
        })
    }

    /// [`Pick::first`] by an instruction set of one's choice.
    #[inline]
    pub fn first_by(&self, kernel: Kernel, ray: &Ray) -> Option<Hit> {
        match self.tree.is_passed_by(ray) {
            true => None,
            false => kernel.run(First { of: self, ray }),
        }
    }

    /// [`Pick::nearest`] by an instruction set of one's choice.
    pub fn nearest_by(&self, kernel: Kernel, ray: &Ray, count: usize, hits: &mut Vec<Hit>) {
        if count == 0 || self.tree.is_passed_by(ray) {
            return hits.clear();
        }
        kernel.run(Nearest {
            of: self,
            ray,
            count,
            hits,
        });
    }

    #[inline]
    fn probe(&self, ray: &Ray) -> TriangleProbe {
        TriangleProbe::new(*ray, self.tree.zero)
    }

    fn all(&self) -> impl Iterator<Item = &Facet> {
        self.facets.iter().map(|padded| &padded.0)
    }
}

/// The first meeting so far.
struct Foremost<'a> {
    facets: &'a [Padded],
    probe: TriangleProbe,
    /// Nothing deeper is met first: the same number in f32, rounded up, and in f64.
    bound: f32,
    limit: f64,
    best: Option<(ItemId, Meeting)>,
}

impl Candidates for Foremost<'_> {
    #[inline(always)]
    fn bound(&self) -> f32 {
        self.bound
    }

    #[inline(always)]
    fn offer(&mut self, _: f32, place: u32, _: impl FnOnce() -> Option<f32>) {
        let facet = &self.facets[place as usize].0;
        let Some(at) = self.probe.meet(facet.corners, facet.two_sided, self.limit) else {
            return;
        };
        let met = (facet.item, at);
        if self
            .best
            .is_none_or(|best| exactly::order_of_meetings(&self.probe, &met, &best).is_lt())
        {
            self.best = Some(met);
            self.limit = self.limit.min(at.at_most());
            self.bound = self.bound.min(around(self.limit)[1]);
        }
    }
}

struct First<'a> {
    of: &'a WideTriangles,
    ray: &'a Ray,
}

impl Work for First<'_> {
    type Output = Option<Hit>;

    #[inline(always)]
    fn run<I: Isa>(self, isa: I) -> Option<Hit> {
        let First { of, ray } = self;
        let probe = of.probe(ray);
        let Some(slabs) = of.tree.slabs(ray) else {
            return exactly::first_facet(&probe, of.all(), of.items);
        };
        let mut found = Foremost {
            facets: &of.facets,
            probe,
            bound: slabs.far(),
            limit: ray.far,
            best: None,
        };
        of.tree.search(isa, &slabs, &mut found);
        let (item, at) = found.best?;
        let depth = at.depth;
        Hit { item, depth }.counted(of.items)
    }
}

/// The meetings with the first `count` items so far.
struct Several<'a> {
    of: &'a WideTriangles,
    probe: TriangleProbe,
    count: usize,
    far: f64,
    /// The lowest upper bounds of depths, each of another item, sorted, at most `count`.
    latest: Vec<(f64, ItemId)>,
    met: Vec<(ItemId, Meeting)>,
}

impl Several<'_> {
    #[inline(always)]
    fn limit(&self) -> f64 {
        match self.latest.len() == self.count {
            true => self.latest[self.count - 1].0.min(self.far),
            false => self.far,
        }
    }
}

impl Candidates for Several<'_> {
    #[inline(always)]
    fn bound(&self) -> f32 {
        around(self.limit())[1]
    }

    #[inline(always)]
    fn offer(&mut self, _: f32, place: u32, _: impl FnOnce() -> Option<f32>) {
        let facet = &self.of.facets[place as usize].0;
        if facet.item as usize >= self.of.items {
            return;
        }
        let limit = self.limit();
        let Some(at) = self.probe.meet(facet.corners, facet.two_sided, limit) else {
            return;
        };
        self.met.push((facet.item, at));
        let latest = at.at_most();
        if latest < limit {
            let same = self.latest.iter().position(|of| of.1 == facet.item);
            match same {
                Some(same) if self.latest[same].0 <= latest => return,
                Some(same) => drop(self.latest.remove(same)),
                None => self.latest.truncate(self.count - 1),
            }
            let at = self.latest.partition_point(|of| of.0 <= latest);
            self.latest.insert(at, (latest, facet.item));
        }
    }
}

struct Nearest<'a> {
    of: &'a WideTriangles,
    ray: &'a Ray,
    count: usize,
    hits: &'a mut Vec<Hit>,
}

impl Work for Nearest<'_> {
    type Output = ();

    #[inline(always)]
    fn run<I: Isa>(self, isa: I) {
        let Nearest {
            of,
            ray,
            count,
            hits,
        } = self;
        let probe = of.probe(ray);
        let Some(slabs) = of.tree.slabs(ray) else {
            return exactly::nearest_facets(&probe, of.all(), of.items, count, hits);
        };
        let mut found = Several {
            of,
            probe,
            count,
            far: ray.far,
            latest: Vec::new(),
            met: Vec::new(),
        };
        of.tree.search(isa, &slabs, &mut found);
        exactly::nearest_meetings(&probe, found.met, count, hits);
    }
}

impl Pick for WideTriangles {
    fn first(&self, ray: &Ray) -> Option<Hit> {
        self.first_by(self.tree.kernel, ray)
    }

    fn nearest(&self, ray: &Ray, count: usize, hits: &mut Vec<Hit>) {
        self.nearest_by(self.tree.kernel, ray, count, hits);
    }
}

#[cfg(test)]
mod tests {
    use glam::{DVec3, Vec3};

    use super::*;
    use crate::scene::SeededRng;

    fn grid(rng: &mut SeededRng, most: usize) -> Vec3 {
        let mut along = || rng.below(most) as f32 - (most / 2) as f32;
        Vec3::new(along(), along(), along())
    }

    /// Corners on a grid, so that depths are equal, rays lie in planes and triangles have no
    /// area; directions that hardly move along an axis, and origins beyond the analysis.
    #[test]
    fn every_instruction_set_finds_what_asking_all_finds() {
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
                }
            };
            let facets = Facets {
                all: (0..n).map(&mut facet).collect(),
                origin: DVec3::new(3.0, -7.0, 0.5),
                // The last few are no items.
                items: n * 2 / 5,
            };
            let wide = WideTriangles::of(&facets, Kernel::best()).unwrap();
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
                let probe = wide.probe(&ray);
                let first = exactly::first_facet(&probe, facets.all.iter(), facets.items);
                met += usize::from(first.is_some());
                for count in [0, 1, 3, 9] {
                    let all = facets.all.iter();
                    exactly::nearest_facets(&probe, all, facets.items, count, &mut wanted);
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
