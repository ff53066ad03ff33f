//! Schedule of a timed pass: cameras, queries per clock reading, order of tasks.
//!
//! The first process of a run makes it from a [`Protocol`]; all others use the same one, and so do
//! both sides of a comparison. Tasks have keys ([`TaskKey`]): times are found by key, never by
//! index. Orders ([`Orders`]) are balanced, so that neither a position nor a neighbour favours a
//! task.

use serde::{Deserialize, Serialize};

use super::clock::Stopwatch;
use super::guarded;
use super::index_under_test::original;
use super::key::{TaskKey, TaskKind};
use super::task::TimedTask;
use crate::path::evenly;
use crate::query::ItemId;
use crate::scene::SeededRng;
use crate::statistics::median;

/// Limits of a schedule: rounds, time, cameras, cache state.
#[derive(Clone, Copy, Default, PartialEq, Debug)]
pub struct Protocol {
    /// Fewest and most rounds of a task.
    pub rounds: [usize; 2],
    /// CPU time of a task in one process, warm-up included, ns.
    ///
    /// Determines the number of rounds within those limits.
    pub task_ns: f64,
    /// Most cameras that are timed, evenly spread over the path.
    pub cameras: usize,
    /// True if the caches are evicted before every query.
    pub cold: bool,
    /// Seed of the order of the tasks in each round.
    pub seed: u64,
    /// Bytes to stream over for a cold query.
    pub cache_bytes: usize,
}

/// Upper bound of the cost of a clock reading with its loop, ns.
///
/// Laps are made long enough for it. On Linux reading a thread's CPU time is a system call.
pub const CLOCK_NS: f64 = 650.0;
/// Largest share of a lap that the clock may take.
pub const MOST_OVERHEAD: f64 = 0.01;
/// Least time of a lap, ns.
///
/// A clock reading costs up to a hundredth of it more than an empty lap. Longer laps do not repeat
/// cameras, since a branch predictor learns them.
const LEAST_LAP_NS: f64 = 5_000.0;
/// Most cameras of a cold pass, where each query costs a sweep over memory.
const COLD_CAMERAS: usize = 24;
/// Fewest timed cameras, so that a path is more than one view.
const LEAST_CAMERAS: usize = 8;
/// Number of queries from which the cost of a task is estimated.
const PILOT: usize = 24;

/// The plan of one timed pass.
#[derive(Clone, PartialEq, Debug, Serialize, Deserialize)]
#[cfg_attr(test, derive(schemars::JsonSchema))]
pub struct Schedule {
    /// Cameras of the path that are timed, by their index.
    pub cameras: Vec<u32>,
    /// Rounds of the pass.
    pub rounds: u32,
    /// True if caches are evicted before each query.
    pub cold: bool,
    /// Plan of each task.
    pub tasks: Vec<TaskPlan>,
}

/// Part of one task in a pass.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Serialize, Deserialize)]
#[cfg_attr(test, derive(schemars::JsonSchema))]
pub struct TaskPlan {
    /// Queries per clock reading; more than the cameras if these are repeated.
    pub batch: u32,
    /// Takes part in every n-th round, n being this number: slow tasks in fewer.
    pub every: u32,
}

impl Protocol {
    /// Indices of the timed cameras among `count`, evenly spread.
    pub fn cameras_of(&self, count: usize) -> Vec<u32> {
        let most = match self.cold {
            true => self.cameras.min(COLD_CAMERAS),
            false => self.cameras,
        };
        let chosen = evenly(count, most.max(LEAST_CAMERAS));
        chosen.map(|camera| camera as u32).collect()
    }
}

/// Number of cameras that a plain loop over `items` items answers within `pass_ns`.
///
/// Does not depend on measurements, so that every run of a command times the same cameras.
pub fn cameras_within(pass_ns: f64, items: usize) -> usize {
    /// Time of a box in the plain loop, ns.
    const BOX_NS: f64 = 5.0;
    (pass_ns / (BOX_NS * items.max(1) as f64)) as usize
}

