//! The list of tasks of a timed pass, with a key per task (`task` has the task).
//!
//! Times are found by key, never by position. [`KeyedSchedule`] is the schedule that other
//! processes get.

use serde::{Deserialize, Serialize};

use super::{Protocol, Schedule, TimedTask};

/// Tasks of one timed pass and their keys, in the order in which they are pushed.
pub struct Tasks<'a, K> {
    keys: Vec<K>,
    tasks: Vec<TimedTask<'a>>,
}

/// A schedule with the keys of its tasks.
#[derive(Clone, PartialEq, Debug, Serialize, Deserialize)]
pub struct KeyedSchedule<K> {
    /// Keys of the tasks, in the order of the schedule.
    #[serde(rename = "names")]
    pub keys: Vec<K>,
    /// Cameras, batches and rounds.
    pub schedule: Schedule,
}

impl<K> Default for Tasks<'_, K> {
    fn default() -> Self {
        Tasks {
            keys: Vec::new(),
            tasks: Vec::new(),
        }
    }
}

impl<'a, K: PartialEq> Tasks<'a, K> {
    /// Adds a task.
    pub fn push(&mut self, key: K, task: TimedTask<'a>) {
        debug_assert!(!self.keys.contains(&key), "each key once");
        self.keys.push(key);
        self.tasks.push(task);
    }

    /// Keys in the order of the tasks: what [`OverProcesses::keyed`] takes.
    ///
    /// [`OverProcesses::keyed`]: super::OverProcesses::keyed
    pub fn keys(&self) -> &[K] {
        &self.keys
    }

    /// The tasks, as [`Schedule::new`] and [`timed`](super::timed) take them.
    pub fn tasks(&self) -> &[TimedTask<'a>] {
        &self.tasks
    }

    /// Makes the schedule of the tasks for `cameras` cameras.
    ///
    /// With a `given` schedule, returns its part for these tasks and drops the tasks
    /// that it does not have.
    pub fn schedule(
        &mut self,
        given: Option<&KeyedSchedule<K>>,
        cameras: usize,
        protocol: &Protocol,
    ) -> Schedule {
        let Some(given) = given else {
            return Schedule::new(cameras, &self.tasks, protocol);
        };
        let mut kept = Vec::new();
        let Tasks { keys, tasks } = std::mem::take(self);
        for (key, task) in keys.into_iter().zip(tasks) {
            if let Some(position) = given.keys.iter().position(|planned| *planned == key) {
                kept.push(position);
                self.push(key, task);
            }
        }
        given.schedule.of_tasks(&kept)
    }
}
