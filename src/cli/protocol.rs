//! Messages between a command and its workers: one request, and lines of JSON in
//! answer. [`processes`](super::processes) is the parent's side,
//! [`worker`](super::worker) the child's.

use std::collections::BTreeMap;
use std::path::PathBuf;

use serde::{Deserialize, Serialize};

use crate::advise::TrialPlan;
use crate::funnel::FunnelPlan;
use crate::measure::{Part, ProcessTimes, Schedule, Share, TaskSamples};
use crate::precision::PointPlan;

/// Raised when requests or messages change: programs of different versions do
/// not understand each other.
pub const PROTOCOL: u32 = 5;

/// Work of one process.
#[derive(Clone, Serialize, Deserialize)]
pub struct Request {
    pub protocol: u32,
    /// The arguments of the command, from which all else follows.
    pub args: Vec<String>,
    /// Files that stand for pipes that only the parent can read.
    pub spooled: BTreeMap<String, PathBuf>,
    /// SHA-256 of the files that the parent has read, to be found the same.
    #[serde(default)]
    pub files: BTreeMap<String, String>,
    pub job: Job,
    /// The processor to stay on.
    pub cpu: Option<usize>,
    /// Decides on where its memory lies: another number for every process.
    pub layout: u64,
}

/// One process's share of what a command measures.
#[derive(Clone, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Job {
    /// Structures on a scene, by its index in the plan (`run`, `compare`,
    /// `advise`).
    Scene {
        scene: usize,
        share: Share,
        /// True to receive samples beside the parts.
        samples: bool,
    },
    /// Both sides of every rule (`advise`).
    Trials(TrialPlan, Timing),
    /// All points (`precision`).
    Points(PointPlan, Timing),
    /// Frames, eyes and arms (`drift`).
    Drift(Schedule, Timing),
    /// Every stage of the funnel with every back end (`funnel`).
    Funnel(FunnelPlan, Timing),
    /// One stage with every back end (`precision --stage`).
    Sweep(FunnelPlan, Timing),
}

/// Parameters of a process beside its plan.
#[derive(Clone, Copy, Serialize, Deserialize)]
pub struct Timing {
    pub process: u32,
    /// Scale of the lens of a path with a given visible share.
    pub lens_scale: Option<f64>,
}

/// A line from a worker.
#[derive(Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Message {
    /// The first line.
    Ready {
        protocol: u32,
    },
    /// The next step, and its structure.
    Doing {
        structure: Option<String>,
        step: String,
    },
    Part(Box<Part>, Vec<TaskSamples>),
    Times(ProcessTimes),
    /// The scene or a path cannot be had.
    Failed(String),
    /// The share is done.
    Done,
}
