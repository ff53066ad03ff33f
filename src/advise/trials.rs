//! All ways to answer that the rules and the choice of a test need. They are
//! entered in the same order in every process; asked, compared and judged in one,
//! timed side by side in all. What the figures mean is decided elsewhere.

use super::case::Case;
use super::omission::{Aside, Check, Draft, Finish, Omission, Way};
use crate::measure::{Ask, OverProcesses, TimedTask};
use crate::query::ItemId;
use crate::statistics::Estimate;
use crate::verify::{ErrorCount, Trial};

/// The place of [`Way::Base`].
pub(super) const BASE: usize = 0;

pub(super) struct Trials<'c> {
    case: &'c Case<'c>,
    asks: Vec<Ask<'c>>,
    /// By place: whether the truth judges it.
    judged: Vec<bool>,
}

/// A rule whose ways are entered, waiting for its times.
pub(super) struct Entered {
    omission: Omission,
    checks: Vec<Place>,
    pairs: Vec<[usize; 2]>,
    /// Where its [`Draft::once_ns`] are among those of all rules.
    once: std::ops::Range<usize>,
    finish: Option<Finish>,
}

/// The places of the two sides of a check.
struct Place {
    on: String,
    kept: usize,
    left_out: usize,
    same_expected: bool,
    same_answers: bool,
}

/// What all ways have answered.
pub(super) struct Answered {
    /// By place and camera: ids.
    pub counts: Vec<Vec<u64>>,
    /// By place, of those that are judged, and by judged camera.
    errors: Vec<Option<Vec<ErrorCount>>>,
    /// Cameras behind the errors.
    pub judged: usize,
}

impl<'c> Trials<'c> {
    pub fn new(case: &'c Case<'c>) -> Self {
        let mut trials = Trials {
            case,
            asks: Vec::new(),
            judged: Vec::new(),
        };
        trials.add_base();
        trials
    }

    /// What all else is compared with, or that once more; its place.
    pub fn add_base(&mut self) -> usize {
        let (index, views) = (self.case.index.as_ref(), &self.case.workload.views);
        self.add(
            Box::new(move |n, out| index.query(views[n].as_any(), out)),
            true,
        )
    }

    /// The place of the way.
    pub fn add(&mut self, ask: Ask<'c>, judged: bool) -> usize {
        self.asks.push(ask);
        self.judged.push(judged);
        self.asks.len() - 1
    }

    fn place(&mut self, way: Way<'c>, judged: bool) -> usize {
        match way {
            Way::Base => BASE,
            Way::Other(ask) => self.add(ask, judged),
        }
    }

    /// Enters all ways of a rule; `once_ns` are those of the rules before.
    pub fn enter(&mut self, draft: Draft<'c>, once_ns: &mut Vec<f64>) -> Entered {
        let checks = draft.forced.into_iter().map(|forced| Place {
            on: forced.on,
            kept: self.place(forced.kept, forced.judged),
            left_out: self.place(forced.left_out, forced.judged),
            same_expected: forced.same,
            same_answers: false,
        });
        let checks = checks.collect();
        let pairs = draft.pairs.into_iter();
        let first = once_ns.len();
        once_ns.extend(draft.once_ns);
        Entered {
            omission: draft.omission,
            checks,
            pairs: pairs
                .map(|pair| pair.map(|way| self.place(way, false)))
                .collect(),
            once: first..once_ns.len(),
            finish: draft.finish,
        }
    }

    /// Asks every camera once, and judges.
    pub fn answered(&self) -> Answered {
        let cameras = self.case.workload.views.len();
        let truths = self.case.truths();
        let mut answered = Answered {
            counts: Vec::with_capacity(self.asks.len()),
            errors: Vec::with_capacity(self.asks.len()),
            judged: truths.len(),
        };
        let mut out: Vec<ItemId> = Vec::new();
        for (ask, &judged) in self.asks.iter().zip(&self.judged) {
            let mut errors = judged.then(Vec::new);
            let mut truths = truths.iter().peekable();
            let counts = (0..cameras).map(|camera| {
                out.clear();
                ask(camera, &mut out);
                let truth = truths.next_if(|(judged, _)| *judged == camera);
                if let (Some(errors), Some((_, truth))) = (&mut errors, truth) {
                    errors.push(truth.errors(&self.case.scene().items, &out));
                }
                out.len() as u64
            });
            answered.counts.push(counts.collect());
            answered.errors.push(errors);
        }
        answered
    }

