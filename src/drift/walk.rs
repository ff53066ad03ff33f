//! Taking many steps of one kind and looking at where they led, and the time a
//! step takes. What a step is, its owners know.

use std::hint::black_box;

use crate::measure::Stopwatch;
use crate::statistics::median;

/// Takes equal steps of one kind: the places after each of the ascending numbers
/// of them.
pub type Walk<S, P> = fn(&S, &[u64]) -> Vec<P>;

/// A [`Walk`] by what a step does to the walker and where that is then.
pub fn walk<W, S, P>(
    mut walker: W,
    by: &S,
    looks: &[u64],
    step: impl Fn(&mut W, &S),
    place: impl Fn(&W) -> P,
) -> Vec<P> {
    let mut taken = 0;
    let mut places = Vec::with_capacity(looks.len());
    for &look in looks {
        for _ in taken..look {
            // Hidden, so that nothing is computed once for all steps.
            step(&mut walker, black_box(by));
        }
        taken = look;
        places.push(place(&walker));
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

    #[test]
    fn looks_are_taken_after_exactly_so_many_steps() {
        let places = walk(5, &3, &[0, 1, 10, 10, 12], |at, by| *at += by, |at| *at);
        assert_eq!(places, [5, 8, 35, 35, 41]);
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
