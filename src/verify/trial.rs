//! A trial: one question with its right answer, put to several structures.
//!
//! It guards against panics, compares with the reference, and names the first item that
//! differs. `run`, `verify`, `precision` and `stress` ask in no other way.

use super::{Difference, scan};
use crate::geometry::Aabb;
use crate::index::{IdSet, caught};
use crate::query::{AnyVolume, ItemId};

/// A fault of an answer.
#[derive(Clone, PartialEq, Debug)]
pub enum Fault {
    /// The structure panicked; its message.
    Panicked(String),
    /// The answer is not the reference's.
    Differs(Difference),
}

/// One question at a time; the memory serves all of them.
///
/// The reference is each box against each plane with [`AnyVolume::sees`]: no structure, no
/// mask, no early way out.
#[derive(Clone, Default, Debug)]
pub struct Trial {
    items: usize,
    right: IdSet,
    /// Number of items of the right answer.
    pub expected: usize,
    /// The last answer, right or wrong.
    pub answer: Vec<ItemId>,
    /// Items of the right answer that are in the structure's.
    found: IdSet,
}

impl Trial {
    /// A trial for queries of `items` items.
    pub fn new(items: usize) -> Trial {
        Trial {
            items,
            right: IdSet::none(items),
            ..Trial::default()
        }
    }

    /// Sets the question: the items that a view sees, by the reference scan.
    ///
    /// O(items * planes).
    pub fn see<'v>(&mut self, items: &[Aabb], view: impl Into<AnyVolume<'v>>) {
        let view = view.into();
        self.expect(scan(items, |b| view.sees(b)));
    }

    /// A question whose right answer is known: ids below the number of items.
    pub fn expect(&mut self, right: impl IntoIterator<Item = ItemId>) {
        self.right.clear(self.items);
        self.expected = 0;
        for id in right {
            self.right.insert(id);
            self.expected += 1;
        }
    }

    /// Puts the question to a structure, which appends its answer to an empty list.
    ///
    /// O(answer + items / 64) if it is right.
    ///
    /// # Errors
    /// A panic, or how the answer differs.
    pub fn ask(&mut self, ask: impl FnOnce(&mut Vec<ItemId>)) -> Result<&[ItemId], Fault> {
        self.answer.clear();
        caught(|| ask(&mut self.answer)).map_err(Fault::Panicked)?;
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
    /// The fault in words.
    ///
    /// `explain` says why an item is in the right answer or not.
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
        trial.expect([1, 3]);
        assert_eq!(trial.expected, 2);
        assert_eq!(trial.ask(|out| out.extend([3, 1])), Ok(&[3, 1][..]));
        let missed = trial.ask(|out| out.push(1)).unwrap_err();
        assert!(
            missed
                .explained(|id| Some(format!("item {id}!")))
                .ends_with("item 3!")
        );
        let Fault::Differs(difference) = missed else {
            panic!("{missed:?}");
        };
        assert_eq!((difference.missing, difference.extra), (1, 0));
        let panicked = trial.ask(|_| panic!("deep in a peer's code"));
        assert_eq!(
            panicked,
            Err(Fault::Panicked("deep in a peer's code".to_owned()))
        );
        // One that failed leaves nothing behind for the next.
        assert!(trial.ask(|out| out.extend([1, 3])).is_ok());
    }
}
