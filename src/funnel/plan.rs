//! What the processes of a study time, and how one of them does.

use serde::{Deserialize, Serialize};

use super::world::FunnelInput;
use crate::measure::{Ask, ProcessTimes, Schedule, TimedTask, timed};

/// What all processes time: the plan is the same for each.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct FunnelPlan {
    schedule: Schedule,
    /// By task and view: how much is handed on.
    pub(super) expected: Vec<Vec<u64>>,
}

impl FunnelPlan {
    /// For tasks over so many views.
    pub fn of(tasks: &[TimedTask], views: usize, input: &FunnelInput) -> FunnelPlan {
        FunnelPlan {
            schedule: Schedule::new(views, tasks, input.protocol),
            expected: tasks.iter().map(|task| task.expected.clone()).collect(),
        }
    }

    /// One process's share of the times; `None` if stopped.
    pub fn time(
        &self,
        tasks: &[TimedTask],
        input: &FunnelInput,
        stop: &dyn Fn() -> bool,
    ) -> Option<ProcessTimes> {
        let timed = timed(tasks, &self.schedule, input.protocol, &|_| stop())?;
        Some(ProcessTimes::of(&timed))
    }
}

/// A task that must hand on so much in each view.
pub fn task<'w>(ask: Ask<'w>, expected: Vec<u64>) -> TimedTask<'w> {
    TimedTask {
        ask,
        ask_many: None,
        expected,
        least_ns: None,
    }
}
