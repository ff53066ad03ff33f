//! [`Part`]: the results of one process for one group of cells.
//!
//! Plain data, passed between processes and written to the stream of a run. `results` makes the
//! cells of a report from the parts of all processes.

use std::collections::BTreeMap;

use serde::{Deserialize, Serialize};
use serde_json::Value;

use crate::index::{Kind, Origin, StructureSpec};

use super::key::Pass;
use super::{
    Answer, GroupKey, Judged, KeyedSchedule, PathInfo, Sample, SceneInfo, Subject, TaskKind,
    Verdict, guarded,
};

/// Results of one process for one group of cells.
#[derive(Clone, Default, PartialEq, Debug, Serialize, Deserialize)]
pub struct Part {
    /// Key of the group.
    pub key: GroupKey,
    /// Number of the process; the first, 0, counts and plans.
    pub process: u32,
    /// The scene, in the form of reports.
    pub scene: SceneInfo,
    /// The path, in the form of reports.
    pub path: PathInfo,
    /// Answers and schedules for the other processes; from the first process only.
    pub known: Option<ReferenceResults>,
    /// Errors of the answers against the exact truth; the first process only.
    pub judged: Option<Judged>,
    /// Structures in the order of the plan, twins last.
    pub subjects: Vec<SubjectPart>,
    /// Structures that had ended a process on this scene before.
    ///
    /// They are not tried again, nor by a resumed run.
    #[serde(default, skip_serializing_if = "BTreeMap::is_empty")]
    pub failed: BTreeMap<String, Verdict>,
    /// Names of the lower bounds among the tasks.
    pub bounds: Vec<String>,
    /// Tasks in the order of the schedules.
    pub tasks: Vec<TaskPart>,
}

/// Results of one structure in one process; its query times are in [`TaskPart`]s.
#[derive(Clone, PartialEq, Debug, Serialize, Deserialize)]
pub struct SubjectPart {
    /// Label on the command line, `bvh:leaf=4`; a twin's ends in `#twin`.
    pub label: String,
    /// Parameters of the structure, defaults included.
    pub params: Value,
    /// Kind that the structure declares.
    pub kind: Kind,
    /// Origin that the structure declares.
    pub origin: Origin,
    /// Status of building, counting and timing.
    #[serde(flatten)]
    pub verdict: Verdict,
    /// CPU time of one build; wall time if builds share threads.
    pub build_ms: Option<f64>,
    /// Bytes of nodes and items; `None` if nothing was built.
    pub memory_bytes: Option<u64>,
    /// CPU time of an update, ms; `None` if none was measured.
    pub update_cpu_ms: Option<f64>,
    /// Bytes after the last frame of a motion; the first process only.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub memory_after_bytes: Option<u64>,
    /// ln of (query time / query time on a fresh build), by number of frames.
    #[serde(default, skip_serializing_if = "BTreeMap::is_empty")]
    pub ageing_ln: BTreeMap<usize, f64>,
    /// Metrics of the count pass, means per query; the first process only.
    pub counts: BTreeMap<String, f64>,
    /// Choice of an adaptive structure; rebuilds in place of refits.
    ///
    /// For a motion, in the first process only.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub chose: Option<String>,
}

/// Times of one task of a structure or a lower bound in one process.
#[derive(Clone, PartialEq, Debug, Serialize, Deserialize)]
pub struct TaskPart {
    /// Label of a structure or a lower bound.
    pub label: String,
    /// Kind of query.
    pub task: TaskKind,
    /// Status of its timing.
    #[serde(flatten)]
    pub verdict: Verdict,
    /// Mean CPU ns per query over all timed cameras, for each round.
    pub rounds_ns: Vec<f64>,
    /// ln of the wall ns per query: interquartile mean over the rounds.
    pub wall_ln_ns: Option<f64>,
    /// CPU ns per query of groups of cameras, median over the rounds.
    ///
    /// The groups are the same for all tasks; empty with fewer than twenty. For frames: per frame.
    pub tail_ns: Vec<f64>,
}

/// Right answers and schedules of the first process, which all others use.
#[derive(Clone, PartialEq, Debug, Serialize, Deserialize)]
pub struct ReferenceResults {
    /// Right answer of the frustum query of every camera.
    ///
    /// Empty if the receiving process must count for itself.
    pub visible: Vec<Answer>,
    /// Right answer of the region search at every eye.
    pub located: Vec<Answer>,
    /// Schedule of frustum queries, bounds last; `None` if nothing is timed.
    pub query: Option<KeyedSchedule>,
    /// Schedule of region searches.
    pub locate: Option<KeyedSchedule>,
    /// Scale of the lens, if the path requests a visible share.
    pub lens_scale: Option<f64>,
}

impl Part {
    /// A part whose structures all have this verdict; other facts are unknown.
    pub fn of_failed(key: &GroupKey, structures: &[StructureSpec], verdict: &Verdict) -> Part {
        let subjects = structures.iter();
        let subjects = subjects.map(|spec| SubjectPart::unknown(spec, verdict.clone()));
        Part {
            key: key.clone(),
            scene: SceneInfo::unknown(&key.scene),
            path: PathInfo::unknown(key),
            subjects: subjects.collect(),
            ..Part::default()
        }
    }
}

impl ReferenceResults {
    /// Schedule of a pass, if it is timed, and the right answers.
    pub(super) fn pass(&self, pass: Pass) -> (Option<&KeyedSchedule>, &[Answer]) {
        match pass {
            Pass::Queries => (self.query.as_ref(), &self.visible),
            Pass::Searches => (self.locate.as_ref(), &self.located),
        }
    }
}

impl SubjectPart {
    /// The results of a structure before its queries.
    pub(super) fn of(subject: &Subject, verdict: Verdict) -> SubjectPart {
        let mut part = SubjectPart::unknown(&subject.spec, verdict);
        part.label = subject.label();
        let Ok(built) = &subject.built else {
            return part;
        };
        part.build_ms = Some(built.build_ms);
        part.memory_bytes = Some(built.memory.total() as u64);
        part.update_cpu_ms = built.update_ms;
        match guarded(|| built.items.chose()) {
            Ok(chose) => part.chose = chose,
            Err(verdict) => part.verdict = verdict,
        }
        part
    }

    /// The results of a structure that was not tried.
    pub fn unknown(spec: &StructureSpec, verdict: Verdict) -> SubjectPart {
        SubjectPart {
            label: spec.label.clone(),
            params: spec.params.clone(),
            kind: spec.row.info.kind,
            origin: spec.row.info.origin.owned(),
            verdict,
            build_ms: None,
            memory_bytes: None,
            update_cpu_ms: None,
            memory_after_bytes: None,
            ageing_ln: BTreeMap::new(),
            counts: BTreeMap::new(),
            chose: None,
        }
    }
}

/// The samples of one task of a part.
pub type TaskSamples = (String, TaskKind, Vec<Sample>);

/// The result of a process, and the samples of each task.
pub type Measured = (Part, Vec<TaskSamples>);
