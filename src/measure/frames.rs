//! [`measure_frames`]: the measurement of a group whose items move, by one process.
//!
//! A frame takes the moves, updates the index, and answers the queries of one or more views.
//! Each structure replays the same motion over its own items, from a fresh build in every
//! round; the rounds are paired and ordered as those of still scenes. In the first round
//! every set is compared with the reference scan, in later rounds every size.

use std::collections::BTreeMap;

use super::clock::Stopwatch;
use super::group::{GroupPlan, counts, measure_part};
use super::moving::{Frames, Laps, Moving, ageing, lap_ns, replay};
use super::process_result::{Known, Part, SubjectPart, TaskPart, TaskSamples};
use super::progress::{Notice, TIMING};
use super::schedule::Orders;
use super::{
    Counted, GroupKey, KeyedSchedule, Protocol, Sample, Schedule, Status, Subject, TaskKind,
    TaskPlan, Verdict, Workload, guarded,
};
use crate::index::{StructureSpec, UpdatePolicy};
use crate::motion::Motion;
use crate::query::QueryCost;
use crate::statistics::{interquartile_mean, median};

/// Ageing is measured in every n-th process, because it costs builds.
const AGES_EVERY: u32 = 4;
/// Most CPU time of a structure in the count pass, ns.
const PATIENCE_NS: f64 = 120e9;
/// Tasks of a structure; [`TaskKind::Further`] only with several views.
const KINDS: [TaskKind; 4] = [
    TaskKind::Update,
    TaskKind::Query,
    TaskKind::Further,
    TaskKind::Frame,
];

/// A structure of the group with its verdict so far.
struct Entry<'a> {
    subject: &'a Subject,
    verdict: Verdict,
    counted: Counted,
    /// CPU time of one replay in the count pass, ns.
    replay_ns: f64,
    memory_after: Option<u64>,
    chose: Option<String>,
    /// Ids of fat bounds whose items are not visible.
    false_positives: u64,
    rounds: Vec<Vec<Laps>>,
}

/// Measures a group in this process: queries of a still scene, or frames; `None` if
/// stopped.
pub fn measure_queries_or_frames(
    workload: &Workload,
    subjects: &[Subject],
    plan: GroupPlan<'_>,
    notice: Notice,
    stop: &dyn Fn() -> bool,
) -> Option<(Part, Vec<TaskSamples>)> {
    match &workload.motion {
        None => measure_part(workload, subjects, plan, notice, stop),
        Some(motion) => measure_frames(workload, motion, subjects, plan, notice, stop),
    }
}

/// Measures a group whose items move; `None` if stopped.
fn measure_frames(
    workload: &Workload,
    motion: &Motion,
    subjects: &[Subject],
    plan: GroupPlan<'_>,
    notice: Notice,
    stop: &dyn Fn() -> bool,
) -> Option<(Part, Vec<TaskSamples>)> {
    let answered = plan.known.filter(|known| !known.visible.is_empty());
    let frames = &Frames::new(workload, motion, answered);
    let mut entries = Vec::new();
    for subject in subjects {
        let mut entry = Entry {
            subject,
            verdict: subject.built.as_ref().err().cloned().unwrap_or_default(),
            counted: Counted::default(),
            replay_ns: 1.0,
            memory_after: None,
            chose: None,
            false_positives: 0,
            rounds: Vec::new(),
        };
        if answered.is_none() && entry.runs() {
            notice(Some(&subject.label()), "counting");
            entry.verdict = guarded(|| entry.count(frames, stop))
                .unwrap_or_else(Err)
                .err()
                .unwrap_or_default();
        }
        if stop() {
            return None;
        }
        entries.push(entry);
    }
    let given = plan.known.and_then(|known| known.query.clone());
    let planned = given.unwrap_or_else(|| schedule(&entries, frames, &plan.protocol));
    if !plan.plan_only {
        time(&mut entries, frames, &planned, &plan, notice, stop)?;
    }
    let (mut tasks, mut samples) = (Vec::new(), Vec::new());
    let per_round = frames.right.iter().map(|a| a.count).sum::<u64>();
    for (label, kind) in planned.keys.iter().filter(|_| !plan.plan_only) {
        let own = entries.iter().find(|e| e.subject.label() == *label);
        if let Some(entry) = own.filter(|e| e.subject.built.is_ok()) {
            tasks.push(entry.task(*kind, workload, per_round));
            samples.push((label.clone(), *kind, entry.samples(*kind, frames)));
        }
    }
    let mut parts: Vec<SubjectPart> = entries.iter().map(|e| e.part(workload)).collect();
    if plan.process.is_multiple_of(AGES_EVERY) && !plan.plan_only {
        for (entry, part) in entries.iter().zip(&mut parts) {
            let Subject { spec, is_twin, .. } = entry.subject;
            if entry.runs() && !is_twin && ages(spec) {
                notice(Some(&part.label), "ageing");
                let found = guarded(|| ageing(spec, frames, &plan.protocol, stop));
                part.ageing_ln = found.unwrap_or_default();
            }
        }
        if stop() {
            return None;
        }
    }
    let known = Known {
        visible: frames.right.clone(),
        located: Vec::new(),
        query: Some(planned),
        locate: None,
        lens_scale: workload.lens_scale,
    };
    let part = Part {
        key: GroupKey::new(&plan.scene.name, &plan.path, workload.culling.test.name()),
        process: plan.process,
        scene: plan.scene.clone(),
        path: plan.path,
        known: answered.is_none().then_some(known),
        judged: None,
        subjects: parts,
        failed: BTreeMap::new(),
        bounds: Vec::new(),
        tasks,
    };
    Some((part, samples))
}

