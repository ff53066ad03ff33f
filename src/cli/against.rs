//! `cullbench compare --against BINARY`: this program and another build of it,
//! pair by pair of processes that take turns on one processor, until the change
//! of every cell is known to within the threshold. The statistics are
//! [`judge`]'s; here is how the pairs are run.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::thread;
use std::time::{Duration, Instant};

use anyhow::{Context, bail};
use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64;

use super::interrupt::{self, Interrupted};
use super::processes::{Ended, Said, Worker, processors, see_through};
use super::protocol::{Job, PROTOCOL, Request};
use super::run_plan::RunPlan;
use crate::input;
use crate::measure::{GroupKey, Known, Part, Share, Status, TaskKind, Verdict};
use crate::statistics::{Judgement, interquartile_mean, judge, resolved, trimmed_mean};

/// How long one of a pair runs before the other takes its turn: well below the
/// time in which a shared machine changes its speed.
const TURN: Duration = Duration::from_millis(5);

/// The two sides of a comparison.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum Side {
    Old,
    New,
}

/// How many pairs a comparison takes.
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct Pairs {
    pub first: usize,
    pub more: usize,
    pub most: usize,
}

impl Pairs {
    /// Ten for a threshold of 5 %, more for less: the pairs that such a change
    /// needs on a shared machine.
    pub fn of(threshold: f64) -> Pairs {
        let (first, most) = match threshold {
            t if t >= 0.1 => (6, 32),
            t if t > 0.04 => (10, 32),
            _ => (16, 64),
        };
        Pairs {
            first,
            more: 2,
            most,
        }
    }
}

/// One structure in one group, on both sides.
pub struct AgainstCell {
    pub group: GroupKey,
    pub structure: String,
    /// What became of it on the old and on the new side.
    pub verdicts: [Verdict; 2],
    /// What it counted on each side, by metric.
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

/// What is compared, and how.
pub struct Duel<'a> {
    pub plan: &'a RunPlan,
    /// The arguments of `run` that the plan follows from.
    pub args: Vec<String>,
    pub old: PathBuf,
    pub threshold: f64,
    pub pairs: Pairs,
    pub patience: Duration,
    pub progress: &'a dyn Fn(usize, usize, &str),
}

