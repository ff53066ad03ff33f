//! The estimators with a simulated clock.
//!
//! How often do intervals contain the truth, how often is a verdict false, how often is a change
//! detected? The clock has the variances measured on a shared machine of two virtual cores, as
//! standard deviations of logarithms: processes 16-18 %, rounds of a process 17-20 % with two
//! speeds (1.15 against 1.75 to 2.0, autocorrelation 0.25), memory layout up to 1.1 %, the
//! difference of a pair of processes 3 %.

use rand::RngExt;
use rand::SeedableRng;
use rand_pcg::Pcg64;

use super::*;

const ROUNDS: usize = 77;
const PROCESSES: usize = 10;
/// Pairs of a comparison: initially, and at most.
const PAIRS: [usize; 2] = [10, 32];
const CELLS: usize = 14;

/// A machine with two speeds, and its clock.
struct Clock {
    rng: Pcg64,
}

impl Clock {
    fn new(seed: u64) -> Clock {
        Clock {
            rng: Pcg64::seed_from_u64(seed),
        }
    }

    fn uniform(&mut self, low: f64, high: f64) -> f64 {
        low + (high - low) * self.rng.random::<f64>()
    }

    /// A normal number, by Box and Muller.
    fn normal(&mut self, deviation: f64) -> f64 {
        let radius = (-2.0 * self.uniform(f64::MIN_POSITIVE, 1.0).ln()).sqrt();
        deviation * radius * self.uniform(0.0, std::f64::consts::TAU).cos()
    }

    /// Share of a process's time in which the other hardware thread is busy.
    fn busy(&mut self) -> f64 {
        self.uniform(0.1, 0.9)
    }

    /// ln(time) of the rounds of a tree's process.
    ///
    /// Two speeds; a speed persists from round to round with autocorrelation 0.25.
    fn tree_rounds(&mut self, busy: f64) -> Vec<f64> {
        let layout = self.normal(0.008);
        let mut slow = self.uniform(0.0, 1.0) < busy;
        let mut round = || {
            if self.uniform(0.0, 1.0) >= 0.25 {
                slow = self.uniform(0.0, 1.0) < busy;
            }
            let speed = if slow { self.uniform(1.75, 2.0) } else { 1.15 };
            speed.ln() + layout + self.normal(0.03)
        };
        (0..ROUNDS).map(|_| round()).collect()
    }

    /// ln(time) of a process of `linear`, hardly affected by the other thread.
    fn linear(&mut self, busy: f64) -> f64 {
        7.0 + 0.02 * busy + self.normal(0.01)
    }

    /// ln(time) of `linear` and of a tree in the same processes.
    fn run(&mut self, processes: usize) -> (Vec<f64>, Vec<f64>) {
        let process = |_| {
            let busy = self.busy();
            let tree = interquartile_mean(&self.tree_rounds(busy)).unwrap();
            (self.linear(busy), tree)
        };
        (0..processes).map(process).unzip()
    }

    /// ln(new / old) of a pair of processes that alternate on one core.
    ///
    /// Disturbances longer than a turn affect both alike. One pair in ten meets a load.
    fn pair(&mut self, change: f64) -> f64 {
        let loaded = self.uniform(0.0, 1.0) < 0.1;
        change + self.normal(if loaded { 0.05 } else { 0.028 })
    }

    /// A comparison that adds pairs until it resolves 5 %.
    fn comparison(&mut self, changes: &[f64]) -> Vec<Option<Judgement>> {
        let mut cells = vec![Vec::new(); changes.len()];
        loop {
            let count = cells[0].len();
            for (cell, change) in cells.iter_mut().zip(changes) {
                cell.extend((count..PAIRS[0].max(count + 2)).map(|_| self.pair(*change)));
            }
            let judged = judge(&cells, 0.05);
            if resolved(&judged, 0.05) || cells[0].len() >= PAIRS[1] {
                return judged;
            }
        }
    }
}

fn deviation(values: &[f64]) -> f64 {
    let mean = values.iter().sum::<f64>() / values.len() as f64;
    let squares: f64 = values.iter().map(|v| (v - mean).powi(2)).sum();
    (squares / (values.len() - 1) as f64).sqrt()
}

/// Returns true if `share` of `count` lies in `low..=high`.
fn within(share: usize, count: usize, low: f64, high: f64) -> bool {
    (low..=high).contains(&(share as f64 / count as f64))
}

