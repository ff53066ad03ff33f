//! Taking many steps of one kind and looking at where they led, and the time a
//! step takes. What a step is, its owners know.

use std::hint::black_box;

use crate::measure::Stopwatch;
use crate::statistics::median;

/// Something that moves by equal steps.
pub trait Walker {
    type Step;
    type Place;

    fn start() -> Self;
    fn step(&mut self, by: &Self::Step);
    fn place(&self) -> Self::Place;
}

/// The places after each of the ascending numbers of steps.
pub fn walk<W: Walker>(step: &W::Step, looks: &[u64]) -> Vec<W::Place> {
    let mut walker = W::start();
    let mut taken = 0;
    let mut places = Vec::with_capacity(looks.len());
    for &look in looks {
        for _ in taken..look {
            // Hidden, so that nothing is computed once for all steps.
            walker.step(black_box(step));
        }
        taken = look;
        places.push(walker.place());
    }
    places
}

/// Samples that a time is the median of.
const ROUNDS: usize = 15;

/// Median thread CPU time in nanoseconds of one step of each job, where `run`
/// does `steps` steps of one. The jobs take turns, so that a change of the
/// machine's speed meets all of them.
pub fn ns_per_step<J>(jobs: &[J], steps: u64, mut run: impl FnMut(&J)) -> Vec<f64> {
    let mut samples = vec![Vec::with_capacity(ROUNDS); jobs.len()];
    for _ in 0..ROUNDS {
        for (job, samples) in jobs.iter().zip(&mut samples) {
            let watch = Stopwatch::start();
            run(job);
            samples.push(watch.lap().cpu_ns / steps as f64);
        }
    }
    let medians = samples.iter().map(|samples| median(samples));
    medians.map(|ns| ns.unwrap_or(f64::NAN)).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    struct Counter(u64);

    impl Walker for Counter {
        type Step = u64;
        type Place = u64;

        fn start() -> Self {
            Counter(5)
        }

        fn step(&mut self, by: &u64) {
            self.0 += by;
        }

        fn place(&self) -> u64 {
            self.0
        }
    }

    #[test]
    fn looks_are_taken_after_exactly_so_many_steps() {
        assert_eq!(walk::<Counter>(&3, &[0, 1, 10, 10, 12]), [5, 8, 35, 35, 41]);
    }

    #[test]
    fn every_job_is_timed_as_often() {
        let mut runs = [0, 0];
        let times = ns_per_step(&[0, 1], 10, |&job: &usize| runs[job] += 1);
        assert_eq!(runs, [ROUNDS; 2]);
        assert!(
            times.len() == 2 && times.iter().all(|ns| *ns >= 0.0),
            "{times:?}"
        );
    }
}
