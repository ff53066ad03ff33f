//! What is known of the items that a back end removed, by proofs and not by samples alone.

use serde::Serialize;

use super::pass::Pass;
use super::world::World;
use crate::query::ItemId;
use crate::visibility::truth::Class;

/// By view: items in question with what is known of each, ascending.
pub struct Proven {
    views: Vec<Vec<(ItemId, Class)>>,
}

impl Proven {
    /// By view: ascending items.
    pub fn new(views: Vec<Vec<(ItemId, Class)>>) -> Proven {
        Proven { views }
    }

    /// What is known of an item; `None` of what was not in question.
    fn class(&self, view: usize, item: ItemId) -> Option<Class> {
        let known = &self.views[view];
        let place = known.binary_search_by_key(&item, |(item, _)| *item).ok()?;
        Some(known[place].1)
    }
}

/// The items that a back end removed within the frustum, over all views, by what is proven
/// of them.
#[derive(Clone, PartialEq, Eq, Default, Debug, Serialize)]
#[non_exhaustive]
pub struct ProofCounts {
    /// In front at a sample: the false negatives of sample truth.
    pub visible_count: usize,
    /// In front along a ray between the samples, and at none.
    pub sub_sample_count: usize,
    /// In front along no ray.
    pub hidden_count: usize,
    /// In front only where one of a lower number is as near.
    pub tied_count: usize,
    /// In front along lines of the image at most.
    pub along_lines_count: usize,
    /// No proof was found either way.
    pub undecided_count: usize,
    /// Those visible between the samples: camera of the path, item.
    pub sub_sample_items: Vec<(usize, ItemId)>,
}

impl ProofCounts {
    /// Of what is in the first of two sets and not in the second.
    pub fn of(proven: &Proven, world: &World, pass: &Pass, sets: [usize; 2]) -> ProofCounts {
        let mut counts = ProofCounts::default();
        if sets[0] == sets[1] {
            return counts;
        }
        for view in 0..world.views() {
            let [input, output] = sets.map(|set| world.listed(pass.items(set, view)));
            let is_removed = |item: &ItemId| output.binary_search(item).is_err();
            for &item in input.iter().filter(|item| is_removed(item)) {
                if let Some(class) = proven.class(view, item) {
                    counts.add(class, (world.camera(view), item));
                }
            }
        }
        counts
    }

    fn add(&mut self, class: Class, item: (usize, ItemId)) {
        if class == Class::SubSample {
            self.sub_sample_items.push(item);
        }
        *match class {
            Class::Visible => &mut self.visible_count,
            Class::SubSample => &mut self.sub_sample_count,
            Class::Hidden => &mut self.hidden_count,
            Class::Tied => &mut self.tied_count,
            Class::AlongLines => &mut self.along_lines_count,
            Class::Undecided => &mut self.undecided_count,
        } += 1;
    }
}
