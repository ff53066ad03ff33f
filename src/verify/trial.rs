//! Trial: one query with its correct answer, put to several structures.
//!
//! Catches panics, compares with the reference, and names the first item that differs. `run`,
//! `verify`, `precision` and `stress` query structures only through it.

use super::{Difference, scan};
use crate::geometry::Aabb;
use crate::index::{IdSet, caught};
use crate::query::{AnyVolume, ItemId};

/// Fault of an answer.
#[derive(Clone, PartialEq, Debug)]
pub enum Fault {
    /// The structure panicked with this message.
    Panicked(String),
    /// The answer differs from the reference.
    Differs(Difference),
}

/// One query at a time, with memory that is reused.
///
/// The reference tests each box against each plane with [`AnyVolume::sees`], without structure,
/// masks or early exit.
#[derive(Clone, Default, Debug)]
pub struct Trial {
    items: usize,
    right: IdSet,
    /// Number of items in the correct answer.
    pub expected: usize,
    /// The last answer, correct or not.
    pub answer: Vec<ItemId>,
    /// Correct items found in the structure's answer.
    found: IdSet,
}

impl Trial {
    /// Trial for queries of `items` items.
    pub fn new(items: usize) -> Trial {
        Trial {
            items,
            right: IdSet::none(items),
            ..Trial::default()
        }
    }

    /// Sets the query to the items that a view sees, by the reference scan.
    ///
    /// O(items * planes).
    pub fn set_view<'v>(&mut self, items: &[Aabb], view: impl Into<AnyVolume<'v>>) {
        let view = view.into();
        self.set_expected(scan(items, |b| view.sees(b)));
    }

    /// Sets the query by its correct answer, ids below the number of items.
    pub fn set_expected(&mut self, right: impl IntoIterator<Item = ItemId>) {
        self.right.clear(self.items);
        self.expected = 0;
        for id in right {
            self.right.insert(id);
            self.expected += 1;
        }
    }

    /// Queries a structure, which appends its answer to an empty list.
    ///
    /// O(answer + items / 64) if the answer is correct.
    ///
    /// # Errors
    /// A panic, or the difference of the answer.
    pub fn run(&mut self, query: impl FnOnce(&mut Vec<ItemId>)) -> Result<&[ItemId], Fault> {
        self.answer.clear();
        caught(|| query(&mut self.answer)).map_err(Fault::Panicked)?;
        let difference = self.compare();
        match difference == Difference::default() {
            true => Ok(&self.answer),
            false => Err(Fault::Differs(difference)),
        }
    }

    /// Compares the answer, in any order, with the reference.
    ///
    /// O(items) in the worst case.
    fn compare(&mut self) -> Difference {
        let mut difference = Difference {
            missing: self.expected,
            ..Difference::default()
        };
        self.found.clear(self.items);
        for &id in &self.answer {
            let is_known = (id as usize) < self.items;
            if is_known && !self.right.holds(id) {
                difference.extra += 1;
            } else if is_known && self.found.insert(id) {
                difference.missing -= 1;
                continue;
            } else {
                difference.invalid += 1;
            }
            difference.first.get_or_insert(id);
        }
        if difference.missing > 0 {
            let is_lost = |id: &ItemId| self.right.holds(*id) && !self.found.holds(*id);
            difference.first = (0..self.items as ItemId).find(is_lost);
        }
        difference
    }
}

impl Fault {
    /// Describes the fault.
    ///
    /// `explain` states why an item is in the correct answer or not.
    pub fn explained(&self, explain: impl FnOnce(usize) -> Option<String>) -> String {
        match self {
            Fault::Panicked(message) => format!("panicked: {message}"),
            Fault::Differs(difference) => {
                let why = difference.first.and_then(|id| explain(id as usize));
                why.map_or(difference.to_string(), |why| format!("{difference}: {why}"))
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn right_wrong_and_panicking_answers_are_told_apart() {
        let mut trial = Trial::new(5);
        trial.set_expected([1, 3]);
        assert_eq!(trial.expected, 2);
        assert_eq!(trial.run(|out| out.extend([3, 1])), Ok(&[3, 1][..]));
        let missed = trial.run(|out| out.push(1)).unwrap_err();
        assert!(
            missed
                .explained(|id| Some(format!("item {id}!")))
                .ends_with("item 3!")
        );
        let Fault::Differs(difference) = missed else {
            panic!("{missed:?}");
        };
        assert_eq!((difference.missing, difference.extra), (1, 0));
        let panicked = trial.run(|_| panic!("deep in a peer's code"));
        assert_eq!(
            panicked,
            Err(Fault::Panicked("deep in a peer's code".to_owned()))
        );
        // A failed query leaves no state for the next.
        assert!(trial.run(|out| out.extend([1, 3])).is_ok());
    }
}
