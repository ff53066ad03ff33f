//! The parent's side of measurements over processes.
//!
//! Starts a worker, reads its messages, and determines what ended it: memory, time, a signal, or
//! the user.

use std::collections::BTreeMap;
use std::io::{self, BufRead, BufReader, Read, Write};
use std::iter;
use std::path::{Path, PathBuf};
use std::process::{Child, ChildStdin, Command, ExitStatus, Stdio};
use std::sync::mpsc::{Receiver, RecvTimeoutError, sync_channel};
use std::thread::{self, JoinHandle};
use std::time::{Duration, Instant};

use anyhow::{Context, bail, ensure};
use serde::de::DeserializeOwned;
use serde::{Deserialize, Serialize};
use serde_json::Value;
use tempfile::NamedTempFile;

use super::interrupt;
use crate::input;
use crate::measure::{Part, ProcessTimes, Share, Status, TaskSamples, Verdict};
use crate::report::temporary_in;
use crate::shown::shortened;

/// Longest wait before checking for a request to stop.
const POLL_EVERY: Duration = Duration::from_millis(20);
/// Step of a worker that has not reported any.
const STARTING: &str = "starting";
/// Most bytes kept of a worker's last output.
const LAST_WORDS: usize = 4096;

/// Longest first line of a worker, bytes: another program may never end its first.
const LONGEST_FIRST: u64 = 1 << 16;
/// Longest line, bytes: the samples of a million cameras fit.
const LONGEST: u64 = 1 << 29;
/// Most unread lines before the worker must wait.
const WAITING: usize = 16;

/// The process of a worker died at this structure, with this verdict.
#[derive(Debug, thiserror::Error)]
#[error("{}{}; expected one that finishes its work",
    .0.as_ref().map_or(String::new(), |structure| format!("{structure}: ")),
    .1.reason.as_deref().unwrap_or_default())]
pub struct Died(pub Option<String>, pub Verdict);

/// Longest time between two checks of a worker; beyond, the parent was suspended.
const LONGEST_GAP: Duration = Duration::from_secs(1);

/// A running worker.
pub struct Worker {
    child: Child,
    /// Kept open: its end signals the worker that its parent is gone.
    _stdin: Option<ChildStdin>,
    lines: Receiver<io::Result<Vec<u8>>>,
    last_words: Option<JoinHandle<Vec<u8>>>,
    doing: (Option<String>, String),
    /// Time since the last message, without suspensions of this process (Ctrl-Z).
    waited: Duration,
    looked: Instant,
    pub patience: Duration,
}

impl Worker {
    /// Waits for the next message; `None` without one within `wait`.
    ///
    /// # Errors
    /// A message that no worker of this version sends, or that its scene cannot be loaded;
    /// [`Died`], whether observed or caused here.
    pub fn listen(&mut self, wait: Duration) -> anyhow::Result<Option<Message>> {
        let gap = std::mem::replace(&mut self.looked, Instant::now()).elapsed();
        self.waited += gap.min(LONGEST_GAP);
        let line = match self.lines.recv_timeout(wait) {
            Ok(line) => line?,
            Err(RecvTimeoutError::Timeout) if self.waited <= self.patience => return Ok(None),
            Err(ended) => {
                let (structure, step) = self.doing.clone();
                let verdict = if ended == RecvTimeoutError::Timeout {
                    // Its current step took too long.
                    self.kill();
                    let reason = format!("{step} took longer than {} s", self.patience.as_secs());
                    Verdict::new(Status::TimedOut, reason)
                } else {
                    let status = self.child.wait()?;
                    let words = self.last_words.take().and_then(|words| words.join().ok());
                    let words = words.unwrap_or_default();
                    cause(status, &step, &String::from_utf8_lossy(&words))
                };
                return Err(Died(structure, verdict).into());
            }
        };
        self.waited = Duration::ZERO;
        let message = serde_json::from_slice(&line).map_err(|_| {
            let text = String::from_utf8_lossy(&line[..line.len().min(300)]);
            let text = shortened(text.trim_end(), 60);
            // A worker that has reported a step uses the same protocol: a structure prints.
            let is_first = self.doing.1 == STARTING;
            let why = ["", ": the program is of another version"][usize::from(is_first)];
            let who = self.doing.0.as_deref().unwrap_or("a worker");
            anyhow::anyhow!("{who} printed '{text}'; expected messages of protocol {PROTOCOL}{why}")
        })?;
        match &message {
            Message::Ready { protocol } => ensure!(
                *protocol == PROTOCOL,
                "the program speaks protocol {protocol}; expected {PROTOCOL}: it is of another \
                 version"
            ),
            Message::Doing { structure, step } => self.doing = (structure.clone(), step.clone()),
            Message::Failed(reason) => bail!("{reason}"),
            _ => {}
        }
        Ok(Some(message))
    }

