//! Inputs of a study, and its plan of timed tasks.

use serde::{Deserialize, Serialize};

use super::{OverProcesses, ProcessTimes, Protocol, QueryFn, Schedule, TimedTask, timed};
use crate::index::StructureSpec;
use crate::path::CameraPath;
use crate::scene::Scene;

/// Inputs of a study, loaded.
pub struct Setting {
    /// Items.
    pub scene: Scene,
    /// Cameras.
    pub path: CameraPath,
    /// Structures to measure.
    pub structures: Vec<StructureSpec>,
    /// Rounds and times of a process.
    pub protocol: Protocol,
}

/// Timed tasks of a study by their keys, the same in every process.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct StudyPlan<K> {
    /// Tasks with the number of ids of each query.
    pub tasks: Vec<(K, Vec<u64>)>,
    /// Rounds and order of the tasks.
    pub schedule: Schedule,
}

impl<K> StudyPlan<K> {
    /// A plan of tasks with `queries` queries each.
    pub fn new(tasks: Vec<(K, TimedTask)>, queries: usize, protocol: &Protocol) -> StudyPlan<K> {
        let (keys, tasks): (Vec<_>, Vec<_>) = tasks.into_iter().unzip();
        let schedule = Schedule::new(queries, &tasks, protocol);
        let expected = tasks.into_iter().map(|task| task.expected);
        StudyPlan {
            tasks: keys.into_iter().zip(expected).collect(),
            schedule,
        }
    }

    /// Times of the tasks in this process; `ask` returns the query function of a key.
    pub fn timed<'a>(
        &self,
        protocol: &Protocol,
        mut ask: impl FnMut(&K) -> QueryFn<'a>,
    ) -> ProcessTimes {
        let tasks = self.tasks.iter();
        let tasks = tasks.map(|(key, expected)| TimedTask::new(expected.clone(), ask(key)));
        let tasks: Vec<_> = tasks.collect();
        ProcessTimes::of(&timed(&tasks, &self.schedule, protocol, &|_| ()))
    }
}

impl<K: Clone + PartialEq> StudyPlan<K> {
    /// Times of all processes.
    pub fn times(&self, processes: &[ProcessTimes]) -> OverProcesses<K> {
        let keys = self.tasks.iter().map(|(key, _)| key.clone());
        OverProcesses::keyed(keys.collect(), processes)
    }
}
