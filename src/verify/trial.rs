//! A trial: one question with its right answer, put to one structure after
//! another. It guards against panics, compares with the reference, and names the
//! first item that differs. `run`, `verify`, `precision`, `advise` and `stress`
//! ask in no other way.

use super::{Difference, scan};
use crate::geometry::Aabb;
use crate::index::caught;
use crate::query::{AnyVolume, ItemId};

/// A fault of an answer.
#[derive(Clone, PartialEq, Debug)]
#[non_exhaustive]
pub enum Fault {
    /// The structure panicked; its message.
    Panicked(String),
    /// The answer is not the reference's.
    Differs(Difference),
}

/// One question at a time; the memory serves all of them. The reference is each box
/// against each plane with [`AnyVolume::sees`]: no structure, no mask, no early way
/// out.
#[derive(Clone, Debug)]
pub struct Trial {
    /// Per item: the number of the question that marked it last, twice: +0 if
    /// the reference wants it, +1 once a structure has returned it.
    marks: Vec<u64>,
    stamp: u64,
    expected: usize,
    answer: Vec<ItemId>,
}

impl Trial {
    /// A trial for queries of `items` items.
    pub fn new(items: usize) -> Trial {
        Trial {
            marks: vec![0; items],
            stamp: 0,
            expected: 0,
            answer: Vec::new(),
        }
    }

    /// The question what a view sees, answered by the reference scan.
    /// O(items * planes).
    pub fn see<'v>(&mut self, items: &[Aabb], view: impl Into<AnyVolume<'v>>) {
        let view = view.into();
        self.expect(scan(items, |b| view.sees(b)));
    }

    /// A question whose right answer is known.
    ///
    /// # Panics
    /// An id that is not below the number of items.
    pub fn expect(&mut self, right: impl IntoIterator<Item = ItemId>) {
        self.stamp += 2;
        self.expected = 0;
        for id in right {
            self.marks[id as usize] = self.stamp;
            self.expected += 1;
        }
    }

    /// Number of items of the right answer.
    pub fn expected(&self) -> usize {
        self.expected
    }

    /// Puts the question to a structure, which appends its answer to an empty
    /// list. O(answer) if it is right.
    ///
    /// # Errors
    /// A panic, or how the answer differs.
    pub fn ask(&mut self, ask: impl FnOnce(&mut Vec<ItemId>)) -> Result<&[ItemId], Fault> {
        self.answer.clear();
        caught(|| ask(&mut self.answer)).map_err(Fault::Panicked)?;
        let difference = self.compare();
        match difference.is_none() {
            true => Ok(&self.answer),
            false => Err(Fault::Differs(difference)),
        }
    }

    /// The last answer, right or wrong.
    pub fn answer(&self) -> &[ItemId] {
        &self.answer
    }

    /// Compares the answer, in any order, with the reference. O(items) in the worst
    /// case, O(answer) if it is right.
    fn compare(&mut self) -> Difference {
        let found = &self.answer;
        let mut difference = Difference::default();
        let mut right = 0;
        for &id in found {
            let bad = match self.marks.get_mut(id as usize) {
                Some(mark) if *mark == self.stamp => {
                    *mark += 1;
                    right += 1;
                    continue;
                }
                Some(mark) if *mark == self.stamp + 1 => &mut difference.invalid,
                Some(_) => &mut difference.extra,
                None => &mut difference.invalid,
            };
            *bad += 1;
            difference.first.get_or_insert(id);
        }
        difference.missing = self.expected - right;
        if difference.missing > 0 {
            let lost = self.marks.iter().position(|mark| *mark == self.stamp);
            difference.first = lost.map(|id| id as ItemId);
        }
        // Ready for the next structure.
        for &id in found {
            let mark = self.marks.get_mut(id as usize);
            if let Some(mark) = mark.filter(|m| **m == self.stamp + 1) {
                *mark = self.stamp;
            }
        }
        difference
    }
}

impl Fault {
    /// The fault in words; `explain` says why an item is in the right answer or
    /// not.
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
        assert_eq!(trial.expected(), 2);
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