    fn kill(&mut self) {
        let _ = self.child.kill();
        let _ = self.child.wait();
    }

    /// Suspends or resumes the process; systems without such signals let it run.
    pub fn hold(&self, is_held: bool) {
        #[cfg(unix)]
        if let Some(pid) = rustix::process::Pid::from_raw(self.child.id().cast_signed()) {
            use rustix::process::{Signal, kill_process};
            let _ = kill_process(pid, if is_held { Signal::STOP } else { Signal::CONT });
        }
        #[cfg(not(unix))]
        let _ = is_held;
    }
}

impl Drop for Worker {
    fn drop(&mut self) {
        self.kill();
    }
}

/// Verdict on a process that ended by itself.
fn cause(status: ExitStatus, step: &str, words: &str) -> Verdict {
    // The allocator of std prints this before it aborts.
    if let Some(at) = words.find("memory allocation of") {
        let said = words[at..].lines().next().unwrap_or_default();
        return Verdict::new(Status::OutOfMemory, format!("while {step}: {said}"));
    }
    #[cfg(unix)]
    if let Some(signal) = std::os::unix::process::ExitStatusExt::signal(&status) {
        const SIGKILL: i32 = 9;
        let by_system = format!("killed while {step}: the system was out of memory, most likely");
        let by_itself = format!("ended by signal {signal} while {step}");
        return match signal {
            SIGKILL => Verdict::new(Status::OutOfMemory, by_system),
            _ => Verdict::new(Status::Panicked, by_itself),
        };
    }
    let last = words.lines().rev().find(|line| !line.trim().is_empty());
    // Hints about backtraces follow the message of a panic.
    let is_before = |line: &&str| !line.contains(" panicked at ");
    let last = words.lines().skip_while(is_before).nth(1).or(last);
    let last = last.map(|last| format!(": {last}")).unwrap_or_default();
    let reason = format!("ended while {step} ({status}){last}");
    Verdict::new(Status::Panicked, reason)
}

/// A program, with the common input of all its workers.
pub struct Workers {
    pub program: PathBuf,
    args: Vec<String>,
    patience: Duration,
    cpus: Vec<usize>,
    /// Files with the bytes of pipes, for workers to read.
    spooled: BTreeMap<String, PathBuf>,
    _spool: Vec<NamedTempFile>,
}

impl Workers {
    /// Workers of this program; files in `folder` replace pipes.
    ///
    /// # Errors
    /// Such a file cannot be written.
    pub fn new(args: Vec<String>, patience: Duration, folder: &Path) -> anyhow::Result<Workers> {
        let (mut spool, mut spooled) = (Vec::new(), BTreeMap::new());
        for (source, bytes) in input::pipes() {
            let write = |mut file: NamedTempFile| file.write_all(&bytes).map(|()| file);
            let kept = temporary_in(folder).and_then(write);
            let place = || format!("{source}: cannot be copied for the processes to read");
            let file = kept.map_err(input::bare).with_context(place)?;
            spooled.insert(source, std::path::absolute(file.path())?);
            spool.push(file);
        }
        Ok(Workers {
            program: own_program()?,
            args,
            patience,
            cpus: processors(),
            spooled,
            _spool: spool,
        })
    }

