//! Keyed tasks of one timed pass: times are found by key, never by position. With
//! their schedule, which goes to the other processes.

use serde::{Deserialize, Serialize};

use super::{Protocol, Schedule, TimedTask};

/// Tasks of one timed pass, in the order in which they are pushed.
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

    /// Schedule for the tasks, for `cameras` cameras; with a `given` one, its plan of
    /// those tasks that are here. Tasks that `given` does not have are dropped.
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
