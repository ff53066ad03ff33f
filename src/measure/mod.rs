//! Measurement: a count pass that verifies every answer, then a timed pass.
//!
//! Independent of how structures work and of how results are written.
//!
//! A [`Plan`] has groups of cells: a group is a scene, a path, a cache state and a culling
//! test ([`GroupKey`]), a cell is one structure in it. `measure_scene` runs in each process
//! of a run, and per group:
//!
//! 1. a [`Workload`]: the queries along the path; and [`Subject`]s: the built structures;
//! 2. [`measure`]: in the first process `count_pass` and `judge`, in the others a
//!    comparison of digests; then the timed pass, [`timed`], of [`TimedTask`]s by a
//!    [`Schedule`], in which the lower bounds [`BOUNDS`] take part;
//! 3. a [`Part`]: the results of this process for this group.
//!
//! [`Group::of`] derives the [`ReportCell`]s of a group from the parts of all processes.
//! Other studies time their own tasks with [`timed`] and `OverProcesses`.
//!
//! | files | contents |
//! |---|---|
//! | `experiment`, `key` | plan, groups and cells of a run; one process's share of a scene |
//! | `group`, `process_result` | measurement of one group in one process; its result, [`Part`] |
//! | `workload`, `index_under_test` | queries; built structures and their updates |
//! | `count` | count pass, oracle; digests of answers |
//! | `task`, `schedule` | one timed task; a keyed list of them; their schedule and order |
//! | `timing`, `clock` | timed pass, cold caches; clocks |
//! | `frames`, `moving` | groups whose items move: update and queries, frame by frame |
//! | `bounds` | lower bounds |
//! | `results`, `cell`, `metrics` | cells of a report from parts |
//! | `shared_work` | gain from threads |
//! | `over_processes`, `study` | times of a study's tasks over several processes; its options |
//! | `environment` | machine and toolchain |

mod bounds;
mod cell;
mod clock;
mod count;
mod environment;
mod experiment;
mod frames;
mod group;
mod index_under_test;
mod key;
mod metrics;
mod moving;
mod over_processes;
mod process_result;
mod results;
mod schedule;
mod study;
mod task;
mod timing;
mod workload;

use serde::{Deserialize, Serialize};

use crate::geometry::Aabb;
use crate::index::{BuildError, caught};
use crate::query::{AnyVolume, ItemId};
pub use crate::statistics::{median, slope, trimmed_mean};
use crate::verify::{Fault, Trial, explain_visibility};

pub use bounds::{BOUNDS, Bound};
pub use cell::{CellTimes, Metric, PathInfo, ReportCell, SamplesRef, SceneInfo, TwinEntry};
pub use clock::{Lap, Stopwatch};
pub use count::{Answer, Judged};
pub(crate) use count::{blamed, count_pass, judge, spread};
pub use environment::{Machine, Source, Toolchain};
pub use experiment::{Effort, ExperimentError, Extras, Plan, PlannedScene};
pub(crate) use experiment::{PathOf, Share, measure_loaded, measure_scene};
pub use frames::measure;
pub use group::GroupPlan;
pub(crate) use group::NO_ITEMS;
pub use index_under_test::{Built, Subject, move_share};
pub use key::{CellKey, GroupKey, TaskKind};
pub(crate) use metrics::METRICS;
pub(crate) use over_processes::{OverProcesses, ProcessTimes};
pub(crate) use process_result::TaskSamples;
pub use process_result::{Part, ReferenceResults, SubjectPart, TaskPart};
pub use results::Group;
pub(crate) use results::YARDSTICK;
pub use schedule::{KeyedSchedule, Protocol, Schedule, TaskPlan, cameras_within};
pub use study::Setting;
pub(crate) use study::StudyPlan;
pub(crate) use task::QueryFn;
pub use task::TimedTask;
pub use timing::{Sample, Timed, timed};
pub(crate) use workload::input_for;
pub use workload::{Workload, WorkloadError, input_of};

