//! `cullbench compare --against BINARY`: this program and another build of it,
//! pair by pair of processes that take turns on one processor, until the change
//! of every cell is known to within the threshold. The statistics are
//! [`judge`]'s; here is how the pairs are run.

use std::collections::BTreeMap;
use std::path::PathBuf;
use std::thread;
use std::time::{Duration, Instant};

use anyhow::Context;
use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64;

use super::interrupt::{self, Interrupted};
use super::processes::{Job, PROTOCOL, Request};
use super::processes::{Said, Worker, processors, see_through};
use crate::input;
use crate::measure::{GroupKey, Known, Part, Plan, Share, Status, TaskKind, Verdict};
use crate::statistics::{Judgement, interquartile_mean, judge, resolved, trimmed_mean};

/// How long one of a pair runs before the other takes its turn: well below the
/// time in which a shared machine changes its speed.
const TURN: Duration = Duration::from_millis(5);

/// The sides of a comparison, as indices: the other program and this one.
const OLD: usize = 0;
const NEW: usize = 1;

/// Pairs that are added until the answer is clear.
const MORE: usize = 2;

/// The first and the most pairs of a comparison: ten for a threshold of 5 %, more
/// for less, as such a change needs on a shared machine.
fn pairs(threshold: f64) -> (usize, usize) {
    match threshold {
        t if t >= 0.1 => (6, 32),
        t if t > 0.04 => (10, 32),
        _ => (16, 64),
    }
}

/// One structure in one group, on both sides.
pub struct AgainstCell {
    pub group: GroupKey,
    pub structure: String,
    /// Status on the old and on the new side.
    pub verdicts: [Verdict; 2],
    /// Counters of each side, by metric.
    pub counts: [BTreeMap<String, f64>; 2],
    /// ln ns per query of each pair, on each side.
    pub ln_ns: [Vec<f64>; 2],
    pub judgement: Option<Judgement>,
}

/// A comparison that was run.
pub struct Against {
    pub cells: Vec<AgainstCell>,
    pub pairs: usize,
    pub rounds: usize,
    pub cameras: usize,
    pub seconds: f64,
}

/// Two programs, and the plan on which they are compared.
pub struct Duel<'a> {
    pub plan: &'a Plan,
    /// The arguments of `run` that the plan follows from.
    pub args: Vec<String>,
    pub programs: [PathBuf; 2],
    pub threshold: f64,
    /// Counts and checks the answers only, if false.
    pub is_timed: bool,
    pub patience: Duration,
    /// Receives the pairs that are done, the most there may be, and the step.
    pub progress: &'a dyn Fn(usize, usize, &str),
}

