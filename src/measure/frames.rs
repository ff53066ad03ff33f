//! [`measure`]: the measurement of one group by one process, here of motions.
//!
//! A frame takes the moves, updates the index, and answers the queries of one or more views. Each
//! structure replays the same motion over its own items, from a fresh build in every round; rounds
//! are paired and ordered like those of still scenes. The first round compares every set with the
//! reference scan, later rounds every size.

use super::clock::Stopwatch;
use super::group::{GroupPlan, counts, queries, task_part};
use super::key::TaskKey;
use super::moving::{Frames, Laps, Moving, ageing, replay, times_of};
use super::process_result::{Measured, Part, SubjectPart};
use super::schedule::Orders;
use super::{
    Answer, KeyedSchedule, Notice, Protocol, Sample, Schedule, Status, Subject, TIMING, TaskKind,
    TaskPlan, Timed, Verdict, Workload, guarded,
};
use crate::index::UpdatePolicy;
use crate::query::QueryCost;

/// Ageing is measured in every n-th process, because it costs builds.
const AGES_EVERY: u32 = 4;
/// Most CPU time of a structure in the count pass, ns.
const PATIENCE_NS: f64 = 120e9;
/// Tasks of a structure; [`TaskKind::Further`] only with several views.
const KINDS: [TaskKind; 4] = {
    use TaskKind::{Frame, Further, Query, Update};
    [Update, Query, Further, Frame]
};

/// A structure of the group with its results so far.
struct Entry<'a> {
    subject: &'a Subject,
    part: SubjectPart,
    /// CPU time of one replay in the count pass, ns.
    replay_ns: f64,
    /// Times and number of returned items of each frame, by round.
    rounds: Vec<Vec<(Laps, u64)>>,
}

/// Measures a group in this process: queries of a still scene, or frames.
pub fn measure(workload: &Workload, subjects: &[Subject], plan: GroupPlan) -> Measured {
    let Some(motion) = &workload.motion else {
        return queries(workload, subjects, plan);
    };
    let (notice, answered) = (plan.notice, plan.answered());
    let frames = &Frames::new(workload, motion, answered, notice);
    let mut entries = Vec::new();
    for subject in subjects {
        let verdict = subject.built.as_ref().err().cloned().unwrap_or_default();
        let mut part = SubjectPart::of(subject, verdict);
        part.chose = None;
        let mut entry = Entry {
            subject,
            part,
            replay_ns: 1.0,
            rounds: Vec::new(),
        };
        if answered.is_none() && entry.part.verdict.is_ok() {
            let counted = guarded(|| entry.count(frames, notice));
            let failed = counted.unwrap_or_else(Err).err();
            let missed = frames.judged.and_then(|judged| judged.unsafe_verdict());
            entry.part.verdict = failed.or(missed).unwrap_or_default();
        }
        entries.push(entry);
    }
    let given = plan.known.and_then(|known| known.query.clone());
    let planned = given.unwrap_or_else(|| schedule(&entries, frames, &plan.protocol));
    if !plan.plan_only {
        time(&mut entries, frames, &planned, &plan);
    }
    let (mut tasks, mut samples) = (Vec::new(), Vec::new());
    for key in planned.keys.iter().filter(|_| !plan.plan_only) {
        let own = entries.iter().find(|entry| entry.part.label == key.0);
        if let Some(entry) = own.filter(|entry| entry.subject.built.is_ok()) {
            let timed = entry.timed(key.1, workload);
            let tail_of = (key.1 == TaskKind::Frame).then_some(1);
            tasks.push(task_part(key, &timed, &planned.schedule, tail_of));
            // With one view the queries are the difference of the two.
            let is_kept = [TaskKind::Frame, TaskKind::Update].contains(&key.1)
                || workload.views_per_frame > 1;
            let kept = timed.ok().filter(|_| is_kept).unwrap_or_default();
            samples.push((key.0.clone(), key.1, kept.samples));
        }
    }
    if plan.process.is_multiple_of(AGES_EVERY) && !plan.plan_only {
        for entry in &mut entries {
            let Subject { spec, is_twin, .. } = entry.subject;
            // Not if the policy rebuilds it in every or every n-th frame.
            let ages = spec.info().refits && spec.policy == UpdatePolicy::Refit;
            if entry.part.verdict.is_ok() && !is_twin && ages {
                let found = guarded(|| ageing(spec, frames, &plan.protocol, notice));
                match found.unwrap_or_else(Err) {
                    Ok(ageing_ln) => entry.part.ageing_ln = ageing_ln,
                    Err(verdict) => entry.part.verdict = verdict,
                }
            }
        }
    }
    let answers = [frames.right.clone(), Vec::new()];
    let part = Part {
        judged: frames.judged,
        subjects: entries.into_iter().map(|entry| entry.part).collect(),
        tasks,
        ..plan.part(workload, answers, [Some(planned), None])
    };
    (part, samples)
}