/// False for a structure that is built again in every frame.
fn ages(spec: &StructureSpec) -> bool {
    spec.info().capabilities.refits && spec.policy != UpdatePolicy::Rebuild
}

impl Entry<'_> {
    fn runs(&self) -> bool {
        self.verdict.status == Status::Ok
    }

    /// Counts and verifies all queries, and measures the time of one replay.
    fn count(&mut self, frames: &Frames, stop: &dyn Fn() -> bool) -> Result<(), Verdict> {
        let mut moving = Moving::build(frames, &self.subject.spec)?;
        let (mut out, mut cost) = (Vec::new(), QueryCost::default());
        self.replay_ns = 0.0;
        for frame in 0.. {
            if !moving.take_moves() || stop() {
                break;
            }
            let watch = Stopwatch::start();
            moving.update()?;
            self.replay_ns += watch.lap().cpu_ns;
            for (query, view) in frames.views(frame) {
                out.clear();
                moving
                    .index
                    .query_counted(view.as_any(), &mut out, &mut cost);
                frames.check(&moving, query, &out)?;
                out.clear();
                let watch = Stopwatch::start();
                moving.index.query(view.as_any(), &mut out);
                self.replay_ns += watch.lap().cpu_ns;
                frames.check(&moving, query, &out)?;
                self.false_positives += out.len() as u64 - frames.right[query].count;
            }
            if self.replay_ns > PATIENCE_NS {
                let reason = format!("{frame} frames took longer than {} s", PATIENCE_NS / 1e9);
                return Err(Verdict::new(Status::TimedOut, reason));
            }
        }
        self.memory_after = Some(moving.index.memory().total() as u64);
        self.chose = moving.index.chose();
        self.counted.answers[0] = frames.right.clone();
        self.counted.costs[0] = cost;
        Ok(())
    }

    fn part(&self, workload: &Workload) -> SubjectPart {
        let built = self.subject.built.as_ref().ok();
        let is_counted = self.runs() && !self.counted.answers[0].is_empty();
        let counted = || {
            let mut all = counts(&self.counted, workload.scene.items.len());
            if let UpdatePolicy::Fat(_) = self.subject.spec.policy {
                let answers = &self.counted.answers[0];
                let visible: u64 = answers.iter().map(|answer| answer.count).sum();
                let extra = self.false_positives as f64;
                all.insert(
                    "false_positive_count".to_owned(),
                    extra / answers.len() as f64,
                );
                all.insert("excess".to_owned(), extra / (visible as f64).max(1.0));
            }
            all
        };
        SubjectPart {
            label: self.subject.label(),
            build_ms: built.map(|b| b.build_ms),
            memory_bytes: built.map(|b| b.memory.total() as u64),
            memory_after_bytes: self.memory_after,
            chose: self.chose.clone(),
            counts: if is_counted {
                counted()
            } else {
                BTreeMap::new()
            },
            ..SubjectPart::unknown(&self.subject.spec, self.verdict.clone())
        }
    }

    fn task(&self, kind: TaskKind, workload: &Workload, per_round: u64) -> TaskPart {
        let of = |laps: &Laps| laps.of(kind, workload);
        let mean = |laps: &Vec<Laps>| laps.iter().map(of).sum::<f64>() / laps.len() as f64;
        let frames = self.rounds.first().map_or(0, Vec::len);
        let of_frame = |frame: usize| {
            let rounds = self.rounds.iter().map(|round| of(&round[frame]));
            median(&rounds.collect::<Vec<_>>())
        };
        let wall = self.rounds.iter().map(|round| {
            let wall = round
                .iter()
                .map(|laps| laps.wall * of(laps) / laps.of(TaskKind::Frame, workload));
            (wall.sum::<f64>() / round.len() as f64).ln()
        });
        TaskPart {
            label: self.subject.label(),
            task: kind,
            verdict: self.verdict.clone(),
            rounds_ns: self.rounds.iter().map(mean).collect(),
            wall_ln_ns: interquartile_mean(&wall.collect::<Vec<_>>()),
            tail_ns: match kind {
                TaskKind::Frame => (0..frames).filter_map(of_frame).collect(),
                _ => Vec::new(),
            },
            returned: per_round * self.rounds.len() as u64,
        }
    }

    /// A sample per frame and round; its ids are those of all views.
    fn samples(&self, kind: TaskKind, frames: &Frames) -> Vec<Sample> {
        let workload = frames.workload;
        let ids = |frame: usize| {
            frames.right[frame * workload.views_per_frame..]
                .iter()
                .take(workload.views_per_frame)
                .map(|answer| answer.count)
                .sum()
        };
        let all = self
            .rounds
            .iter()
            .zip(0..)
            .filter(|_| kind == TaskKind::Frame || kind == TaskKind::Update);
        let of_round = |(round, n): (&Vec<Laps>, u32)| {
            let frames = round.iter().enumerate();
            let sample = |(frame, laps): (usize, &Laps)| Sample {
                round: n,
                frame: frame as u32,
                queries: 1,
                cpu_ns: laps.of(kind, workload),
                wall_ns: laps.wall * laps.of(kind, workload) / laps.of(TaskKind::Frame, workload),
                returned: ids(frame),
            };
            frames.map(sample).collect::<Vec<_>>()
        };
        all.flat_map(of_round).collect()
    }
}