impl Duel<'_> {
    /// Runs pairs of processes until every change is known to within the threshold.
    ///
    /// # Errors
    /// A program that cannot be started or is of another version, a scene that
    /// it cannot read.
    pub fn run(&self) -> anyhow::Result<Against> {
        let started = Instant::now();
        let (first, most) = match self.is_timed {
            true => pairs(self.threshold),
            false => (0, 0),
        };
        let seen = self.count(most)?;
        let mut cells = self.cells(&seen);
        let mut rng = Pcg64::seed_from_u64(self.plan.seed);
        let mut pairs = 0;
        loop {
            let is_due = pairs >= first && (pairs - first).is_multiple_of(MORE);
            let is_look = is_due || pairs == most;
            if is_look && (judge_cells(&mut cells, self.threshold) || pairs == most) {
                let mut known = seen[NEW].iter().filter_map(|part| part.known.as_ref());
                let query = known.find_map(|known| known.query.as_ref());
                return Ok(Against {
                    cells,
                    pairs,
                    rounds: query.map_or(0, |named| named.schedule.rounds as usize),
                    cameras: query.map_or(0, |named| named.schedule.cameras.len()),
                    seconds: started.elapsed().as_secs_f64(),
                });
            }
            (self.progress)(pairs, most, "pairs of processes");
            for scene in 0..self.plan.scenes.len() {
                let both = self.pair(scene, pairs as u32, &seen, &mut rng)?;
                for (side, parts) in both.iter().enumerate() {
                    note(&mut cells, side, parts);
                }
            }
            pairs += 1;
        }
    }

    /// Has both sides count and check their answers.
    fn count(&self, most: usize) -> anyhow::Result<[Vec<Part>; 2]> {
        let mut seen = [Vec::new(), Vec::new()];
        for scene in 0..self.plan.scenes.len() {
            // The plan is the new side's; the old one keeps to it.
            for side in [NEW, OLD] {
                (self.progress)(0, most, "counting and checking answers");
                let program = &self.programs[side];
                let share = self.share(scene, 0, [&seen[NEW], &[]]);
                let share = Share {
                    plan_only: true,
                    ..share
                };
                let request = self.request(scene, share, 0);
                let own = &mut seen[side];
                let mut keep = |said| {
                    if let Said::Part(part, _) = said {
                        own.push(*part);
                    }
                    Ok(())
                };
                let ended = see_through(program, &request, self.patience, &mut keep, &|_| ())?;
                ended
                    .done()
                    .with_context(|| program.display().to_string())?;
            }
        }
        Ok(seen)
    }

    /// One process's share of a scene: the plan of the new side, and the answers of its
    /// own side to be counted.
    fn share(&self, scene: usize, process: u32, [new, own]: [&[Part]; 2]) -> Share {
        let planned = &self.plan.scenes[scene];
        let groups = self.plan.groups_of(planned);
        let keys = groups.iter().map(|group| self.plan.key(planned, group));
        let known = keys.map(|key| {
            let answers = counted(own, &key);
            Some(Known {
                visible: answers
                    .map(|known| known.visible.clone())
                    .unwrap_or_default(),
                located: answers
                    .map(|known| known.located.clone())
                    .unwrap_or_default(),
                ..counted(new, &key)?.clone()
            })
        });
        Share {
            process,
            wanted: vec![true; groups.len()],
            known: known.collect(),
            failed: BTreeMap::new(),
            plan_only: false,
        }
    }

    fn request(&self, scene: usize, share: Share, layout: u64) -> Request {
        Request {
            protocol: PROTOCOL,
            args: self.args.clone(),
            spooled: BTreeMap::new(),
            files: input::held_files(),
            job: Job::Scene {
                scene,
                share,
                samples: false,
            },
            cpu: processors().last().copied(),
            layout,
        }
    }

    /// One pair of processes on one scene, in turns; old and new.
    fn pair(
        &self,
        scene: usize,
        pair: u32,
        seen: &[Vec<Part>; 2],
        rng: &mut Pcg64,
    ) -> anyhow::Result<[Vec<Part>; 2]> {
        let mut parts = [Vec::new(), Vec::new()];
        // Which side is started first, and gets the first memory, is drawn for every pair,
        // and apart from it whose turn is first: old, new, new, old, ...
        let first: usize = rng.random_range(0..2);
        let begins: usize = rng.random_range(0..2);
        let mut workers = [None, None];
        for side in [first, 1 - first] {
            let share = self.share(scene, pair, [&seen[NEW], &seen[side]]);
            let request = self.request(scene, share, rng.random());
            workers[side] = Some(Worker::start(&self.programs[side], &request)?);
        }
        let mut turn = 0;
        workers[1 - begins]
            .iter()
            .for_each(|other| other.hold(true));
        while workers.iter().any(Option::is_some) {
            if interrupt::asked() {
                return Err(Interrupted.into());
            }
            let mut side = (begins + usize::div_ceil(turn, 2)) % 2;
            turn += 1;
            if workers[side].is_none() {
                side = 1 - side;
            }
            let is_alone = workers[1 - side].is_none();
            workers[side].iter().for_each(|own| own.hold(false));
            thread::sleep(TURN);
            if !is_alone {
                workers[side].iter().for_each(|own| own.hold(true));
            }
            while let Some(worker) = &mut workers[side] {
                match worker.listen(Duration::ZERO)? {
                    Some(Said::Part(part, _)) => parts[side].push(*part),
                    Some(Said::Ended(ended)) => {
                        let program = || self.programs[side].display().to_string();
                        ended.done().with_context(program)?;
                        workers[side] = None;
                    }
                    Some(_) => {}
                    None => break,
                }
            }
        }
        Ok(parts)
    }

    /// All cells of the plan, without times.
    fn cells(&self, seen: &[Vec<Part>; 2]) -> Vec<AgainstCell> {
        let cells = self.plan.cells().into_iter().map(|cell| {
            let subjects = seen.each_ref().map(|parts| {
                let part = parts.iter().find(|part| part.key == cell.group);
                part.and_then(|p| p.subjects.iter().find(|s| s.label == cell.structure))
            });
            let absent = || Verdict::new(Status::LeftOut, "not in this program");
            AgainstCell {
                verdicts: subjects.map(|own| own.map_or_else(absent, |own| own.verdict.clone())),
                counts: subjects.map(|own| own.map(|own| own.counts.clone()).unwrap_or_default()),
                ln_ns: [Vec::new(), Vec::new()],
                judgement: None,
                group: cell.group,
                structure: cell.structure,
            }
        });
        cells.collect()
    }
}