    /// Finds out which sides of a rule answer the same.
    pub fn compare(&self, entered: &mut Entered) {
        for check in &mut entered.checks {
            check.same_answers = self.same_answers(check.kept, check.left_out);
        }
    }

    fn same_answers(&self, a: usize, b: usize) -> bool {
        let mut trial = Trial::new(self.case.scene().items.len());
        let mut first = Vec::new();
        (0..self.case.workload.views.len()).all(|camera| {
            first.clear();
            (self.asks[a])(camera, &mut first);
            trial.expect(first.iter().copied());
            trial.ask(|out| (self.asks[b])(camera, out)).is_ok()
        })
    }

    /// All ways, ready to be timed.
    pub fn tasks(self, counts: &[Vec<u64>]) -> Vec<TimedTask<'c>> {
        let asks = self.asks.into_iter().zip(counts);
        asks.map(|(ask, counts)| TimedTask::new(counts.clone(), ask))
            .collect()
    }

    pub fn len(&self) -> usize {
        self.asks.len()
    }
}

impl Entered {
    /// What follows from the times.
    pub fn settled(self, answered: &Answered, times: &OverProcesses) -> Omission {
        let ratio = |[a, b]: &[usize; 2]| times.ratio(*a, *b).map_or(f64::NAN, |r| r.value);
        let aside = Aside {
            ratios: self.pairs.iter().map(ratio).collect(),
            once_ratio: match self.once.len() {
                2 => times.once_ratio(self.once.start + 1, self.once.start),
                _ => None,
            },
            once_ns: self.once.map(|i| times.once_ns(i)).collect(),
        };
        let checks = self.checks.into_iter();
        let checks = checks.map(|check| check.timed(answered, times)).collect();
        self.omission.settled(checks, &aside, self.finish)
    }
}

impl Place {
    /// NaN where something could not be timed: a panic on the way.
    fn timed(self, answered: &Answered, times: &OverProcesses) -> Check {
        let of = |side: usize| times.ns(side).map_or(f64::NAN, |found| found.value);
        let ratio = times.ratio(self.kept, self.left_out);
        let ratio = |part: fn(&Estimate) -> f64| ratio.as_ref().map_or(f64::NAN, part);
        let [kept, left_out] = [self.kept, self.left_out].map(|side| answered.errors(side));
        let excess = |errors: Option<ErrorCount>| errors.and_then(|e| e.excess());
        let missed = |errors: Option<ErrorCount>| errors.and_then(|e| e.false_negative_ppm());
        let faster = times.is_faster(self.left_out, self.kept);
        let slower = times.is_faster(self.kept, self.left_out);
        Check {
            kept_ns: of(self.kept),
            left_out_ns: of(self.left_out),
            ratio: ratio(|r| r.value),
            ratio_lower: ratio(|r| r.lower.unwrap_or(f64::NAN)),
            ratio_upper: ratio(|r| r.upper.unwrap_or(f64::NAN)),
            same_answers: self.same_answers,
            same_expected: self.same_expected,
            kept_excess: excess(kept),
            left_out_excess: excess(left_out),
            kept_false_negative_ppm: missed(kept),
            left_out_false_negative_ppm: missed(left_out),
            errors: kept.zip(left_out).map(|(kept, left)| [kept, left]),
            judged: answered.judged,
            pays: (faster || slower).then_some(faster),
            on: self.on,
        }
    }
}

impl Answered {
    /// Of all judged cameras.
    pub fn errors(&self, place: usize) -> Option<ErrorCount> {
        let mut sum = ErrorCount::default();
        self.by_camera(place)?.iter().for_each(|own| sum += *own);
        Some(sum)
    }

    /// Of each judged camera.
    pub fn by_camera(&self, place: usize) -> Option<&[ErrorCount]> {
        self.errors[place].as_deref()
    }
}