#[test]
fn the_mock_clock_has_the_measured_variances() {
    let mut clock = Clock::new(1);
    let (_, tree) = clock.run(500);
    let processes = deviation(&tree);
    assert!((0.15..0.20).contains(&processes), "{processes}");
    let rounds = (0..200).map(|_| {
        let busy = clock.busy();
        deviation(&clock.tree_rounds(busy))
    });
    let rounds = median(&rounds.collect::<Vec<_>>()).unwrap();
    assert!((0.17..0.25).contains(&rounds), "{rounds}");
    let pairs: Vec<f64> = (0..2000).map(|_| clock.pair(0.0)).collect();
    assert!((0.028..0.033).contains(&deviation(&pairs)));
}

#[test]
fn intervals_of_a_run_hold_the_truth() {
    const RUNS: usize = 400;
    let mut clock = Clock::new(2);
    let (linear, tree) = clock.run(4000);
    let shown = |linear: &[f64], tree: &[f64]| {
        let estimates = [one_run(linear, tree), speedup(linear, tree)];
        estimates.map(Option::unwrap)
    };
    let truth = shown(&linear, &tree).map(|of| of.value);
    let mut held = [0, 0];
    for _ in 0..RUNS {
        let (linear, tree) = clock.run(PROCESSES);
        for (i, found) in shown(&linear, &tree).into_iter().enumerate() {
            let holds = found.lower <= Some(truth[i]) && Some(truth[i]) <= found.upper;
            held[i] += usize::from(holds);
        }
    }
    let [values, speedups] = held;
    assert!(within(values, RUNS, 0.92, 0.98), "{values} of {RUNS}");
    assert!(within(speedups, RUNS, 0.92, 0.98), "{speedups} of {RUNS}");
}

#[test]
fn equal_binaries_are_rarely_called_slower() {
    const RUNS: usize = 400;
    let mut clock = Clock::new(3);
    let (mut alarms, mut false_verdicts, mut held) = (0, 0, 0);
    for _ in 0..RUNS {
        let judged = clock.comparison(&[0.0; CELLS]);
        let cells: Vec<Judgement> = judged.into_iter().flatten().collect();
        let are = |change| cells.iter().filter(|cell| cell.change == change).count();
        alarms += usize::from(are(Change::Slower) > 0);
        false_verdicts += are(Change::Slower) + are(Change::Faster);
        let holds = |cell: &&Judgement| cell.lower <= Some(1.0) && Some(1.0) <= cell.upper;
        held += cells.iter().filter(holds).count();
    }
    assert!(within(alarms, RUNS, 0.0, 0.05), "{alarms} of {RUNS}");
    assert!(
        within(false_verdicts, RUNS * CELLS, 0.0, 0.01),
        "{false_verdicts}"
    );
    assert!(within(held, RUNS * CELLS, 0.93, 0.97), "{held}");
}

#[test]
fn a_change_of_five_percent_is_found() {
    const RUNS: usize = 400;
    let mut clock = Clock::new(4);
    let mut changes = [0.0; CELLS];
    changes[5] = 0.05f64.ln_1p();
    changes[9] = -0.05f64.ln_1p();
    let (mut slower, mut faster) = (0, 0);
    for _ in 0..RUNS {
        let judged = clock.comparison(&changes);
        let is = |i: usize, change| judged[i].is_some_and(|j| j.change == change);
        slower += usize::from(is(5, Change::Slower));
        faster += usize::from(is(9, Change::Faster));
    }
    assert!(within(slower, RUNS, 0.95, 1.0), "{slower} of {RUNS}");
    assert!(within(faster, RUNS, 0.95, 1.0), "{faster} of {RUNS}");
}

#[test]
fn a_machine_with_two_speeds_is_told_from_one_with_noise() {
    let mut clock = Clock::new(5);
    let (mut right, mut wrong) = (0, 0);
    for _ in 0..100 {
        let busy = clock.uniform(0.35, 0.65);
        let two: Vec<f64> = clock.tree_rounds(busy).iter().map(|x| x.exp()).collect();
        right += usize::from(two_speeds(&two).is_some());
        let one: Vec<f64> = (0..ROUNDS).map(|_| clock.normal(0.2).exp()).collect();
        wrong += usize::from(two_speeds(&one).is_some());
    }
    assert!(right >= 95 && wrong <= 1, "{right} {wrong}");
}