/// Judges all cells that were timed; true if every change is known to within the
/// threshold.
fn judge_cells(cells: &mut [AgainstCell], threshold: f64) -> bool {
    let timed = cells.iter_mut().filter(|cell| cell.is_timed());
    let mut timed: Vec<&mut AgainstCell> = timed.collect();
    timed.retain(|cell| cell.differences().len() >= 3);
    let differences: Vec<Vec<f64>> = timed.iter().map(|cell| cell.differences()).collect();
    let judgements = judge(&differences, threshold);
    let enough = resolved(&judgements, threshold);
    for (cell, judgement) in timed.into_iter().zip(judgements) {
        cell.judgement = judgement;
    }
    enough
}

impl AgainstCell {
    fn is_timed(&self) -> bool {
        self.verdicts.iter().all(|v| v.status == Status::Ok)
    }

    /// The times of both sides, of which the quotient is the change.
    pub fn shown(&self) -> [Option<f64>; 2] {
        let old = trimmed_mean(&self.ln_ns[0]).map(|old| old.mean.exp());
        let ratio = self.judgement.map(|found| found.ratio);
        [old, old.zip(ratio).map(|(old, ratio)| old * ratio)]
    }

    /// ln(new / old) of each pair.
    fn differences(&self) -> Vec<f64> {
        let [old, new] = &self.ln_ns;
        old.iter().zip(new).map(|(old, new)| new - old).collect()
    }
}

/// Answers and counters of a side.
fn counted<'p>(parts: &'p [Part], key: &GroupKey) -> Option<&'p Known> {
    let part = parts.iter().find(|part| part.key == *key)?;
    part.known.as_ref()
}

/// Adds the times and the failures of one process.
fn note(cells: &mut [AgainstCell], side: usize, parts: &[Part]) {
    for cell in cells {
        let Some(part) = parts.iter().find(|part| part.key == cell.group) else {
            continue;
        };
        let subject = part.subjects.iter().find(|s| s.label == cell.structure);
        if let Some(failed) = subject.filter(|s| s.verdict.status != Status::Ok)
            && cell.verdicts[side].status == Status::Ok
        {
            cell.verdicts[side] = failed.verdict.clone();
        }
        let mut tasks = part.tasks.iter();
        let task = tasks.find(|t| t.label == cell.structure && t.task == TaskKind::Query);
        let rounds = task.into_iter().flat_map(|task| &task.rounds_ns);
        let rounds: Vec<f64> = rounds.map(|ns| ns.ln()).collect();
        // A pair that lacks a side is no pair: NaN keeps the places.
        cell.ln_ns[side].push(interquartile_mean(&rounds).unwrap_or(f64::NAN));
    }
}
