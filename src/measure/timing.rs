//! The timed pass: [`timed`] times tasks by a [`Schedule`].
//!
//! Rounds in balanced random order over all tasks, each warmed up, with several queries per clock
//! reading if one is short. In a cold pass the caches are evicted before the queries of every
//! camera, and outputs do not grow while timed.

use std::time::{Duration, Instant};

use serde::{Deserialize, Serialize};

use super::clock::{Lap, Stopwatch};
use super::schedule::{Orders, Protocol, Schedule};
use super::task::TimedTask;
use super::{Status, Verdict, guarded};
use crate::query::ItemId;
use crate::statistics::interquartile_mean;

/// Longest warm-up before each pass of a task.
const WARM_UP: Duration = Duration::from_millis(2);

/// One clock reading: `queries` consecutive timed cameras from `frame` on.
#[derive(Clone, Copy, PartialEq, Debug, Serialize, Deserialize)]
pub struct Sample {
    /// Number of the round, from 0.
    pub round: u32,
    /// Index in the path of the first camera.
    pub frame: u32,
    /// Number of queries in this reading, of consecutive timed cameras.
    pub queries: u32,
    /// CPU time per query, less the cost of the clock.
    pub cpu_ns: f64,
    /// Wall time per query, less the cost of the clock.
    pub wall_ns: f64,
    /// Number of ids returned by all queries of the sample: each sample is a test too.
    pub returned: u64,
}

/// The samples of one task, rounds in order, cameras in order.
#[derive(Clone, Default, Debug)]
pub struct Timed {
    /// All clock readings of the task.
    pub samples: Vec<Sample>,
}

impl Timed {
    /// Mean time per query of each round of the task, by one of the clocks, ns.
    pub fn round_means(&self, clock: impl Fn(&Sample) -> f64) -> Vec<f64> {
        let rounds = self.samples.chunk_by(|a, b| a.round == b.round);
        let means = rounds.map(|round| {
            let queries: f64 = round.iter().map(|s| f64::from(s.queries)).sum();
            let spent: f64 = round.iter().map(|s| clock(s) * f64::from(s.queries)).sum();
            spent / queries
        });
        let sound = means.filter(|mean| mean.is_finite() && *mean > 0.0);
        sound.collect()
    }

    /// Time of the task in this process: ln of the CPU ns per query.
    ///
    /// The interquartile mean over the rounds; `None` without rounds.
    pub fn ln_ns(&self) -> Option<f64> {
        let means = self.round_means(|s| s.cpu_ns);
        interquartile_mean(&means.iter().map(|ns| ns.ln()).collect::<Vec<_>>())
    }

    /// Time of this task / time of `other`, in one process: no interval.
    pub fn over(&self, other: &Timed) -> Option<f64> {
        Some((self.ln_ns()? - other.ln_ns()?).exp())
    }
}

/// Times the tasks by a schedule; returns the samples or the failure of each task.
///
/// `turn` gets the index of a task before each of its turns. A sample with another number of ids
/// than [`TimedTask::expected`] makes its task `wrong`; a panic fails only its own task.
///
/// # Panics
/// If the schedule has another number of tasks.
pub fn timed(
    tasks: &[TimedTask],
    schedule: &Schedule,
    protocol: &Protocol,
    turn: &dyn Fn(usize),
) -> Vec<Result<Timed, Verdict>> {
    assert_eq!(tasks.len(), schedule.tasks.len(), "a plan for each task");
    let mut timer = TaskTimer {
        cameras: &schedule.cameras,
        tasks,
        clock: Lap::default(),
        results: tasks.iter().map(|_| Ok(Timed::default())).collect(),
    };
    if schedule.cameras.is_empty() {
        return timer.results;
    }
    let mut cold = schedule.cold.then(|| Cold::new(protocol, tasks));
    let mut orders = Orders::new(tasks.len(), protocol.seed);
    let mut out = Vec::new();
    for round in 0..schedule.rounds {
        let takes_part = |task: usize| round % schedule.tasks[task].every == 0;
        let batch = |task: usize| schedule.tasks[task].batch as usize;
        // The first task after a sweep finds the view cold as well: a new order for each camera.
        for first in 0..cold.as_ref().map_or(1, |_| schedule.cameras.len()) {
            cold.iter_mut().for_each(Cold::sweep_over_caches);
            for task in orders.next().into_iter().filter(|&task| takes_part(task)) {
                turn(task);
                let (all_threads, batch) = (tasks[task].all_threads, batch(task));
                let Some(cold) = &mut cold else {
                    timer.guarded(task, |timer| {
                        warm_up(&tasks[task], &schedule.cameras, batch, &mut out);
                        timer.clock = Stopwatch::empty_lap(all_threads);
                        for first in (0..schedule.cameras.len()).step_by(batch) {
                            timer.time(task, round, first, batch, &mut out);
                        }
                    });
                    continue;
                };
                // Batched points are timed once per round.
                if first % batch == 0 {
                    // The sweep has evicted the clock's code, too.
                    timer.clock = Stopwatch::empty_lap(all_threads);
                    let out = &mut cold.outs[task];
                    timer.guarded(task, |t| t.time(task, round, first, batch, out));
                }
            }
        }
    }
    timer.results
}