impl Entry<'_> {
    /// Counts and verifies all queries, and measures the time of one replay.
    fn count(&mut self, frames: &Frames, notice: Notice) -> Result<(), Verdict> {
        notice(Some(&self.subject.spec.label), "counting");
        let mut moving = Moving::build(frames, &self.subject.spec)?;
        let (mut out, mut cost) = (Vec::new(), QueryCost::default());
        let mut answers = Vec::new();
        self.replay_ns = 0.0;
        let all_threads = self.subject.spec.is_threaded();
        while let Some(frame) = moving.take_moves() {
            notice(Some(&self.subject.spec.label), "counting");
            let watch = Stopwatch::start_for(all_threads);
            moving.update()?;
            self.replay_ns += watch.lap().cpu_ns;
            for (query, view) in frames.views(frame) {
                out.clear();
                let index = &moving.index;
                index.query_counted(view.as_any(), &mut out, &mut cost);
                frames.check(&moving, query, &out)?;
                out.clear();
                let watch = Stopwatch::start_for(all_threads);
                moving.index.query(view.as_any(), &mut out);
                self.replay_ns += watch.lap().cpu_ns;
                frames.check(&moving, query, &out)?;
                answers.push(Answer::of(&out));
            }
            if self.replay_ns > PATIENCE_NS {
                let reason = format!("{frame} frames took longer than {} s", PATIENCE_NS / 1e9);
                return Err(Verdict::new(Status::TimedOut, reason));
            }
        }
        let (answers, costs) = ([answers, Vec::new()], [cost, QueryCost::default()]);
        self.part.counts = counts(&answers, &costs, frames.workload.scene.items.len());
        self.part.memory_after_bytes = Some(moving.index.memory().total() as u64);
        let chose = moving.index.chose();
        let chose = match self.subject.spec.policy {
            // A new build counts only its own updates.
            UpdatePolicy::Every(_) => chose.map(|chose| format!("since the last build: {chose}")),
            _ => chose,
        };
        let (refused, all) = (moving.refused, frames.motion.frames);
        let built = format!("built again in {refused} of {all} frames, which it cannot refit");
        let notes = chose.into_iter().chain((refused > 0).then_some(built));
        self.part.chose = notes.reduce(|told, more| format!("{told}; {more}"));
        Ok(())
    }

    /// One sample per frame and round of a kind of task; returned ids are of all views.
    fn timed(&self, kind: TaskKind, workload: &Workload) -> Result<Timed, Verdict> {
        if !self.part.verdict.is_ok() {
            return Err(self.part.verdict.clone());
        }
        let mut timed = Timed::default();
        for (round, frames) in (0..).zip(&self.rounds) {
            timed.samples.extend((0..).zip(frames).map(|(frame, own)| {
                let [cpu_ns, wall_ns] = times_of(&own.0, kind, workload);
                Sample {
                    round,
                    frame,
                    queries: 1,
                    cpu_ns,
                    wall_ns,
                    returned: own.1,
                }
            }));
        }
        Ok(timed)
    }
}

/// Rounds of each structure, from the time of its replay in the count pass.
fn schedule(entries: &[Entry], frames: &Frames, protocol: &Protocol) -> KeyedSchedule {
    let own = |e: &Entry| ((protocol.task_ns / e.replay_ns) as usize).clamp(1, protocol.rounds[1]);
    let timed = entries.iter().filter(|entry| entry.part.verdict.is_ok());
    let rounds = timed.clone().map(own).max().unwrap_or(0);
    let several = frames.workload.views_per_frame > 1;
    let mut kinds = KINDS.to_vec();
    kinds.retain(|kind| several || *kind != TaskKind::Further);
    let tasks = timed.flat_map(|entry| {
        let every = (rounds / own(entry)) as u32;
        kinds.iter().map(move |&kind| {
            let key = (entry.part.label.clone(), kind);
            (key, TaskPlan { batch: 1, every })
        })
    });
    let (keys, tasks): (Vec<TaskKey>, _) = tasks.unzip();
    let mut schedule = Schedule {
        cameras: (0..frames.right.len() as u32).collect(),
        rounds: rounds as u32,
        cold: false,
        tasks,
    };
    schedule.share_rounds(&keys);
    KeyedSchedule { keys, schedule }
}

/// Replays the motion according to the schedule.
fn time(entries: &mut [Entry], frames: &Frames, planned: &KeyedSchedule, plan: &GroupPlan) {
    let mut orders = Orders::new(entries.len(), plan.protocol.seed);
    for round in 0..planned.schedule.rounds {
        for n in orders.next() {
            let entry = &mut entries[n];
            let own = planned.plan_of(&entry.part.label, TaskKind::Frame);
            let is_due = own.is_some_and(|task| round.is_multiple_of(task.every.max(1)));
            if !is_due || !entry.part.verdict.is_ok() {
                continue;
            }
            let (spec, is_first) = (&entry.subject.spec, entry.rounds.is_empty());
            let turn = || (plan.notice)(Some(&spec.label), TIMING);
            match guarded(|| replay(spec, frames, is_first, &turn)).unwrap_or_else(Err) {
                Ok(laps) => entry.rounds.push(laps),
                Err(verdict) => entry.part.verdict = verdict,
            }
        }
    }
}

#[cfg(test)]
mod tests;
