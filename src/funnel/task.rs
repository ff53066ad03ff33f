//! Timed tasks of a study by key: plan, timed pass, and times over the processes.

use std::collections::HashMap;

use serde::{Deserialize, Serialize};

use super::setup::FunnelInput;
use super::stage::{StageKind, Step};
use crate::measure::{ProcessTimes, QueryFn, StudyPlan, TimedTask};

named! {
    /// A picking query at a cursor.
    #[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, Default)]
    #[derive(Debug, Serialize, Deserialize)]
    pub enum PickQuestion {
        /// First item along the ray.
        #[default]
        #[serde(rename = "first item")]
        First = "first item",
        /// All items in the frustum of a small rectangle around the cursor.
        #[serde(rename = "all within 4 pixels")]
        Through = "all within 4 pixels",
    }
}

/// Identity of a timed task, the same in every process.
#[derive(Clone, PartialEq, Eq, Hash, Debug, Serialize, Deserialize)]
pub enum FunnelKey {
    /// The last of some item stages, applied to the output of the others.
    Steps(Vec<Step>),
    /// Back end of the triangle or fragment stage, after the chain's item stages.
    Stage(StageKind, String),
    /// Back end of picking.
    Pick(PickQuestion, String),
}

/// Task of the timed pass; the number of ids that it appends is checked.
pub type KeyedTask<'w> = (FunnelKey, QueryFn<'w>);

/// Tasks and schedule of the timed pass, the same for all processes.
pub type FunnelPlan = StudyPlan<FunnelKey>;

impl FunnelPlan {
    /// Runs every task once in each of `views` views and plans the timing.
    pub fn of(tasks: Vec<KeyedTask>, views: usize, input: &FunnelInput) -> FunnelPlan {
        let mut out = Vec::new();
        let mut count = |ask: &QueryFn, view| {
            out.clear();
            ask(view, &mut out);
            out.len() as u64
        };
        let tasks = tasks.into_iter().map(|(key, ask)| {
            let expected = (0..views).map(|view| count(&ask, view)).collect();
            (key, TimedTask::new(expected, ask))
        });
        StudyPlan::new(tasks.collect(), views, &input.setting.protocol)
    }

    /// Times the plan in one process.
    ///
    /// A planned task that this process does not have fails by its counts.
    pub fn time(&self, tasks: Vec<KeyedTask>, input: &FunnelInput) -> ProcessTimes {
        let mut asks: HashMap<FunnelKey, QueryFn> = tasks.into_iter().collect();
        let ask = |key: &FunnelKey| asks.remove(key).unwrap_or_else(|| Box::new(|_, _| ()));
        self.timed(&input.setting.protocol, ask)
    }
}