impl Duel<'_> {
    /// Runs it.
    ///
    /// # Errors
    /// A program that cannot be started or is of another version, a scene that
    /// it cannot read.
    pub fn run(&self) -> anyhow::Result<Against> {
        let started = Instant::now();
        let new = std::env::current_exe().context("this program cannot be found again")?;
        let cpu = processors().last().copied();
        let scenes = self.plan.plan.scenes.len();
        let mut seen = [Vec::new(), Vec::new()];
        for scene in 0..scenes {
            // The plan is the new side's; the old one keeps to it.
            for (side, program) in [(Side::New, new.as_path()), (Side::Old, &self.old)] {
                (self.progress)(0, self.pairs.most, "counting and checking answers");
                let known = match side {
                    Side::New => self.nothing(scene),
                    Side::Old => self.known(scene, &seen[1], None),
                };
                let request = self.request(scene, 0, known, true, cpu, 0);
                let own = &mut seen[side as usize];
                let ended = see_through(
                    program,
                    &request,
                    self.patience,
                    &mut |said| {
                        if let Said::Part(part, _) = said {
                            own.push(*part);
                        }
                        Ok(())
                    },
                    &|_| (),
                )?;
                match ended {
                    Ended::Done => {}
                    Ended::Failed(reason) => bail!("{}: {reason}", program.display()),
                    Ended::Died(structure, verdict) => bail!(
                        "{}: {}: {}; expected a program that answers",
                        program.display(),
                        structure.unwrap_or_else(|| "the program".to_owned()),
                        verdict.reason.unwrap_or_default()
                    ),
                }
            }
        }
        let mut cells = self.cells(&seen);
        let mut rng = Pcg64::seed_from_u64(self.plan.plan.seed);
        let mut pairs = 0;
        loop {
            let wanted = match pairs {
                0 => self.pairs.first,
                done => (done + self.pairs.more).min(self.pairs.most),
            };
            while pairs < wanted {
                (self.progress)(pairs, self.pairs.most, "pairs of processes");
                for scene in 0..scenes {
                    let both =
                        self.pair(scene, pairs as u32, &seen, [&self.old, &new], cpu, &mut rng)?;
                    for (side, parts) in both.iter().enumerate() {
                        note(&mut cells, side, parts);
                    }
                }
                pairs += 1;
            }
            let differences: Vec<Vec<f64>> = cells.iter().map(AgainstCell::differences).collect();
            let judged: Vec<usize> = (0..cells.len())
                .filter(|&i| cells[i].is_timed() && differences[i].len() >= 3)
                .collect();
            let of_judged: Vec<Vec<f64>> = judged.iter().map(|&i| differences[i].clone()).collect();
            let judgements = judge(&of_judged, self.threshold);
            let enough = resolved(&judgements, self.threshold);
            for (&i, judgement) in judged.iter().zip(judgements) {
                cells[i].judgement = judgement;
            }
            if enough || pairs >= self.pairs.most {
                let [_, new] = seen;
                let query = new.iter().find_map(|p| p.known.as_ref()?.query.as_ref());
                return Ok(Against {
                    cells,
                    pairs,
                    rounds: query.map_or(0, |named| named.schedule.rounds as usize),
                    cameras: query.map_or(0, |named| named.schedule.cameras.len()),
                    seconds: started.elapsed().as_secs_f64(),
                });
            }
        }
    }

    fn keys(&self, scene: usize) -> Vec<GroupKey> {
        let planned = &self.plan.plan.scenes[scene];
        let questions = self.plan.plan.questions(planned);
        questions
            .iter()
            .map(|question| self.plan.plan.key(planned, question))
            .collect()
    }

    fn nothing(&self, scene: usize) -> Vec<Option<Known>> {
        vec![None; self.keys(scene).len()]
    }

    /// The plan of the new side; the answers of `own`, or none, to be counted.
    fn known(&self, scene: usize, new: &[Part], own: Option<&[Part]>) -> Vec<Option<Known>> {
        let keys = self.keys(scene).into_iter();
        keys.map(|key| {
            let plan = counted(new, &key)?;
            let answers = own.and_then(|own| counted(own, &key));
            Some(Known {
                visible: answers
                    .map(|known| known.visible.clone())
                    .unwrap_or_default(),
                located: answers
                    .map(|known| known.located.clone())
                    .unwrap_or_default(),
                ..plan.clone()
            })
        })
        .collect()
    }

    fn request(
        &self,
        scene: usize,
        pair: u32,
        known: Vec<Option<Known>>,
        plan_only: bool,
        cpu: Option<usize>,
        layout: u64,
    ) -> Request {
        Request {
            protocol: PROTOCOL,
            args: self.args.clone(),
            spooled: BTreeMap::new(),
            files: input::held_files(),
            job: Job::Scene {
                scene,
                share: Share {
                    process: pair,
                    wanted: vec![true; known.len()],
                    known,
                    failed: BTreeMap::new(),
                    plan_only,
                },
                samples: false,
            },
            cpu,
            layout,
        }
    }

    /// One pair of processes on one scene, in turns; old and new.
    fn pair(
        &self,
        scene: usize,
        pair: u32,
        seen: &[Vec<Part>; 2],
        programs: [&Path; 2],
        cpu: Option<usize>,
        rng: &mut Pcg64,
    ) -> anyhow::Result<[Vec<Part>; 2]> {
        let mut parts = [Vec::new(), Vec::new()];
        // Which of the two is started first, and gets the first memory, is drawn
        // anew for every pair, and apart from it whose turn is first: old, new,
        // new, old, ...
        let first: usize = rng.random_range(0..2);
        let begins: usize = rng.random_range(0..2);
        let mut workers = [None, None];
        for side in [first, 1 - first] {
            let known = self.known(scene, &seen[1], Some(&seen[side]));
            let request = self.request(scene, pair, known, false, cpu, rng.random());
            workers[side] = Some(Worker::start(programs[side], &request)?);
        }
        let mut turn = 0;
        workers[1 - begins].iter().for_each(Worker::hold);
        while workers.iter().any(Option::is_some) {
            if interrupt::asked() {
                return Err(Interrupted.into());
            }
            let side = (begins + usize::div_ceil(turn, 2)) % 2;
            turn += 1;
            let side = if workers[side].is_some() {
                side
            } else {
                1 - side
            };
            let alone = workers[1 - side].is_none();
            workers[side].iter().for_each(Worker::go);
            thread::sleep(TURN);
            if !alone {
                workers[side].iter().for_each(Worker::hold);
            }
            while let Some(worker) = &mut workers[side] {
                match worker.listen(Duration::ZERO)? {
                    Said::Part(part, _) => parts[side].push(*part),
                    Said::Step(_) | Said::Times(_) => {}
                    Said::Nothing => break,
                    Said::Ended(Ended::Done) => workers[side] = None,
                    Said::Ended(Ended::Failed(reason)) => {
                        bail!("{}: {reason}", programs[side].display())
                    }
                    Said::Ended(Ended::Died(structure, verdict)) => bail!(
                        "{}: {} {}: {}; expected a program that answers",
                        programs[side].display(),
                        structure.unwrap_or_else(|| "the program".to_owned()),
                        verdict.status.name(),
                        verdict.reason.unwrap_or_default()
                    ),
                }
            }
        }
        Ok(parts)
    }

    fn cells(&self, seen: &[Vec<Part>; 2]) -> Vec<AgainstCell> {
        let mut cells = Vec::new();
        for cell in self.plan.plan.cells() {
            let of = |side: usize| {
                let part = seen[side].iter().find(|part| part.key == cell.group);
                part.and_then(|p| p.subjects.iter().find(|s| s.label == cell.structure))
            };
            let verdict = |side: usize| {
                of(side).map_or_else(
                    || Verdict::new(Status::LeftOut, "not in this program"),
                    |subject| subject.verdict.clone(),
                )
            };
            let counts = |side: usize| of(side).map(|s| s.counts.clone()).unwrap_or_default();
            cells.push(AgainstCell {
                verdicts: [verdict(0), verdict(1)],
                counts: [counts(0), counts(1)],
                ln_ns: [Vec::new(), Vec::new()],
                judgement: None,
                group: cell.group,
                structure: cell.structure,
            });
        }
        cells
    }
}

