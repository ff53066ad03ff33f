//! The boxes of a scene in a tree for rays. It finds the front item of a ray, and
//! whatever else a ray pierces; no node that holds the answer is ever left out, and
//! what lies in the leaves is decided exactly.

use std::cmp::Ordering;
use std::ops::Range;

use super::entry::{Crossing, Probe};
use super::ray_tree::RayTree;
use crate::query::ItemId;
use crate::scene::WorldBox;
use crate::visibility::{Ray, Solids};

/// A tree over the outer boxes of a scene with the boxes as they were written in its
/// leaves.
#[derive(Clone, Debug)]
pub struct RayIndex {
    tree: RayTree,
    /// By place in the tree.
    boxes: Vec<WorldBox>,
}

/// What is in front along a ray.
#[derive(Clone, PartialEq, Debug)]
pub struct Front {
    /// Where the ray enters it.
    pub entry: Crossing,
    /// The items that it enters there, ascending: more than one of them is a tie.
    pub items: Vec<ItemId>,
}

impl Front {
    /// The item, the lowest of a tie.
    pub fn item(&self) -> ItemId {
        self.items[0]
    }
}

impl RayIndex {
    /// Builds the tree. O(n log n).
    pub fn build(solids: &Solids) -> RayIndex {
        let tree = RayTree::build(&solids.outer, solids.origin);
        let boxes = tree.ids.iter().map(|&item| solids.boxes[item as usize]);
        RayIndex {
            boxes: boxes.collect(),
            tree,
        }
    }

    /// How many items there are.
    pub fn len(&self) -> usize {
        self.tree.ids.len()
    }

    /// Whether there are none.
    pub fn is_empty(&self) -> bool {
        self.tree.ids.is_empty()
    }

    /// The items at some places of the tree, with their boxes.
    fn at(&self, places: Range<usize>) -> impl Iterator<Item = (ItemId, &WorldBox)> {
        let ids = self.tree.ids[places.clone()].iter().copied();
        ids.zip(&self.boxes[places])
    }

    /// The front item of a ray and those that tie with it, exactly. `None` where it
    /// meets nothing from near to far.
    pub fn front_of(&self, ray: &Ray) -> Option<Front> {
        let mut search = Search::default();
        search.front(self, ray).map(|entry| Front {
            entry,
            items: search.items,
        })
    }

    /// Every item that the ray enters from near to `limit`, with where: in no order.
    pub fn all_along(&self, ray: &Ray, limit: f64) -> Vec<(ItemId, Crossing)> {
        let ray = Ray {
            far: ray.far.min(limit),
            ..*ray
        };
        let probe = Probe::new(ray);
        let mut found = Vec::new();
        self.tree.walk(&ray, &mut Vec::new(), |places| {
            for (id, b) in self.at(places) {
                found.extend(probe.enter(b, ray.far).map(|entry| (id, entry)));
            }
            ray.far
        });
        found
    }
}

/// The memory of a search, kept from ray to ray.
#[derive(Default)]
pub(super) struct Search {
    stack: Vec<(f64, u32)>,
    /// The front items of the last ray, ascending.
    pub items: Vec<ItemId>,
}

impl Search {
    /// Where the front items of the ray are entered; which they are is in `items`.
    #[inline]
    pub fn front(&mut self, index: &RayIndex, ray: &Ray) -> Option<Crossing> {
        self.front_of(index, ray, &|_, _, _, _| true)
    }

    /// The same among the items that are opaque where the ray enters them.
    #[inline]
    pub fn front_of(
        &mut self,
        index: &RayIndex,
        ray: &Ray,
        is_opaque: &impl Fn(ItemId, &WorldBox, &Probe, &Crossing) -> bool,
    ) -> Option<Crossing> {
        let probe = Probe::new(*ray);
        let items = &mut self.items;
        items.clear();
        let mut best: Option<Crossing> = None;
        let mut limit = ray.far;
        index.tree.walk(ray, &mut self.stack, |places| {
            for (id, b) in index.at(places) {
                let Some(entry) = probe.enter(b, limit) else {
                    continue;
                };
                let order = best.map_or(Ordering::Less, |best| probe.compare(&entry, &best));
                match order {
                    Ordering::Greater => continue,
                    _ if !is_opaque(id, b, &probe, &entry) => continue,
                    Ordering::Less => {
                        items.clear();
                        best = Some(entry);
                        limit = entry.at_most();
                    }
                    Ordering::Equal => {}
                }
                items.push(id);
            }
            limit
        });
        items.sort_unstable();
        best
    }
}
