//! The child's side of measurements over processes: `cullbench worker`.
//!
//! Not a command for users. It reads one request, does one process's share of a job, and writes
//! steps and results to standard output, a JSON line each.

use std::io::{self, BufRead, Write};
use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::{Arc, Mutex, PoisonError};
use std::thread;
use std::time::Duration;

use anyhow::bail;
use clap::Parser;
use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64;

use super::Ending;
use super::args::{Cli, Command};
use super::processes::{Job, Message, PROTOCOL, Request};
use super::{advise, drift, funnel, precision, run_plan};
use crate::index::{Registry, StructureSpec};
use crate::measure::{Part, TIMING, TaskSamples, measure_scene};

/// Error of a request whose job and arguments do not match.
const OTHER: &str = "a job of another command";
/// Exit code of a worker whose parent is gone.
const ORPHANED: i32 = 130;
/// Time between the reports of a worker that is timing.
const HEARTBEAT: Duration = Duration::from_secs(1);

pub fn worker(registry: &Registry) -> anyhow::Result<Ending> {
    send(&Message::Ready { protocol: PROTOCOL })?;
    let mut line = String::new();
    io::stdin().lock().read_line(&mut line)?;
    let request: Request = serde_json::from_str(&line)?;
    end_with_the_parent();
    match answer(registry, request) {
        Ok(()) => send(&Message::Done)?,
        Err(error) => send(&Message::Failed(super::without_repeats(&error)))?,
    }
    Ok(Ending::Ok)
}

fn answer(registry: &Registry, request: Request) -> anyhow::Result<()> {
    let at = Arc::new(At::default());
    // Before the processor is chosen: the thread may wake up on another one.
    at.clone().tell_of_turns();
    let _held = vary_layout(request.layout);
    crate::input::hold_files(request.files);
    for (source, file) in &request.spooled {
        crate::input::stand_in(source, file)?;
    }
    let typed = [String::new()].into_iter().chain(request.args);
    let command = Cli::try_parse_from(typed)?.command;
    match request.job {
        Job::Scene {
            scene,
            share,
            samples,
        } => {
            let plan = match command {
                Command::Run(args) => run_plan::plan(registry, &args)?.plan,
                Command::Advise(args) => advise::plan(registry, &args)?,
                _ => bail!(OTHER),
            };
            // Threads that are started later inherit this thread's processor.
            if !plan.structures.iter().any(StructureSpec::is_threaded) {
                stay_on(request.cpu);
            }
            let mut keep = |part: Part, of_tasks: Vec<TaskSamples>| {
                let of_tasks = if samples { of_tasks } else { Vec::new() };
                tell(&Message::Part(Box::new(part), of_tasks));
            };
            let notice = |structure: Option<&str>, step: &str| {
                if at.set(structure, step) && step != TIMING {
                    tell(&at.message());
                } else {
                    at.turns.fetch_add(1, Ordering::Relaxed);
                }
            };
            measure_scene(&plan, &plan.scenes[scene], &share, &mut keep, &notice)?;
        }
        Job::Times(timing) => {
            stay_on(request.cpu);
            at.set(None, TIMING);
            tell(&at.message());
            tell(&Message::Times(match command {
                Command::Advise(args) => advise::time(registry, &args, &timing)?,
                Command::Precision(args) => precision::time(registry, &args, &timing)?,
                Command::Funnel(args) => funnel::time(registry, &args, &timing)?,
                Command::Drift(args) => drift::time(&args, &timing)?,
                _ => bail!(OTHER),
            }));
        }
    }
    Ok(())
}

/// Current step of the process.
///
/// Turns of a timed pass, and repeated steps, are too short to report each: a thread reports the
/// current one every second, as long as they change. So silence means a turn that does not end, and
/// the parent knows its structure.
#[derive(Default)]
struct At {
    turns: AtomicU64,
    doing: Mutex<(Option<String>, String)>,
}

impl At {
    /// Sets the step; true if it changed.
    fn set(&self, structure: Option<&str>, step: &str) -> bool {
        let mut doing = self.doing.lock().unwrap_or_else(PoisonError::into_inner);
        if doing.0.as_deref() == structure && doing.1 == step {
            return false;
        }
        *doing = (structure.map(str::to_owned), step.to_owned());
        true
    }

    fn message(&self) -> Message {
        let doing = self.doing.lock().unwrap_or_else(PoisonError::into_inner);
        let (structure, step) = doing.clone();
        Message::Doing { structure, step }
    }

    fn tell_of_turns(self: Arc<Self>) {
        thread::spawn(move || {
            let mut told = 0;
            loop {
                thread::sleep(HEARTBEAT);
                let turns = self.turns.load(Ordering::Relaxed);
                // The main thread detects the closed pipe by itself.
                if turns != told && send(&self.message()).is_err() {
                    return;
                }
                told = turns;
            }
        });
    }
}

/// Sends a message; ends this process if the parent is gone.
fn tell(message: &Message) {
    if send(message).is_err() {
        std::process::exit(ORPHANED);
    }
}

/// Ends this process together with its parent.
///
/// Standard input has nothing after the request, so it ends when the parent does.
fn end_with_the_parent() {
    thread::spawn(|| {
        let _ = io::copy(&mut io::stdin().lock(), &mut io::sink());
        std::process::exit(ORPHANED);
    });
    // A suspended process does not notice the end of its input.
    #[cfg(target_os = "linux")]
    let _ = rustix::process::set_parent_process_death_signal(Some(rustix::process::Signal::KILL));
}

fn send(message: &Message) -> io::Result<()> {
    let text = serde_json::to_string(message)? + "\n";
    let mut out = io::stdout().lock();
    out.write_all(text.as_bytes())?;
    out.flush()
}

/// Pins this process to one processor, if the system can.
///
/// So it does not migrate in the middle of a round.
fn stay_on(cpu: Option<usize>) {
    #[cfg(target_os = "linux")]
    if let Some(cpu) = cpu {
        let mut set = rustix::thread::CpuSet::new();
        set.set(cpu);
        // An unavailable processor is no reason not to measure.
        let _ = rustix::thread::sched_setaffinity(None, &set);
    }
    #[cfg(not(target_os = "linux"))]
    let _ = cpu;
}

/// Allocates memory and frees some of it, to vary the memory layout per process.
///
/// Otherwise a system reuses the pages of the last process: all pairs of a comparison would compare
/// the same two layouts, with a spurious difference of some percent.
fn vary_layout(seed: u64) -> Vec<Vec<u8>> {
    let mut rng = Pcg64::seed_from_u64(seed);
    let mut held = Vec::new();
    let mut given_back = Vec::new();
    for _ in 0..rng.random_range(16..64) {
        let block = vec![1; rng.random_range(1..256) * 1024];
        match rng.random() {
            true => held.push(block),
            false => given_back.push(block),
        }
    }
    held
}
