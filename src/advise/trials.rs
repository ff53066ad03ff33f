//! Tasks of the rules and of the choice of a test.
//!
//! Every process enters them in the same order; one runs and compares them; all time them
//! side by side.

use std::ops::Deref;

use super::case::Case;
use super::omission::{Check, Side};
use crate::culling::CameraView;
use crate::index::DynIndex;
use crate::measure::{Answer, Ask, OverProcesses, TimedTask};
use crate::query::ItemId;
use crate::verify::ErrorCount;

/// The task that all others are compared with: the fastest tree, six planes, f32.
pub const BASE: usize = 0;

pub struct Trials<'c> {
    pub case: &'c Case<'c>,
    /// Tasks, and whether each is compared with the truth.
    asks: Vec<(Ask<'c>, bool)>,
}

/// Answers of all tasks.
pub struct Answered {
    /// The answers by task and camera.
    pub answers: Vec<Vec<Answer>>,
    /// Errors of each judged camera, of tasks that are compared with the truth.
    errors: Vec<Option<Vec<ErrorCount>>>,
}

impl<'c> Trials<'c> {
    pub fn new(case: &'c Case<'c>) -> Self {
        let mut trials = Trials {
            case,
            asks: Vec::new(),
        };
        trials.add_base();
        trials
    }

    /// Enters the base (again); the index of the task.
    pub fn add_base(&mut self) -> usize {
        let case = self.case;
        self.index(&*case.index, &case.workload.views[..])
    }

    /// Enters a task; its index.
    ///
    /// It is judged if its answers are items of the scene in view.
    pub fn enter(&mut self, is_judged: bool, ask: impl Fn(usize, &mut Vec<ItemId>) + 'c) -> usize {
        self.asks.push((Box::new(ask), is_judged));
        self.asks.len() - 1
    }

    /// Enters an index that is queried with the given views; its index among the tasks.
    pub fn index(
        &mut self,
        index: impl Deref<Target = dyn DynIndex> + 'c,
        views: impl Deref<Target = [CameraView]> + 'c,
    ) -> usize {
        self.enter(true, move |camera, out| {
            index.query(views[camera].as_any(), out)
        })
    }

    /// Runs every task for every camera, and compares with the truth.
    pub fn answered(&self) -> Answered {
        let truths = self.case.truths();
        let mut answered = Answered {
            answers: Vec::with_capacity(self.asks.len()),
            errors: Vec::with_capacity(self.asks.len()),
        };
        let mut out: Vec<ItemId> = Vec::new();
        for (ask, is_judged) in &self.asks {
            let mut errors = is_judged.then(Vec::new);
            let mut truths = truths.iter().peekable();
            let answers = (0..self.case.cameras()).map(|camera| {
                out.clear();
                ask(camera, &mut out);
                let truth = truths.next_if(|(judged, _)| *judged == camera);
                if let (Some(errors), Some((_, truth))) = (&mut errors, truth) {
                    errors.push(truth.errors(&self.case.scene().items, &out));
                }
                Answer::of(&out)
            });
            answered.answers.push(answers.collect());
            answered.errors.push(errors);
        }
        answered
    }

    /// All tasks, to be timed.
    pub fn tasks(self, answers: &[Vec<Answer>]) -> Vec<TimedTask<'c>> {
        let asks = self.asks.into_iter().zip(answers);
        let tasks = asks.map(|((ask, _), answers)| {
            let counts = answers.iter().map(|answer| answer.count);
            TimedTask::new(counts.collect(), ask)
        });
        tasks.collect()
    }
}

impl Answered {
    /// Errors of a task over all judged cameras.
    pub fn errors(&self, task: usize) -> Option<ErrorCount> {
        Some(self.by_camera(task)?.iter().copied().sum())
    }

    /// Mean of the judged cameras.
    pub fn false_positives_per_query(&self, task: usize) -> Option<f64> {
        let judged = self.by_camera(task).filter(|own| !own.is_empty())?.len();
        Some(self.errors(task)?.false_positives as f64 / judged as f64)
    }

    /// Errors of a task, by judged camera.
    pub fn by_camera(&self, task: usize) -> Option<&[ErrorCount]> {
        self.errors[task].as_deref()
    }
}

/// The two sides of a check, by their tasks.
pub struct Sides {
    on: String,
    kept: usize,
    left_out: usize,
}

impl Sides {
    pub fn new(on: impl ToString, kept: usize, left_out: usize) -> Sides {
        Sides {
            on: on.to_string(),
            kept,
            left_out,
        }
    }

    /// The check; NaN where a task has no time, after a panic.
    pub fn check(self, answered: &Answered, times: &OverProcesses) -> Check {
        let side = |task| {
            let errors = answered.errors(task);
            Side {
                ns: times.ns(task).map_or(f64::NAN, |found| found.value),
                excess: errors.and_then(|e| e.excess()),
                false_positives_per_query: answered.false_positives_per_query(task),
                false_negative_ppm: errors.and_then(|e| e.false_negative_ppm()),
            }
        };
        Check {
            kept: side(self.kept),
            left_out: side(self.left_out),
            ratio: times.ratio(self.kept, self.left_out),
            on: self.on,
            same_answers: answered.answers[self.kept] == answered.answers[self.left_out],
        }
    }
}