    /// The same workers of another program, on the last processor.
    pub fn of(mut self, program: &Path) -> Workers {
        self.program = program.to_owned();
        self.cpus.drain(..self.cpus.len().saturating_sub(1));
        self
    }

    /// Starts a worker on the next processor; `layout` determines its memory layout.
    ///
    /// # Errors
    /// The program cannot be started.
    pub fn start(&self, process: u32, layout: u64, job: Job) -> anyhow::Result<Worker> {
        let request = Request {
            protocol: PROTOCOL,
            args: self.args.clone(),
            spooled: self.spooled.clone(),
            files: input::held_files(),
            job,
            cpu: self.cpus.iter().cycle().nth(process as usize).copied(),
            layout,
        };
        let mut command = Command::new(&self.program);
        // A terminal sends Ctrl-C to a whole group, and would end a worker that has no handler yet:
        // its cells would count as failed.
        #[cfg(unix)]
        {
            use std::os::unix::process::CommandExt;
            command.process_group(0).arg0(super::program::name());
        }
        let mut child = command
            .arg(super::WORKER)
            .stdin(Stdio::piped())
            .stdout(Stdio::piped())
            .stderr(Stdio::piped())
            .spawn()
            .with_context(|| self.program.display().to_string())?;
        let (send, lines) = sync_channel(WAITING);
        if let Some(out) = child.stdout.take() {
            thread::spawn(move || {
                let mut out = BufReader::new(out);
                for most in iter::once(LONGEST_FIRST).chain(iter::repeat(LONGEST)) {
                    let mut line = Vec::new();
                    // A truncated line is not a message.
                    let read = (&mut out).take(most).read_until(b'\n', &mut line);
                    let ended = read.is_err();
                    if matches!(read, Ok(0)) || send.send(read.map(|_| line)).is_err() || ended {
                        break;
                    }
                }
            });
        }
        let last_words = child.stderr.take().map(|mut err| {
            thread::spawn(move || {
                let (mut kept, mut some) = (Vec::new(), [0; 1024]);
                while let Ok(n @ 1..) = err.read(&mut some) {
                    kept.extend_from_slice(&some[..n]);
                    let excess = kept.len().saturating_sub(LAST_WORDS);
                    kept.drain(..excess);
                }
                kept
            })
        });
        let mut stdin = child.stdin.take();
        let line = serde_json::to_string(&request)? + "\n";
        // A program that does not read it fails later.
        let _ = stdin.as_mut().map(|stdin| stdin.write_all(line.as_bytes()));
        Ok(Worker {
            child,
            _stdin: stdin,
            lines,
            last_words,
            doing: (None, STARTING.to_owned()),
            waited: Duration::ZERO,
            looked: Instant::now(),
            patience: self.patience,
        })
    }

    /// Runs a job in a separate process, on the next processor.
    ///
    /// # Errors
    /// The program cannot be started; the errors of [`Worker::listen`] and of `keep`;
    /// [`interrupt::Interrupted`].
    pub fn see_through(
        &self,
        process: u32,
        job: Job,
        keep: &mut dyn FnMut(Message) -> anyhow::Result<()>,
        tell: &dyn Fn(&str),
    ) -> anyhow::Result<()> {
        let mut worker = self.start(process, u64::from(process), job)?;
        loop {
            interrupt::check()?;
            match worker.listen(POLL_EVERY)? {
                Some(Message::Ready { .. }) => tell("started"),
                Some(Message::Doing { structure, step }) => {
                    tell(format!("{step} {}", structure.unwrap_or_default()).trim_end());
                }
                Some(Message::Done) => return Ok(()),
                Some(found) => keep(found)?,
                None => {}
            }
        }
    }