impl Schedule {
    /// Plans a pass over `count` cameras.
    ///
    /// Queries per clock reading follow from [`TimedTask::least_ns`] and are the same in every run;
    /// without it, from the median time of a few queries.
    pub fn new(count: usize, tasks: &[TimedTask], protocol: &Protocol) -> Schedule {
        let cameras = protocol.cameras_of(count);
        let timed = cameras.len().max(1);
        let mut out = Vec::new();
        let [least, most] = protocol.rounds;
        let plans = tasks.iter().map(|task| {
            // A panic becomes the task's own result in its pass.
            let pilot = guarded(|| pilot(task, &cameras, &mut out)).unwrap_or(1.0);
            let enough = batch(task.least_ns.unwrap_or(pilot), timed);
            let batch = match (&task.ask_many, protocol.cold) {
                (Some(_), true) => timed,
                (Some(_), false) => enough.next_multiple_of(timed),
                (None, true) => 1,
                (None, false) => enough,
            };
            let pass = 2.0 * (pilot * timed.max(batch) as f64).max(1.0);
            let rounds = match protocol.cold {
                true => least,
                false => ((protocol.task_ns / pass) as usize).clamp(least, most.max(least)),
            };
            (batch as u32, rounds.max(1))
        });
        let plans: Vec<(u32, usize)> = plans.collect();
        let rounds = plans.iter().map(|p| p.1).max().unwrap_or(0);
        let tasks = plans.into_iter().map(|(batch, own)| TaskPlan {
            batch,
            every: (rounds / own).max(1) as u32,
        });
        Schedule {
            cameras,
            rounds: rounds as u32,
            cold: protocol.cold,
            tasks: tasks.collect(),
        }
    }

    /// Gives a twin and its original the same rounds, the larger number of the two.
    ///
    /// A pilot only errs on the slow side, and a twin must be measured like its original.
    pub(super) fn share_rounds(&mut self, keys: &[TaskKey]) {
        let every: Vec<u32> = self.tasks.iter().map(|task| task.every).collect();
        for (task, (label, kind)) in self.tasks.iter_mut().zip(keys) {
            let alike = keys.iter().zip(&every);
            let alike = alike.filter(|(o, _)| o.1 == *kind && original(&o.0) == original(label));
            task.every = alike.map(|(_, every)| *every).min().unwrap_or(task.every);
        }
    }
}

/// Median CPU time of a query, ns, from a few cameras.
fn pilot(task: &TimedTask, cameras: &[u32], out: &mut Vec<ItemId>) -> f64 {
    if task.ask_many.is_some() {
        // The smaller of two: the first fills caches, and either may be interrupted.
        let laps = [(); 2].map(|()| {
            let watch = Stopwatch::start();
            task.ask_all(cameras, out);
            watch.lap().cpu_ns
        });
        return laps[0].min(laps[1]) / cameras.len().max(1) as f64;
    }
    // Twice: the first time fills caches and grows the output.
    let mut laps = Vec::new();
    for turn in 0..2 {
        for k in evenly(cameras.len(), PILOT) {
            let watch = Stopwatch::start();
            task.ask_all(&cameras[k..=k], out);
            if turn == 1 {
                laps.push(watch.lap().cpu_ns);
            }
        }
    }
    let middle = median(&laps).unwrap_or(1.0);
    (middle - CLOCK_NS).max(middle / 8.0).max(1.0)
}

/// Queries per clock reading: a power of two that makes the clock negligible.
///
/// At most all cameras, repeated if they take less than [`LEAST_LAP_NS`].
fn batch(query_ns: f64, cameras: usize) -> usize {
    let queries = |ns: f64| (ns / query_ns.max(1.0)).ceil() as usize;
    let needed = queries(CLOCK_NS / MOST_OVERHEAD).next_power_of_two();
    let passes = queries(LEAST_LAP_NS).div_ceil(cameras);
    needed.min(cameras.saturating_mul(passes))
}