/// Times batches of queries and keeps the samples of all tasks.
struct TaskTimer<'p, 'a> {
    cameras: &'p [u32],
    tasks: &'p [TimedTask<'a>],
    /// Cost of a lap, measured before the task's turn.
    clock: Lap,
    results: Vec<Result<Timed, Verdict>>,
}

impl TaskTimer<'_, '_> {
    /// Runs `work` for a task that has not failed yet; a panic fails the task.
    fn guarded(&mut self, task: usize, work: impl FnOnce(&mut Self)) {
        if self.results[task].is_ok()
            && let Err(verdict) = guarded(|| work(self))
        {
            self.results[task] = Err(verdict);
        }
    }

    /// Times one batch of cameras from the `first` on, unless the task has failed.
    ///
    /// Not inlined: scripts/check-instructions.sh counts the instructions in it.
    #[inline(never)]
    fn time(&mut self, task: usize, round: u32, first: usize, batch: usize, out: &mut Vec<ItemId>) {
        let Ok(timed) = &mut self.results[task] else {
            return;
        };
        let own = &self.tasks[task];
        let queried = &self.cameras[first..(first + batch).min(self.cameras.len())];
        let passes = (batch / self.cameras.len()).max(1);
        let watch = Stopwatch::start_for(own.all_threads);
        let returned: u64 = (0..passes).map(|_| own.ask_all(queried, out)).sum();
        let lap = watch.lap().less(self.clock);
        let queries = (passes * queried.len()) as f64;
        let expected: u64 = queried.iter().map(|&c| own.expected[c as usize]).sum();
        let expected = expected * passes as u64;
        if returned != expected {
            let reason = format!(
                "the timed pass returned {returned} ids from camera {} on, the count pass \
                 {expected}",
                queried[0]
            );
            self.results[task] = Err(Verdict::new(Status::Wrong, reason));
            return;
        }
        timed.samples.push(Sample {
            round,
            frame: queried[0],
            queries: queries as u32,
            cpu_ns: lap.cpu_ns / queries,
            wall_ns: lap.wall_ns / queries,
            returned,
        });
    }
}

/// Runs a pass of the task, or its first part, without timing it.
fn warm_up(task: &TimedTask, cameras: &[u32], batch: usize, out: &mut Vec<ItemId>) {
    let started = Instant::now();
    for cameras in cameras.chunks(batch) {
        task.ask_all(cameras, out);
        if started.elapsed() > WARM_UP {
            break;
        }
    }
}

/// Spare room in an output, in ids: structures write whole rows.
const SLACK: usize = 64;

/// Memory sweep and outputs of cold queries.
///
/// One sweep serves one query of every task: each task has its own data, which no other query loads
/// into the caches, and its own output.
struct Cold {
    /// Memory larger than the last cache, overwritten between cold queries.
    sweep: Vec<u64>,
    /// An output per task.
    outs: Vec<Vec<ItemId>>,
}

impl Cold {
    /// Allocates the sweep, and outputs of their final size.
    ///
    /// A query that runs once per sweep must not pay for the growth of its output.
    fn new(protocol: &Protocol, tasks: &[TimedTask]) -> Cold {
        let out = |task: &TimedTask| {
            let most = task.expected.iter().copied().max().unwrap_or(0) as usize;
            let mut out = vec![0; most + SLACK];
            out.clear();
            out
        };
        Cold {
            sweep: vec![1; protocol.cache_bytes / size_of::<u64>()],
            outs: tasks.iter().map(out).collect(),
        }
    }