impl AgainstCell {
    fn is_timed(&self) -> bool {
        self.verdicts.iter().all(|v| v.status == Status::Ok)
    }

    /// The times of both sides as they are shown: their quotient is the change.
    pub fn shown(&self) -> [Option<f64>; 2] {
        let old = trimmed_mean(&self.ln_ns[0]).map(|old| old.mean.exp());
        let ratio = self.judgement.map(|found| found.ratio);
        [old, old.zip(ratio).map(|(old, ratio)| old * ratio)]
    }

    /// ln(new / old) of each pair.
    pub fn differences(&self) -> Vec<f64> {
        let [old, new] = &self.ln_ns;
        old.iter().zip(new).map(|(old, new)| new - old).collect()
    }
}

/// What a side has answered and counted.
fn counted<'p>(parts: &'p [Part], key: &GroupKey) -> Option<&'p Known> {
    let part = parts.iter().find(|part| part.key == *key)?;
    part.known.as_ref()
}

/// Takes over the times, and what has failed since, of one process.
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
        let rounds: Vec<f64> = task
            .map(|task| task.rounds_ns.iter().map(|ns| ns.ln()).collect())
            .unwrap_or_default();
        // A pair that lacks a side is no pair: NaN keeps the places.
        cell.ln_ns[side].push(interquartile_mean(&rounds).unwrap_or(f64::NAN));
    }
}
