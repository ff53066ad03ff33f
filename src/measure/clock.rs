//! The two clocks: thread CPU time and wall time.
//!
//! Structures are ranked by CPU time, because a shared machine may take the core away; wall time is
//! reported beside it.

use std::time::Instant;

use cpu_time::{ProcessTime, ThreadTime};

use crate::statistics::median;

/// Time between two readings, in nanoseconds.
#[derive(Clone, Copy, Default, PartialEq, Debug)]
pub struct Lap {
    /// CPU time of this thread, or of all threads.
    pub cpu_ns: f64,
    /// Wall time, which includes other programs.
    pub wall_ns: f64,
}

impl Lap {
    /// The work of a lap, minus the cost of an `empty` one.
    ///
    /// At least a thirty-second of that cost, the precision to which it is known.
    pub fn less(self, empty: Lap) -> Lap {
        let less = |lap: f64, empty: f64| (lap - empty).max(empty / 32.0);
        Lap {
            cpu_ns: less(self.cpu_ns, empty.cpu_ns),
            wall_ns: less(self.wall_ns, empty.wall_ns),
        }
    }
}

/// Both clocks, read together.
///
/// The CPU clock is read innermost, since structures are ranked by it.
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

    /// Starts both clocks; the CPU clock of all threads if threads share the work.
    #[inline]
    pub fn start_for(all_threads: bool) -> Self {
        Stopwatch {
            wall: Instant::now(),
            process: all_threads.then(ProcessTime::now),
            cpu: ThreadTime::now(),
        }
    }

    /// Cost of a lap: medians of a few without work, at the machine's current speed.
    pub fn empty_lap(all_threads: bool) -> Lap {
        let laps = [(); 9].map(|()| Stopwatch::start_for(all_threads).lap());
        let middle = |of: fn(&Lap) -> f64| median(&laps.each_ref().map(of)).unwrap_or(0.0);
        Lap {
            cpu_ns: middle(|lap| lap.cpu_ns),
            wall_ns: middle(|lap| lap.wall_ns),
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