    fn sweep_over_caches(&mut self) {
        // Written instead of read: all zero pages share one physical page, which evicts nothing.
        for line in self.sweep.chunks_mut(8) {
            line[0] = line[0].wrapping_add(1);
        }
        std::hint::black_box(&self.sweep);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn protocol() -> Protocol {
        Protocol {
            rounds: [3, 3],
            task_ns: 1e5,
            cameras: 40,
            cold: false,
            seed: 1,
            cache_bytes: 1 << 20,
        }
    }

    /// A task that returns `count(camera)` ids.
    fn task<'a>(count: impl Fn(usize) -> u64 + 'a, expected: Vec<u64>) -> TimedTask<'a> {
        TimedTask {
            ask: Box::new(move |camera, out| out.extend((0..count(camera)).map(|id| id as ItemId))),
            ask_many: None,
            all_threads: false,
            expected,
            least_ns: Some(1e4),
        }
    }

    fn timed_rounds(tasks: &[TimedTask], protocol: &Protocol) -> Vec<Result<Timed, Verdict>> {
        let schedule = Schedule::new(40, tasks, protocol);
        timed(tasks, &schedule, protocol, &|_| ())
    }

    #[test]
    fn every_round_covers_every_timed_camera_once() {
        for cold in [false, true] {
            let all = [
                task(|c| c as u64, (0..40).collect()),
                task(|_| 0, vec![0; 40]),
            ];
            let protocol = Protocol { cold, ..protocol() };
            for timed in timed_rounds(&all, &protocol) {
                let timed = timed.unwrap();
                assert_eq!(timed.round_means(|s| s.cpu_ns).len(), 3);
                for round in 0..3 {
                    let samples = timed.samples.iter().filter(|s| s.round == round);
                    let asked: u32 = samples.map(|s| s.queries).sum();
                    assert_eq!(asked, if cold { 24 } else { 40 });
                }
                assert_eq!(timed.round_means(|s| s.cpu_ns).len(), 3);
            }
        }
    }

    #[test]
    fn points_that_are_asked_at_once_are_one_batch() {
        let many = TimedTask {
            ask_many: Some(Box::new(|cameras| cameras.len() as u64)),
            ..task(|_| 1, vec![1; 40])
        };
        let timed = timed_rounds(&[many], &protocol());
        let timed = timed.into_iter().next().unwrap().unwrap();
        assert_eq!((timed.samples.len(), timed.samples[0].queries), (3, 40));
    }

    /// Forty cameras of 20 ns, seven times, exceed the least lap.
    #[test]
    fn short_queries_of_few_cameras_are_repeated() {
        for is_batched in [false, true] {
            let many = || Box::new(|cameras: &[u32]| cameras.len() as u64) as _;
            let short = TimedTask {
                least_ns: Some(20.0),
                ask_many: is_batched.then(many),
                ..task(|_| 1, vec![1; 40])
            };
            let timed = timed_rounds(&[short], &protocol()).remove(0).unwrap();
            let sample = &timed.samples[0];
            assert_eq!((sample.queries, sample.returned), (280, 280));
            assert_eq!(timed.samples.len(), 3);
        }
    }

    #[test]
    fn a_lap_loses_the_time_of_the_clock_and_never_all() {
        let of = |cpu_ns| Lap {
            cpu_ns,
            wall_ns: cpu_ns,
        };
        assert_eq!(of(900.0).less(of(400.0)), of(500.0));
        assert_eq!(of(401.0).less(of(400.0)), of(12.5), "no better known");
    }

    #[test]
    fn a_task_with_a_stride_takes_part_in_its_rounds_alone() {
        let all = [task(|_| 0, vec![0; 40]), task(|_| 0, vec![0; 40])];
        let mut schedule = Schedule::new(40, &all, &protocol());
        schedule.rounds = 6;
        schedule.tasks[1].every = 3;
        let found = timed(&all, &schedule, &protocol(), &|_| ());
        let rounds = |i: usize| found[i].as_ref().unwrap().round_means(|s| s.cpu_ns).len();
        assert_eq!((rounds(0), rounds(1)), (6, 2));
    }

    #[test]
    fn a_sample_that_disagrees_with_the_count_pass_is_wrong() {
        let mut expected: Vec<u64> = (0..40).collect();
        let right = task(|c| c as u64, expected.clone());
        expected[20] += 1;
        let all = [right, task(|c| c as u64, expected)];
        let found = timed_rounds(&all, &protocol());
        assert!(found[0].is_ok());
        assert_eq!(found[1].as_ref().unwrap_err().status, Status::Wrong);
    }

    #[test]
    fn a_panic_is_the_result_of_its_task_alone() {
        let panics = |at: usize| TimedTask {
            ask: Box::new(move |camera, _| assert!(camera < at, "deep in a peer's code")),
            ..task(|_| 0, vec![0; 40])
        };
        // In the pass itself, and before it, when its cost is estimated.
        for at in [39, 0] {
            let all = [panics(40), panics(at)];
            let found = timed_rounds(&all, &protocol());
            assert_eq!(
                found[0].as_ref().unwrap().round_means(|s| s.cpu_ns).len(),
                3
            );
            let verdict = found[1].as_ref().unwrap_err();
            assert_eq!(verdict.status, Status::Panicked);
            let reason = verdict.reason.as_deref().unwrap_or_default();
            assert!(reason.contains("deep in a peer's code"), "{reason}");
        }
    }

    #[test]
    fn the_time_of_a_process_is_the_interquartile_mean_over_its_rounds() {
        let sample = |round: u32, queries: u32, cpu_ns: f64| Sample {
            round,
            frame: 0,
            queries,
            cpu_ns,
            wall_ns: 0.0,
            returned: 0,
        };
        // Rounds of 100 (from a sample of 1 query and one of 3), and outliers.
        let samples = vec![
            sample(0, 1, 40.0),
            sample(0, 3, 120.0),
            sample(2, 4, 100.0),
            sample(4, 4, 100.0),
            sample(6, 4, 1e9),
        ];
        let timed = Timed { samples };
        assert_eq!(timed.round_means(|s| s.cpu_ns)[0], 100.0);
        let ns = timed.ln_ns().unwrap().exp();
        assert!((ns - 100.0).abs() < 1e-9, "{ns}");
        assert_eq!(timed.over(&timed), Some(1.0));
        assert_eq!(Timed::default().ln_ns(), None);
    }
}
