//! Picking by the tree of the truth, sixteen slab tests at once.
//!
//! A box that the tests in f32 let pass is met, so the few boxes whose depths are within their
//! slack of the first are decided exactly at the end. A triangle fills little of its box, so
//! each one whose box may be entered before what was found is tested exactly at once.

use super::Pick;
use super::exactly::{self, First};
use crate::kernel::{Isa, Kernel, Work};
use crate::query::ItemId;
use crate::visibility::Ray;
use crate::visibility::truth::{Along, Bodies, Body, BodyIndex, Candidates, Visit};

/// The bodies of a scene, to be picked by an instruction set.
#[derive(Clone, Debug)]
pub struct WideRay<B>(BodyIndex<B>);

impl<B: Body> WideRay<B> {
    /// Builds the tree, whose answers are those of any `kernel`. O(n log n).
    pub fn of(bodies: &Bodies<B>, kernel: Kernel) -> WideRay<B> {
        WideRay(BodyIndex::of(bodies, kernel))
    }
}

impl<B: Body> Pick for WideRay<B> {
    #[inline]
    fn first(&self, ray: &Ray) -> Option<ItemId> {
        let of = &self.0;
        if B::IS_BOX && !of.tree.is_passed_by(ray) {
            return of.kernel.run(SearchFirst(of, ray));
        }
        let mut first = First::<B>::new(of.probe(ray), ray.far);
        of.walk(ray, &mut first);
        first.item(of.items)
    }

    fn nearest(&self, ray: &Ray, count: usize, out: &mut Vec<ItemId>) {
        let of = &self.0;
        if count == 0 || of.tree.is_passed_by(ray) {
            return;
        }
        let probe = of.probe(ray);
        let met = match B::IS_BOX {
            true => of.kernel.run(SearchNearest(of, ray, &probe, count)),
            false => {
                let mut found = SeveralAtOnce {
                    items: of.items,
                    probe: &probe,
                    lowest: Lowest::new(count, ray.far),
                    met: Vec::new(),
                };
                of.walk(ray, &mut found);
                found.met
            }
        };
        exactly::nearest::<B>(&probe, met, count, out);
    }
}

/// The first box.
struct SearchFirst<'a, B>(&'a BodyIndex<B>, &'a Ray);

impl<B: Body> Work for SearchFirst<'_, B> {
    type Output = Option<ItemId>;

    #[inline(always)]
    fn run<I: Isa>(self, isa: I) -> Option<ItemId> {
        let SearchFirst(of, ray) = self;
        let slabs = of.tree.slabs(ray);
        let mut first = First::<B>::new(of.probe(ray), ray.far);
        match slabs {
            Some(slabs) => {
                let mut found = Foremost {
                    bound: slabs.far(),
                    few: [(0.0, 0); FEW],
                    used: 0,
                    more: Vec::new(),
                };
                of.tree.search(isa, &slabs, &mut found);
                found.within(|place| first.offer(of.body(place)));
            }
            None => of.walk_in_f64(ray, |body| first.offer(body)),
        }
        first.item(of.items)
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

/// The boxes among which the nearest are.
struct SearchNearest<'a, B: Body>(&'a BodyIndex<B>, &'a Ray, &'a B::Probe, usize);

impl<B: Body> Work for SearchNearest<'_, B> {
    type Output = Vec<(u32, B::At)>;

    #[inline(always)]
    fn run<I: Isa>(self, isa: I) -> Vec<(u32, B::At)> {
        let SearchNearest(of, ray, probe, count) = self;
        let meet = |body: &B| Some((body.item(), body.meet(probe, ray.far)?));
        let Some(slabs) = of.tree.slabs(ray) else {
            let mut met = Vec::new();
            of.walk_in_f64(ray, |body| met.extend(meet(body)));
            return met;
        };
        let mut found = Several {
            lowest: Lowest::new(count, slabs.far()),
            all: Vec::new(),
        };
        of.tree.search(isa, &slabs, &mut found);
        let bound = found.bound();
        let within = found.all.iter().filter(|(low, _)| *low <= bound);
        let met = within.filter_map(|&(_, place)| meet(of.body(place)));
        met.collect()
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
    items: usize,
    probe: &'a B::Probe,
    lowest: Lowest<f64>,
    met: Vec<(u32, B::At)>,
}

impl<B: Body> Visit<B> for SeveralAtOnce<'_, B> {
    #[inline(always)]
    fn visit(&mut self, body: &B) -> f64 {
        let (item, limit) = (body.item(), self.lowest.limit());
        if item as usize >= self.items {
            return limit;
        }
        let Some(at) = body.meet(self.probe, limit) else {
            return limit;
        };
        self.met.push((item, at));
        let latest = B::Probe::at_most(&at);
        if latest < limit {
            let lowest = &mut self.lowest.all;
            match lowest.iter().position(|of| of.1 == item) {
                Some(same) if lowest[same].0 <= latest => return limit,
                Some(same) => drop(lowest.remove(same)),
                None => {}
            }
            self.lowest.insert(latest, item);
        }
        self.lowest.limit()
    }
}
