//! Faults of one generated case, and the queries that compare structures with
//! the scalar loop.

use crate::index::{DynIndex, Input, StructureSpec};
use crate::query::{AnyVolume, ItemId};
use crate::stress::{Level, Row, Status};
use crate::verify::{self, Trial};

/// Name of the scalar loop in place of a structure.
pub const SCALAR: &str = "scalar";

/// Sums over cases.
#[derive(Clone, Copy, Default, PartialEq, Debug)]
pub struct Tally {
    /// Boxes judged at camera level.
    pub boxes: u64,
    /// Boxes that are in or touch.
    pub seen: u64,
    /// Boxes that touch, to all that is known.
    pub ties: u64,
    /// Ties that the oracle cannot prove.
    pub undecided: u64,
    /// Boxes that reach into the view and were not returned.
    pub false_negatives: u64,
    /// Boxes that touch the view and were not returned.
    pub touch_dropped: u64,
    /// Views that were refused because their sums could overflow.
    pub refused: u64,
    /// Boxes that the six planes would lose without their epsilon.
    pub lost_bare: u64,
}

impl std::ops::AddAssign for Tally {
    fn add_assign(&mut self, other: Tally) {
        self.boxes += other.boxes;
        self.seen += other.seen;
        self.ties += other.ties;
        self.undecided += other.undecided;
        self.false_negatives += other.false_negatives;
        self.touch_dropped += other.touch_dropped;
        self.refused += other.refused;
        self.lost_bare += other.lost_bare;
    }
}

/// A wrong answer, or none.
#[derive(Clone, PartialEq, Debug)]
pub struct Fault {
    /// Name of the structure, or [`SCALAR`].
    pub structure: String,
    /// Name of the culling test.
    pub test: String,
    /// Index of the box; `None` where the whole answer is wrong.
    pub item: Option<usize>,
    /// Answer of the oracle.
    pub expected: String,
    /// Answer of the structure.
    pub got: String,
    /// The box and the truth about it, so that a reader can check by hand.
    about: Option<String>,
}

impl Fault {
    /// A row for the fault, and one for its box.
    pub(super) fn rows(self, id: &str, level: Level) -> Vec<Row> {
        let about = self.item.zip(self.about);
        let about = about.map(|(item, about)| (format!("{id}/box {item}"), about));
        let row = |(id, got): (String, String)| Row {
            id,
            level,
            structure: self.structure.clone(),
            test: self.test.clone(),
            status: Status::Fail,
            expected: self.expected.as_str().into(),
            got: got.into(),
        };
        let whole = (id.to_owned(), self.got);
        [Some(whole), about]
            .into_iter()
            .flatten()
            .map(row)
            .collect()
    }
}

/// Structures by their labels, built over the boxes of a case.
pub type Built<'s> = Vec<(&'s str, Box<dyn DynIndex>)>;

/// Checks of one case and their faults.
#[derive(Clone, Default, Debug)]
pub struct Findings {
    /// Number of boxes.
    pub boxes: u64,
    /// Verdicts of the oracle at camera level.
    pub tally: Tally,
    /// Structure and test of every check.
    pub checked: Vec<[String; 2]>,
    /// Faults in the order in which they were found.
    pub faults: Vec<Fault>,
}

impl Findings {
    /// Notes a check of a structure, or of the scalar loop, by a test.
    pub fn check(&mut self, subject: [&str; 2]) {
        self.checked.push(subject.map(str::to_owned));
    }

    /// Notes a wrong answer.
    pub fn fault(
        &mut self,
        [structure, test]: [&str; 2],
        item: Option<usize>,
        expected: impl Into<String>,
        got: String,
    ) {
        self.faults.push(Fault {
            structure: structure.to_owned(),
            test: test.to_owned(),
            item,
            expected: expected.into(),
            got,
            about: None,
        });
    }

    /// Builds all structures. A build that fails is a fault.
    pub fn built<'s>(&mut self, structures: &'s [StructureSpec], input: Input<'_>) -> Built<'s> {
        let mut built = Vec::with_capacity(structures.len());
        for spec in structures {
            match spec.build(input) {
                Ok(index) => built.push((spec.label.as_str(), index)),
                Err(error) => self.fault([&spec.label, "build"], None, "built", error.to_string()),
            }
        }
        built
    }

    /// Compares every structure with the scalar loop, which `seen` has the answer of.
    pub fn compare(&mut self, built: &Built, test: &str, volume: AnyVolume<'_>, seen: &[bool]) {
        let mut trial = Trial::new(seen.len());
        let wanted = seen.iter().zip(0..).filter(|(seen, _)| **seen);
        trial.expect(wanted.map(|(_, id): (_, ItemId)| id));
        for (structure, index) in built {
            self.check([structure, test]);
            match trial.ask(|out| index.query(volume, out)).map(drop) {
                Ok(()) => {}
                Err(verify::Fault::Panicked(text)) => {
                    let got = format!("panicked: {text}");
                    self.fault([structure, test], None, "an answer", got);
                }
                Err(verify::Fault::Differs(difference)) => {
                    let item = difference.first.map(|id| id as usize);
                    let item = item.filter(|&item| item < seen.len());
                    let expected = format!("the {} items of the scalar loop", trial.expected());
                    self.fault([structure, test], item, expected, difference.to_string());
                }
            }
        }
    }

    /// Adds a description to each fault of a box.
    pub fn described(mut self, describe: impl Fn(usize) -> String) -> Findings {
        for fault in &mut self.faults {
            fault.about = fault.item.map(&describe);
        }
        self
    }
}