/// A schedule with the keys of its tasks.
#[derive(Clone, PartialEq, Debug, Serialize, Deserialize)]
pub struct KeyedSchedule {
    /// Keys of the tasks, in the order of the schedule.
    #[serde(rename = "names")]
    pub keys: Vec<TaskKey>,
    /// Cameras, batches and rounds.
    pub schedule: Schedule,
}

impl KeyedSchedule {
    /// The plan of a task, if it has one.
    pub(super) fn plan_of(&self, label: &str, kind: TaskKind) -> Option<TaskPlan> {
        let mut keys = self.keys.iter();
        let position = keys.position(|key| key.0 == label && key.1 == kind)?;
        self.schedule.tasks.get(position).copied()
    }
}

/// The schedule of a timed pass, and the tasks that take part.
///
/// With a `given` schedule, its part for these tasks; tasks that it lacks are dropped.
pub(super) fn scheduled<'a>(
    mut tasks: Vec<(TaskKey, TimedTask<'a>)>,
    given: Option<&KeyedSchedule>,
    cameras: usize,
    protocol: &Protocol,
) -> (KeyedSchedule, Vec<TimedTask<'a>>) {
    let plan = |(label, kind): &TaskKey| given?.plan_of(label, *kind);
    tasks.retain(|(key, _)| given.is_none() || plan(key).is_some());
    let (keys, tasks): (Vec<_>, Vec<_>) = tasks.into_iter().unzip();
    let mut schedule = match given {
        None => Schedule::new(cameras, &tasks, protocol),
        Some(given) => Schedule {
            tasks: keys.iter().filter_map(plan).collect(),
            ..given.schedule.clone()
        },
    };
    schedule.share_rounds(&keys);
    (KeyedSchedule { keys, schedule }, tasks)
}

/// Balanced orders of n tasks: a Williams square per block of n rounds.
///
/// In a block every task takes every position once and follows every other task once; for odd n a
/// block has 2n rounds, and everything occurs twice. Each block permutes the tasks at random. (E.
/// J. Williams 1949, "Experimental designs balanced for the estimation of residual effects of
/// treatments".) A task that follows one that streams through the caches starts worse than others,
/// so a fixed neighbour would be a bias.
pub struct Orders {
    names: Vec<usize>,
    turn: usize,
    rng: SeededRng,
}

impl Orders {
    /// Orders of `count` tasks.
    pub fn new(count: usize, seed: u64) -> Orders {
        Orders {
            names: (0..count).collect(),
            turn: 0,
            rng: SeededRng::new(seed),
        }
    }