    /// Runs a job; returns what `pick` selects from its messages.
    ///
    /// # Errors
    /// The errors of [`Workers::see_through`].
    pub fn found<T>(
        &self,
        process: u32,
        job: Job,
        step: &dyn Fn(&str),
        pick: impl Fn(Message) -> Option<T>,
    ) -> anyhow::Result<Vec<T>> {
        let mut found = Vec::new();
        let mut keep = |said| {
            found.extend(pick(said));
            Ok(())
        };
        self.see_through(process, job, &mut keep, step)?;
        Ok(found)
    }
}

/// The running program; on Linux even if its file has been replaced.
fn own_program() -> anyhow::Result<PathBuf> {
    let named = std::env::current_exe();
    #[cfg(target_os = "linux")]
    {
        use std::os::unix::fs::MetadataExt;
        let running = PathBuf::from("/proc/self/exe");
        let file = |path: &Path| path.metadata().ok().map(|file| (file.dev(), file.ino()));
        let held = file(&running);
        // Under an emulator, such as valgrind, the running program is not the named one.
        let is_other = |own: &PathBuf| own.exists() && file(own) != held;
        if held.is_some() && !named.as_ref().is_ok_and(is_other) {
            return Ok(running);
        }
    }
    named.context("this program cannot be found again")
}

/// The processors that this process may run on; empty if unknown.
fn processors() -> Vec<usize> {
    #[cfg(target_os = "linux")]
    if let Ok(set) = rustix::thread::sched_getaffinity(None) {
        let all = 0..rustix::thread::CpuSet::MAX_CPU;
        return all.filter(|&cpu| set.is_set(cpu)).collect();
    }
    Vec::new()
}

/// Version of requests and messages.
///
/// Raised when they change: programs of different versions do not understand each other.
pub const PROTOCOL: u32 = 7;

/// Work of one process.
#[derive(Clone, Serialize, Deserialize)]
pub struct Request {
    /// Sent for workers of other versions; the worker's first line is what is compared.
    pub protocol: u32,
    /// The arguments of the command, from which everything else follows.
    pub args: Vec<String>,
    /// Files that replace pipes, which only the parent can read.
    pub spooled: BTreeMap<String, PathBuf>,
    /// SHA-256 of the files that the parent has read; the worker must find the same.
    pub files: BTreeMap<String, String>,
    pub job: Job,
    /// The processor to run on.
    pub cpu: Option<usize>,
    /// Seed of its memory layout, different for every process.
    pub layout: u64,
}

/// One process's share of a command's measurement.
#[derive(Clone, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Job {
    /// Structures on a scene, by its index in the plan (`run`, `compare`, `advise`).
    Scene {
        scene: usize,
        share: Share,
        /// True to receive samples in addition to the parts.
        samples: bool,
    },
    /// All timed tasks of a study.
    Times(Timing),
}

impl Job {
    pub fn scene(scene: usize, share: Share, samples: bool) -> Job {
        Job::Scene {
            scene,
            share,
            samples,
        }
    }
}

/// Parameters of a process of a study.
#[derive(Clone, Serialize, Deserialize)]
pub struct Timing {
    pub process: u32,
    /// Scale of the lens of a path with a given visible share.
    pub lens_scale: Option<f64>,
    /// The study's own plan.
    pub plan: Value,
}

impl Timing {
    /// The plan of a study.
    pub fn plan<P: DeserializeOwned>(&self) -> serde_json::Result<P> {
        P::deserialize(&self.plan)
    }
}

/// A line from a worker.
#[derive(Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Message {
    /// The first line.
    Ready {
        protocol: u32,
    },
    /// The next step, and its structure.
    Doing {
        structure: Option<String>,
        step: String,
    },
    Part(Box<Part>, Vec<TaskSamples>),
    Times(ProcessTimes),
    /// The scene or a path cannot be loaded.
    Failed(String),
    /// The share is complete.
    Done,
}

impl Message {
    /// The part in the message, if it has one.
    pub fn part(self) -> Option<Part> {
        match self {
            Message::Part(part, _) => Some(*part),
            _ => None,
        }
    }
}
