//! Solid boxes under the tree: the few whose depths are within their slack of the first
//! are decided exactly.

use super::{Candidates, Tree};
use crate::kernel::{Isa, Kernel, Work};
use crate::query::ItemId;
use crate::scene::WorldBox;
use crate::visibility::pick::contract::{Hit, NotBuilt, Pick};
use crate::visibility::pick::exactly;
use crate::visibility::{Ray, Solids};

/// An item in one cache line.
#[derive(Clone, Copy, Debug)]
#[repr(align(64))]
struct Item {
    /// As it was written.
    b: WorldBox,
    id: ItemId,
}

/// Boxes under a tree of nodes of sixteen. Some 45 bytes of nodes and 64 of the
/// box as it was written per item.
#[derive(Clone, Debug)]
pub struct WideRay {
    tree: Tree,
    /// In tree order.
    items: Vec<Item>,
}

impl WideRay {
    /// Builds the tree; as a [`Pick`] it answers by `kernel`. O(n log n).
    ///
    /// # Errors
    /// More than 2^27 items.
    pub fn of(solids: &Solids, kernel: Kernel) -> Result<WideRay, NotBuilt> {
        let (tree, ids) = Tree::of(&solids.outer, solids.origin, kernel)?;
        let item = |&id: &ItemId| Item {
            b: solids.boxes[id as usize],
            id,
        };
        let items = ids.iter().map(item).collect();
        Ok(WideRay { tree, items })
    }

    /// [`Pick::first`] by an instruction set of one's choice.
    #[inline]
    pub fn first_by(&self, kernel: Kernel, ray: &Ray) -> Option<Hit> {
        match self.tree.is_passed_by(ray) {
            true => None,
            false => kernel.run(First { boxes: self, ray }),
        }
    }

    /// [`Pick::nearest`] by an instruction set of one's choice.
    pub fn nearest_by(&self, kernel: Kernel, ray: &Ray, count: usize, hits: &mut Vec<Hit>) {
        if count == 0 || self.tree.is_passed_by(ray) {
            return hits.clear();
        }
        kernel.run(Nearest {
            boxes: self,
            ray,
            count,
            hits,
        });
    }

    #[inline]
    fn place(&self, place: u32) -> (ItemId, &WorldBox) {
        let item = &self.items[place as usize];
        (item.id, &item.b)
    }

    fn all(&self) -> impl Iterator<Item = (ItemId, &WorldBox)> {
        self.items.iter().map(|item| (item.id, &item.b))
    }
}

/// Candidates kept without the heap.
const FEW: usize = 8;

/// The candidates for the first hit.
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

struct First<'a> {
    boxes: &'a WideRay,
    ray: &'a Ray,
}

impl Work for First<'_> {
    type Output = Option<Hit>;

    #[inline(always)]
    fn run<I: Isa>(self, isa: I) -> Option<Hit> {
        let First { boxes, ray } = self;
        let Some(slabs) = boxes.tree.slabs(ray) else {
            return exactly::first(ray, boxes.all());
        };
        let mut found = Foremost {
            bound: slabs.far(),
            few: [(0.0, 0); FEW],
            used: 0,
            more: Vec::new(),
        };
        boxes.tree.search(isa, &slabs, &mut found);
        let mut first = exactly::First::new(ray);
        found.within(|place| first.offer(boxes.place(place)));
        first.hit()
    }
}

/// The candidates for the first `count` hits.
struct Several {
    count: usize,
    far: f32,
    /// The lowest upper bounds of depths, sorted, at most `count`.
    highs: Vec<f32>,
    all: Vec<(f32, u32)>,
}

impl Candidates for Several {
    #[inline(always)]
    fn bound(&self) -> f32 {
        match self.highs.len() == self.count {
            true => self.highs[self.count - 1].min(self.far),
            false => self.far,
        }
    }

    #[inline(always)]
    fn offer(&mut self, low: f32, place: u32, latest: impl FnOnce() -> Option<f32>) {
        let Some(high) = latest() else {
            return;
        };
        self.all.push((low, place));
        if high < self.bound() {
            self.highs.truncate(self.count - 1);
            let at = self.highs.partition_point(|&other| other <= high);
            self.highs.insert(at, high);
        }
    }
}

struct Nearest<'a> {
    boxes: &'a WideRay,
    ray: &'a Ray,
    count: usize,
    hits: &'a mut Vec<Hit>,
}

impl Work for Nearest<'_> {
    type Output = ();

    #[inline(always)]
    fn run<I: Isa>(self, isa: I) {
        let Nearest {
            boxes,
            ray,
            count,
            hits,
        } = self;
        let Some(slabs) = boxes.tree.slabs(ray) else {
            return exactly::nearest(ray, count, boxes.all(), hits);
        };
        let mut found = Several {
            count,
            far: slabs.far(),
            highs: Vec::new(),
            all: Vec::new(),
        };
        boxes.tree.search(isa, &slabs, &mut found);
        let bound = found.bound();
        let within = found.all.iter().filter(|(low, _)| *low <= bound);
        let places = within.map(|&(_, place)| boxes.place(place));
        exactly::nearest(ray, count, places, hits);
    }
}

impl Pick for WideRay {
    fn first(&self, ray: &Ray) -> Option<Hit> {
        self.first_by(self.tree.kernel, ray)
    }

    fn nearest(&self, ray: &Ray, count: usize, hits: &mut Vec<Hit>) {
        self.nearest_by(self.tree.kernel, ray, count, hits);
    }
}