named! {
    /// Outcome of a cell. Gaps are always explicit.
    #[derive(Clone, Copy, Default, PartialEq, Eq, Debug, Serialize, Deserialize)]
    #[cfg_attr(test, derive(schemars::JsonSchema))]
    #[serde(rename_all = "snake_case")]
    #[non_exhaustive]
    pub enum Status {
        /// Every answer equals the reference.
        #[default]
        Ok = "ok",
        /// An answer contains ids it should not, or one twice.
        Wrong = "wrong",
        /// An answer lacks ids: false negatives.
        Unsafe = "unsafe",
        /// The structure cannot take this scene or these parameters.
        Refused = "refused",
        /// Not run, for a stated reason.
        LeftOut = "left_out",
        /// No progress for as long as `--timeout` allows.
        TimedOut = "timed_out",
        /// The structure's own code panicked, whether or not the process ended.
        Panicked = "panicked",
        /// The system ended its process, or refused it memory.
        OutOfMemory = "out_of_memory",
    }
}

impl Status {
    /// Status of a structure with a fault; a false negative outranks a false positive.
    pub fn of(fault: &Fault) -> Status {
        match fault {
            Fault::Panicked(_) => Status::Panicked,
            Fault::Differs(difference) if difference.missing > 0 => Status::Unsafe,
            Fault::Differs(_) => Status::Wrong,
        }
    }

    /// Returns true for a wrong answer (exit code 1).
    pub fn is_failure(self) -> bool {
        matches!(self, Status::Wrong | Status::Unsafe | Status::Panicked)
    }
}

/// Result of a check: a status with its reason.
#[derive(Clone, Default, PartialEq, Eq, Debug, Serialize, Deserialize)]
pub struct Verdict {
    /// The status.
    pub status: Status,
    /// Reason, in one line; `None` for [`Status::Ok`].
    pub reason: Option<String>,
}

impl Verdict {
    /// The verdict on a fault, described after its place.
    pub fn of(fault: &Fault, place: &str, explain: impl FnOnce(usize) -> Option<String>) -> Self {
        let told = fault.explained(explain);
        Verdict::new(Status::of(fault), format!("{place}{told}"))
    }

    /// Returns true for a right answer.
    pub fn is_ok(&self) -> bool {
        self.status == Status::Ok
    }

    /// A status other than [`Status::Ok`], with its reason.
    pub fn new(status: Status, reason: impl Into<String>) -> Self {
        let reason: String = reason.into();
        // Messages of panics have several lines.
        let lines: Vec<&str> = reason.lines().map(str::trim).collect();
        Verdict {
            status,
            reason: Some(lines.join(" ")),
        }
    }
}

/// Verdict of a structure that could not be built.
impl From<BuildError> for Verdict {
    fn from(error: BuildError) -> Verdict {
        let status = match error {
            BuildError::Panicked { .. } => Status::Panicked,
            BuildError::OutOfMemory { .. } => Status::OutOfMemory,
            _ => Status::Refused,
        };
        Verdict::new(status, error.to_string())
    }
}

/// Runs code of a structure; a panic becomes [`Status::Panicked`] with its message.
pub fn guarded<T>(work: impl FnOnce() -> T) -> Result<T, Verdict> {
    caught(work).map_err(|text| Verdict::new(Status::Panicked, format!("panicked: {text}")))
}

/// Compares one answer with the reference scan; `place` names the query.
fn compare_with_scan(
    items: &[Aabb],
    volume: AnyVolume,
    place: &str,
    answer: impl FnOnce(&mut Vec<ItemId>),
) -> Result<(), Verdict> {
    let mut trial = Trial::new(items.len());
    trial.set_view(items, volume);
    trial.run(answer).map(drop).map_err(|fault| {
        let why = |id: usize| Some(explain_visibility(items.get(id)?, volume));
        Verdict::of(&fault, &format!("{place}: "), why)
    })
}

/// Step that is reported at every turn of a timed pass.
pub const TIMING: &str = "timing";

/// Callback that gets each step of a process, for progress and time limits.
///
/// Its arguments are the structure, `None` for steps without one, and the step. A long step is
/// reported repeatedly.
pub type Notice<'n> = &'n dyn Fn(Option<&str>, &str);