/// Rounds of each structure, from the time of its replay in the count pass.
fn schedule(
    entries: &[Entry],
    frames: &Frames,
    protocol: &Protocol,
) -> KeyedSchedule<(String, TaskKind)> {
    let own = |e: &Entry| ((protocol.task_ns / e.replay_ns) as usize).clamp(1, protocol.rounds[1]);
    let timed = entries.iter().filter(|entry| entry.runs());
    let rounds = timed.clone().map(own).max().unwrap_or(0);
    let (mut keys, mut tasks) = (Vec::new(), Vec::new());
    for entry in timed {
        let several = frames.workload.views_per_frame > 1;
        for kind in KINDS
            .into_iter()
            .filter(|k| several || *k != TaskKind::Further)
        {
            keys.push((entry.subject.label(), kind));
            let every = (rounds / own(entry)) as u32;
            tasks.push(TaskPlan { batch: 1, every });
        }
    }
    KeyedSchedule {
        keys,
        schedule: Schedule {
            cameras: (0..frames.right.len() as u32).collect(),
            rounds: rounds as u32,
            cold: false,
            tasks,
        },
    }
}

/// Replays the motion by the schedule; `None` if stopped.
fn time(
    entries: &mut [Entry],
    frames: &Frames,
    planned: &KeyedSchedule<(String, TaskKind)>,
    plan: &GroupPlan,
    notice: Notice,
    stop: &dyn Fn() -> bool,
) -> Option<()> {
    let lap_ns = lap_ns();
    let mut orders = Orders::new(entries.len(), plan.protocol.seed);
    for round in 0..planned.schedule.rounds {
        for n in orders.next() {
            let entry = &mut entries[n];
            let label = entry.subject.label();
            let own = |key: &(String, TaskKind)| key.0 == label;
            let task = planned.keys.iter().position(own);
            let Some(task) = task.filter(|_| entry.runs()) else {
                continue;
            };
            if !round.is_multiple_of(planned.schedule.tasks[task].every.max(1)) {
                continue;
            }
            notice(Some(&entry.subject.spec.label), TIMING);
            if stop() {
                return None;
            }
            let is_first = entry.rounds.is_empty();
            let spec = &entry.subject.spec;
            let laps = guarded(|| replay(spec, frames, lap_ns, is_first, stop));
            match laps.unwrap_or_else(Err) {
                Ok(Some(laps)) => entry.rounds.push(laps),
                Ok(None) => return None,
                Err(verdict) => entry.verdict = verdict,
            }
        }
    }
    Some(())
}

#[cfg(test)]
mod tests;
