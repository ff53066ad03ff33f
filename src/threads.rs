//! Distribution of work over threads, and the limit of their number.
//!
//! Builds start threads to share work; queries use [`Workers`], which persist. Callers define jobs
//! and the order of results.

use std::collections::BTreeMap;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Mutex, PoisonError};

/// Most threads of a pool: the system may not create more.
pub const MOST_THREADS: usize = 256;

/// The threads that a build may use, and whether a build has used them.
#[derive(Debug)]
pub struct Pool {
    threads: usize,
    asked: AtomicBool,
}

impl Pool {
    /// A pool of at least 1, at most 256 threads.
    pub fn new(threads: usize) -> Pool {
        let (threads, asked) = (threads.clamp(1, MOST_THREADS), AtomicBool::new(false));
        Pool { threads, asked }
    }

    /// Number of threads that the build may use.
    pub fn threads(&self) -> usize {
        self.asked.store(true, Ordering::Relaxed);
        self.threads
    }

    /// Returns true if [`Pool::threads`] was called: else a build is single-threaded.
    pub fn was_used(&self) -> bool {
        self.asked.load(Ordering::Relaxed)
    }
}

/// Does every job on `threads` threads, this one included.
///
/// A free thread takes the next job. With one thread, or one job, the jobs are done in order on
/// this thread.
///
/// If the system cannot create them, this thread does the work. Starting a thread takes about 20 to
/// 50 us: jobs pay from a fraction of a millisecond on.
///
/// # Panics
/// If a job panics.
pub fn share<J: Send>(
    threads: usize,
    jobs: impl Iterator<Item = J> + Send,
    work: impl Fn(J) + Sync,
) {
    let threads = jobs.size_hint().1.map_or(threads, |most| threads.min(most));
    match (threads > 1).then(|| Workers::new(threads)) {
        Some(Ok(workers)) => workers.share(jobs, work),
        _ => jobs.for_each(work),
    }
}

/// Results of jobs in their order, done as [`share`] does them.
///
/// # Panics
/// If a job panics.
pub fn map<J: Send, R: Send>(
    threads: usize,
    jobs: impl Iterator<Item = J> + Send,
    work: impl Fn(J) -> R + Sync,
) -> Vec<R> {
    let done = Mutex::new(BTreeMap::new());
    share(threads, jobs.enumerate(), |(n, job)| {
        let result = work(job);
        let mut done = done.lock().unwrap_or_else(PoisonError::into_inner);
        done.insert(n, result);
    });
    let done = done.into_inner().unwrap_or_else(PoisonError::into_inner);
    done.into_values().collect()
}

/// Threads that persist between queries; the calling thread is one of them.
pub struct Workers {
    others: rayon::ThreadPool,
    threads: usize,
}

impl Workers {
    /// At least 1, at most 256 threads.
    ///
    /// # Errors
    /// The system cannot create that many threads.
    pub fn new(threads: usize) -> Result<Workers, rayon::ThreadPoolBuildError> {
        let threads = threads.clamp(1, MOST_THREADS);
        let others = rayon::ThreadPoolBuilder::new().num_threads((threads - 1).max(1));
        let others = others.build()?;
        Ok(Workers { others, threads })
    }

    /// [`share`] among these threads, which start within microseconds.
    ///
    /// # Panics
    /// If a job panics.
    pub fn share<J: Send>(&self, jobs: impl Iterator<Item = J> + Send, work: impl Fn(J) + Sync) {
        let most = jobs.size_hint().1.unwrap_or(usize::MAX);
        let jobs = Mutex::new(jobs.fuse());
        let next = || jobs.lock().unwrap_or_else(PoisonError::into_inner).next();
        let work_off = || std::iter::from_fn(next).for_each(&work);
        self.others.in_place_scope(|scope| {
            for _ in 1..self.threads.min(most) {
                scope.spawn(|_| work_off());
            }
            work_off();
        });
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::collections::HashSet;
    use std::sync::Barrier;

    #[test]
    fn every_job_is_done_once_whatever_the_number_of_threads() {
        for threads in [0, 1, 2, 3, 5, 1000] {
            let mut done = [0; 100];
            share(threads, done.iter_mut(), |job| *job += 1);
            assert_eq!(done, [1; 100], "{threads}");
            let workers = Workers::new(threads.min(5)).unwrap();
            workers.share(done.iter_mut(), |job| *job += 1);
            assert_eq!(done, [2; 100], "{threads}");
        }
    }

    #[test]
    fn jobs_run_at_the_same_time() {
        // No thread passes the barrier alone.
        let (barrier, seen) = (Barrier::new(3), Mutex::new(HashSet::new()));
        share(3, 0..3, |_| {
            barrier.wait();
            seen.lock().unwrap().insert(std::thread::current().id());
        });
        assert_eq!(seen.into_inner().unwrap().len(), 3);
    }
}