    /// The next round's order.
    pub fn next(&mut self) -> Vec<usize> {
        let count = self.names.len();
        let block = count * (1 + count % 2);
        let turn = self.turn.checked_rem(block).unwrap_or(0);
        if turn == 0 {
            self.rng.shuffle(&mut self.names);
        }
        self.turn += 1;
        // 0, 1, n-1, 2, n-2, ...: every difference once.
        let zigzag = |k: usize| match k % 2 {
            1 => k.div_ceil(2),
            _ => count - k / 2,
        };
        let places = (0..count).map(|k| self.names[(zigzag(k) + turn) % count]);
        match turn < count {
            true => places.collect(),
            false => places.rev().collect(),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn protocol() -> Protocol {
        Protocol {
            rounds: [3, 40],
            task_ns: 1e6,
            cameras: 40,
            cold: false,
            seed: 1,
            cache_bytes: 0,
        }
    }

    #[test]
    fn cameras_follow_from_the_question_alone() {
        assert_eq!(cameras_within(25e6, 100_000), 50);
        assert_eq!(protocol().cameras_of(40), (0..40).collect::<Vec<_>>());
        assert_eq!(protocol().cameras_of(120)[..3], [0, 3, 6]);
        // However large the scene, a path has at least eight views.
        let few = Protocol {
            cameras: 0,
            ..protocol()
        };
        assert_eq!(few.cameras_of(40).len(), 8);
        assert_eq!(few.cameras_of(3), [0, 1, 2]);
        let cold = Protocol {
            cold: true,
            cameras: 500,
            ..protocol()
        };
        assert_eq!(cold.cameras_of(1000).len(), COLD_CAMERAS);
        assert_eq!(cold.cameras_of(0).len(), 0);
    }

    #[test]
    fn laps_are_long_enough_for_the_clock() {
        for ns in [1.0, 80.0, 1000.0, 1e5] {
            let batch = batch(ns, usize::MAX) as f64;
            assert!(CLOCK_NS <= MOST_OVERHEAD * batch * ns, "{ns}");
            assert!(batch == 1.0 || CLOCK_NS > MOST_OVERHEAD * batch / 2.0 * ns);
        }
        // The cameras once, or as often as the least lap requires.
        assert_eq!(batch(200.0, 40), 40);
        assert_eq!((batch(20.0, 40), batch(20.0, 1)), (280, 250));
    }

    #[test]
    fn slow_tasks_take_part_in_fewer_rounds() {
        let spin = |ns: u64| TimedTask {
            ask: Box::new(move |_, _| {
                let watch = Stopwatch::start();
                while watch.lap().cpu_ns < ns as f64 {}
            }),
            ask_many: None,
            all_threads: false,
            expected: vec![0; 40],
            least_ns: Some(1e5),
        };
        let tasks = [spin(1_000), spin(300_000)];
        // Time for forty rounds of the first, however slow its clock is.
        let protocol = Protocol {
            task_ns: 1e8,
            ..protocol()
        };
        let schedule = Schedule::new(40, &tasks, &protocol);
        assert_eq!(schedule.tasks[0].batch, 1);
        assert_eq!(schedule.tasks[0].every, 1);
        assert!(schedule.tasks[1].every >= 2, "{schedule:?}");
        assert!(schedule.rounds / schedule.tasks[1].every >= 3);
        // As if a twin's pilot had been interrupted.
        let mut shared = schedule.clone();
        let keys = |labels: [&str; 2]| labels.map(|label| (label.to_owned(), TaskKind::Query));
        shared.share_rounds(&keys(["bvh", "bvh#twin"]));
        assert_eq!([shared.tasks[0].every, shared.tasks[1].every], [1, 1]);
        shared = schedule.clone();
        shared.share_rounds(&keys(["bvh", "linear"]));
        assert_eq!(shared, schedule);
    }

    #[test]
    fn everyone_takes_every_place_and_follows_everyone_equally_often() {
        for (count, rounds, often) in [(2, 2, 1), (6, 6, 1), (8, 8, 1), (5, 10, 2), (9, 18, 2)] {
            let mut orders = Orders::new(count, 7);
            // A second block, permuted again.
            for _ in 0..2 {
                let mut taken = vec![vec![0; count]; count];
                let mut follows = vec![vec![0; count]; count];
                for _ in 0..rounds {
                    let order = orders.next();
                    for (place, &c) in order.iter().enumerate() {
                        taken[c][place] += 1;
                    }
                    for pair in order.windows(2) {
                        follows[pair[1]][pair[0]] += 1;
                    }
                }
                for c in 0..count {
                    assert!(taken[c].iter().all(|&n| n == often), "{count}: {taken:?}");
                    let others = (0..count).filter(|&other| other != c);
                    assert!(
                        others.clone().all(|other| follows[c][other] == often),
                        "{count}: {follows:?}"
                    );
                }
            }
        }
        assert!(Orders::new(0, 1).next().is_empty());
        assert_eq!(Orders::new(1, 1).next(), [0]);
    }
}
