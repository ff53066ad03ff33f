//! All ways to answer that the rules and the choice of a test need, asked once
//! to be compared and judged, then timed side by side in the same rounds. What
//! the figures mean is decided elsewhere.

use super::case::Case;
use super::omission::{Check, Draft, Forced, Way};
use crate::measure::{Ask, Competitor, Timed, Verdict, paired_ratio, timed_rounds};
use crate::query::ItemId;
use crate::statistics::{Estimate, bootstrap_median};
use crate::verify::{ErrorCount, Trial};

/// The place of [`Way::Base`]; its twin comes last.
const BASE: usize = 0;

pub(super) struct Trials<'c> {
    case: &'c Case<'c>,
    asks: Vec<Ask<'c>>,
    answered: Vec<Answered>,
}

/// What one way has answered.
struct Answered {
    counts: Vec<u64>,
    errors: Option<ErrorCount>,
}

/// A check that waits for its times.
pub(super) struct Place {
    on: String,
    kept: usize,
    left_out: usize,
    same: bool,
    same_answers: bool,
}

impl<'c> Trials<'c> {
    pub fn new(case: &'c Case<'c>) -> Self {
        let mut trials = Trials {
            case,
            asks: Vec::new(),
            answered: Vec::new(),
        };
        trials.add(base(case), true);
        trials
    }

    /// Asks every camera once; the place of the way.
    pub fn add(&mut self, ask: Ask<'c>, judged: bool) -> usize {
        let case = self.case;
        let mut answered = Answered {
            counts: Vec::with_capacity(case.workload.views.len()),
            errors: judged.then(ErrorCount::default),
        };
        let mut truths = case.truths.iter().peekable();
        let mut out: Vec<ItemId> = Vec::new();
        for frame in 0..case.workload.views.len() {
            out.clear();
            ask(frame, &mut out);
            answered.counts.push(out.len() as u64);
            if let (Some(errors), Some((_, truth))) = (
                &mut answered.errors,
                truths.next_if(|(judged, _)| *judged == frame),
            ) {
                *errors += truth.errors(&case.scene().items, &out);
            }
        }
        self.asks.push(ask);
        self.answered.push(answered);
        self.asks.len() - 1
    }

    fn place(&mut self, way: Way<'c>, judged: bool) -> usize {
        match way {
            Way::Base => BASE,
            Way::Other(ask) => self.add(ask, judged),
        }
    }

    /// Enters both sides of every check of a rule.
    pub fn enter(&mut self, draft: &mut Draft<'c>) -> Vec<Place> {
        let forced = std::mem::take(&mut draft.forced);
        let entered = forced.into_iter().map(|forced| {
            let Forced {
                on,
                kept,
                left_out,
                same,
                judged,
            } = forced;
            let (kept, left_out) = (self.place(kept, judged), self.place(left_out, judged));
            Place {
                same_answers: self.same_answers(kept, left_out),
                on,
                kept,
                left_out,
                same,
            }
        });
        entered.collect()
    }

    fn same_answers(&self, a: usize, b: usize) -> bool {
        let mut trial = Trial::new(self.case.scene().items.len());
        let mut first = Vec::new();
        (0..self.case.workload.views.len()).all(|frame| {
            first.clear();
            (self.asks[a])(frame, &mut first);
            trial.expect(first.iter().copied());
            trial.ask(|out| (self.asks[b])(frame, out)).is_ok()
        })
    }

    /// Times everything; `None` if stopped.
    pub fn timed(self, stop: &dyn Fn() -> bool) -> Option<Times> {
        let Trials {
            case,
            mut asks,
            answered,
        } = self;
        asks.push(base(case));
        let places = (0..answered.len()).chain([BASE]);
        let competitors = asks.into_iter().zip(places).map(|(ask, place)| Competitor {
            ask,
            ask_many: None,
            expected: answered[place].counts.clone(),
            least_ns: None,
        });
        let competitors: Vec<Competitor> = competitors.collect();
        let count = case.workload.views.len();
        let mut timed = timed_rounds(count, &competitors, &case.protocol, stop)?;
        let twin = timed.pop();
        Some(Times {
            timed,
            twin,
            errors: answered.iter().map(|a| a.errors).collect(),
            judged: case.truths.len(),
        })
    }
}

fn base<'c>(case: &'c Case<'c>) -> Ask<'c> {
    let (index, views) = (case.index.as_ref(), &case.workload.views);
    Box::new(move |n, out| index.see(views[n].as_any(), out))
}

/// What the clock said.
pub(super) struct Times {
    timed: Vec<Result<Timed, Verdict>>,
    twin: Option<Result<Timed, Verdict>>,
    errors: Vec<Option<ErrorCount>>,
    /// Cameras behind the errors.
    pub judged: usize,
}

impl Times {
    /// How far the interval of the twin's ratio reaches from 1.
    pub fn noise_floor(&self) -> f64 {
        let twin = self.twin.as_ref().and_then(|twin| twin.as_ref().ok());
        let ratio = twin.and_then(|twin| paired_ratio(self.timed[BASE].as_ref().ok()?, twin));
        ratio.map_or(0.0, |r| (r.upper - 1.0).abs().max((r.lower - 1.0).abs()))
    }

    /// Time of a query of the way at that place.
    pub fn query(&self, place: usize) -> Option<Estimate> {
        bootstrap_median(
            &self.timed[place].as_ref().ok()?.round_means(|s| s.cpu_ns),
            1,
        )
    }

    pub fn errors(&self, place: usize) -> Option<ErrorCount> {
        self.errors[place]
    }

    /// NaN where something could not be timed: a panic on the way.
    pub fn check(&self, place: &Place) -> Check {
        let of = |side: usize| self.query(side).map_or(f64::NAN, |e| e.value);
        let sides = [place.kept, place.left_out];
        let ratio = match sides.map(|side| self.timed[side].as_ref().ok()) {
            [Some(kept), Some(left_out)] => paired_ratio(kept, left_out),
            _ => None,
        };
        let nothing = Estimate {
            value: f64::NAN,
            lower: f64::NAN,
            upper: f64::NAN,
        };
        let ratio = ratio.unwrap_or(nothing);
        let [kept, left_out] = sides.map(|side| self.errors[side]);
        let excess = |errors: Option<ErrorCount>| errors.and_then(|e| e.excess());
        let missed = |errors: Option<ErrorCount>| errors.and_then(|e| e.false_negative_ppm());
        Check {
            on: place.on.clone(),
            kept_ns: of(place.kept),
            left_out_ns: of(place.left_out),
            ratio: ratio.value,
            ratio_lower: ratio.lower,
            ratio_upper: ratio.upper,
            same_answers: place.same_answers,
            same_expected: place.same,
            kept_excess: excess(kept),
            left_out_excess: excess(left_out),
            kept_false_negative_ppm: missed(kept),
            left_out_false_negative_ppm: missed(left_out),
            errors: kept.zip(left_out).map(|(kept, left)| [kept, left]),
            judged: self.judged,
        }
    }
}
