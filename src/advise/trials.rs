//! Tasks of the rules and of the choice of a test.
//!
//! Every process enters them in the same order; one runs and compares them; all time them
//! side by side.

use std::ops::Deref;

use super::case::Case;
use super::omission::{Check, is_longer};
use crate::culling::CameraView;
use crate::index::DynIndex;
use crate::measure::{Ask, OverProcesses, TimedTask};
use crate::query::ItemId;
use crate::verify::{ErrorCount, Trial};

/// The task that all others are compared with: the fastest tree, six planes, f32.
pub const BASE: usize = 0;

pub struct Trials<'c> {
    pub case: &'c Case<'c>,
    /// Tasks, and whether each is compared with the truth.
    asks: Vec<(Ask<'c>, bool)>,
    /// CPU time of work that each process does once, ns.
    pub once_ns: Vec<f64>,
}

/// Answers of all tasks.
pub struct Answered {
    /// Number of ids, by task and camera.
    pub counts: Vec<Vec<u64>>,
    /// Errors of each judged camera, of tasks that are compared with the truth.
    errors: Vec<Option<Vec<ErrorCount>>>,
    /// Number of judged cameras.
    pub judged: usize,
}

impl<'c> Trials<'c> {
    pub fn new(case: &'c Case<'c>) -> Self {
        let mut trials = Trials {
            case,
            asks: Vec::new(),
            once_ns: Vec::new(),
        };
        trials.add_base();
        trials
    }

    /// Enters the base (again); the index of the task.
    pub fn add_base(&mut self) -> usize {
        let case = self.case;
        self.index(&*case.index, case.views())
    }

    /// Enters a task whose answers are items of the scene in view; its index.
    pub fn judged(&mut self, ask: impl Fn(usize, &mut Vec<ItemId>) + 'c) -> usize {
        self.asks.push((Box::new(ask), true));
        self.asks.len() - 1
    }

    /// Enters a task that is not compared with the truth of the frustum; its index.
    pub fn unjudged(&mut self, ask: impl Fn(usize, &mut Vec<ItemId>) + 'c) -> usize {
        self.asks.push((Box::new(ask), false));
        self.asks.len() - 1
    }

    /// Enters an index that is queried with the given views; its index among the tasks.
    pub fn index(
        &mut self,
        index: impl Deref<Target = dyn DynIndex> + 'c,
        views: impl Deref<Target = [CameraView]> + 'c,
    ) -> usize {
        self.judged(move |camera, out| index.query(views[camera].as_any(), out))
    }

    /// Runs every task for every camera, and compares with the truth.
    pub fn answered(&self) -> Answered {
        let truths = self.case.truths();
        let mut answered = Answered {
            counts: Vec::with_capacity(self.asks.len()),
            errors: Vec::with_capacity(self.asks.len()),
            judged: truths.len(),
        };
        let mut out: Vec<ItemId> = Vec::new();
        for (ask, is_judged) in &self.asks {
            let mut errors = is_judged.then(Vec::new);
            let mut truths = truths.iter().peekable();
            let counts = (0..self.case.cameras()).map(|camera| {
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

    /// Finds out whether two sides answer the same.
    pub fn compare(&self, sides: &mut Sides) {
        let [kept, left_out] = [sides.kept, sides.left_out].map(|task| &self.asks[task].0);
        let mut trial = Trial::new(self.case.scene().items.len());
        let mut first = Vec::new();
        sides.check.same_answers = (0..self.case.cameras()).all(|camera| {
            first.clear();
            kept(camera, &mut first);
            trial.expect(first.iter().copied());
            trial.ask(|out| left_out(camera, out)).is_ok()
        });
    }

    /// All tasks, to be timed.
    pub fn tasks(self, counts: &[Vec<u64>]) -> Vec<TimedTask<'c>> {
        let asks = self.asks.into_iter().zip(counts);
        asks.map(|((ask, _), counts)| TimedTask::new(counts.clone(), ask))
            .collect()
    }

    pub fn len(&self) -> usize {
        self.asks.len()
    }
}

impl Answered {
    /// Errors of a task over all judged cameras.
    pub fn errors(&self, task: usize) -> Option<ErrorCount> {
        Some(self.by_camera(task)?.iter().copied().sum())
    }

    /// Errors of a task, by judged camera.
    pub fn by_camera(&self, task: usize) -> Option<&[ErrorCount]> {
        self.errors[task].as_deref()
    }
}

/// The two sides of a check, by their tasks.
pub struct Sides {
    pub kept: usize,
    pub left_out: usize,
    /// The check before its times.
    check: Check,
}

impl Sides {
    /// Two sides that may differ.
    pub fn new(on: impl ToString, kept: usize, left_out: usize) -> Sides {
        let check = Check {
            on: on.to_string(),
            ..Check::default()
        };
        Sides {
            kept,
            left_out,
            check,
        }
    }

    /// Two sides that must answer the same.
    pub fn same(on: impl ToString, kept: usize, left_out: usize) -> Sides {
        let mut sides = Sides::new(on, kept, left_out);
        sides.check.same_expected = true;
        sides
    }

    /// The check; NaN where a task has no time, after a panic.
    pub fn check(self, answered: &Answered, times: &OverProcesses) -> Check {
        let (kept, left_out) = (self.kept, self.left_out);
        let ns = |task| times.ns(task).map_or(f64::NAN, |found| found.value);
        let errors = [kept, left_out].map(|task| answered.errors(task));
        let ratio = times.ratio(kept, left_out);
        let excess = |errors: &Option<ErrorCount>| errors.as_ref().and_then(ErrorCount::excess);
        let missed = |errors: &Option<ErrorCount>| errors.and_then(|e| e.false_negative_ppm());
        Check {
            kept_ns: ns(kept),
            left_out_ns: ns(left_out),
            ratio,
            kept_excess: excess(&errors[0]),
            left_out_excess: excess(&errors[1]),
            kept_false_negative_ppm: missed(&errors[0]),
            left_out_false_negative_ppm: missed(&errors[1]),
            errors: errors[0].zip(errors[1]).map(|(kept, left)| [kept, left]),
            judged: answered.judged,
            pays: ratio.and_then(is_longer),
            ..self.check
        }
    }
}
