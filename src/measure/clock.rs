//! The two clocks: thread CPU time for ranking (a shared machine may take the
//! core away), wall time beside it.

use std::time::Instant;

use cpu_time::{ProcessTime, ThreadTime};

/// Time between two readings, in nanoseconds.
#[derive(Clone, Copy, Default, PartialEq, Debug)]
pub struct Lap {
    /// CPU time of this thread, or of all threads.
    pub cpu_ns: f64,
    /// Wall time, other programs included.
    pub wall_ns: f64,
}

/// Both clocks, read together. The CPU clock is read innermost: it is the one
/// that ranks.
pub struct Stopwatch {
    wall: Instant,
    process: Option<ProcessTime>,
    cpu: ThreadTime,
}

impl Stopwatch {
    /// Starts both clocks.
    #[inline]
    pub fn start() -> Self {
        Stopwatch::start_for(false)
    }

    /// Starts both clocks; the CPU clock of all threads for work that threads share.
    #[inline]
    pub fn start_for(all_threads: bool) -> Self {
        let wall = Instant::now();
        Stopwatch {
            wall,
            process: all_threads.then(ProcessTime::now),
            cpu: ThreadTime::now(),
        }
    }

    /// The time since [`Stopwatch::start`].
    #[inline]
    pub fn lap(&self) -> Lap {
        let cpu = match &self.process {
            Some(process) => process.elapsed(),
            None => self.cpu.elapsed(),
        };
        let wall = self.wall.elapsed();
        Lap {
            cpu_ns: cpu.as_nanos() as f64,
            wall_ns: wall.as_nanos() as f64,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn cpu_time_runs_while_working_and_rests_while_sleeping() {
        let watch = Stopwatch::start();
        std::thread::sleep(std::time::Duration::from_millis(30));
        let slept = watch.lap();
        assert!(slept.wall_ns >= 30e6 && slept.cpu_ns < 20e6, "{slept:?}");
        let watch = Stopwatch::start();
        let mut x = 1u64;
        while watch.lap().wall_ns < 20e6 {
            x = std::hint::black_box(x.wrapping_mul(3));
        }
        assert!(watch.lap().cpu_ns > 1e6);
    }
}
