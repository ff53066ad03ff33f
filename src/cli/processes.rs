//! The parent's side of what is measured over processes: starting a worker, reading
//! what it says, and telling what has ended it: memory, time, a signal, or the user.

use std::collections::BTreeMap;
use std::io::{self, BufRead, BufReader, Read, Write};
use std::path::{Path, PathBuf};
use std::process::{Child, ChildStdin, Command, ExitStatus, Stdio};
use std::sync::mpsc::{Receiver, RecvTimeoutError, sync_channel};
use std::thread::{self, JoinHandle};
use std::time::{Duration, Instant};

use anyhow::{Context, bail};
use tempfile::NamedTempFile;

use super::interrupt::{self, Interrupted};
use super::protocol::{Job, Message, PROTOCOL, Request};
use super::run_resume::typed_args;
use crate::input;
use crate::measure::{Part, ProcessTimes, Status, TaskSamples, Verdict};
use crate::report::{bare, temporary_in};
use crate::shown::shortened;

/// Longest wait before looking whether the user wants to stop.
const GLANCE: Duration = Duration::from_millis(20);
/// Bytes of a worker's last words that are kept.
const LAST_WORDS: usize = 4096;

/// Longest first line of a worker, bytes: another program may never end its first.
const LONGEST_FIRST: u64 = 1 << 16;
/// Longest line, bytes: the samples of a million cameras fit.
const LONGEST: u64 = 1 << 29;
/// Lines that wait to be read before the worker does.
const WAITING: usize = 16;

/// How a share of the work ended.
pub enum Ended {
    Done,
    /// It could not do what it was asked to.
    Failed(String),
    /// It is gone; the structure it was at, and what became of it.
    Died(Option<String>, Verdict),
}

/// A worker at work.
pub struct Worker {
    child: Child,
    /// Kept open: its end tells the worker that its parent is gone.
    _stdin: Option<ChildStdin>,
    lines: Receiver<std::io::Result<Vec<u8>>>,
    last_words: Option<JoinHandle<Vec<u8>>>,
    doing: (Option<String>, String),
    since: Instant,
}

/// What a worker has said.
pub enum Said {
    Part(Box<Part>, Vec<TaskSamples>),
    Times(ProcessTimes),
    /// It does something else now.
    Step(String),
    /// Its last word, or what is known of its end without one.
    Ended(Ended),
    /// Nothing within the time it was given.
    Nothing,
}

impl Worker {
    /// # Errors
    /// The program cannot be started.
    pub fn start(program: &Path, request: &Request) -> anyhow::Result<Worker> {
        let mut child = Command::new(program)
            .arg("worker")
            .stdin(Stdio::piped())
            .stdout(Stdio::piped())
            .stderr(Stdio::piped())
            .spawn()
            .with_context(|| program.display().to_string())?;
        let (send, lines) = sync_channel(WAITING);
        if let Some(out) = child.stdout.take() {
            thread::spawn(move || {
                let mut out = BufReader::new(out);
                let mut most = LONGEST_FIRST;
                loop {
                    let mut line = Vec::new();
                    // A line that is cut short is no message.
                    let read = (&mut out).take(most).read_until(b'\n', &mut line);
                    most = LONGEST;
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
        if let Some(stdin) = &mut stdin {
            let mut line = serde_json::to_vec(request)?;
            line.push(b'\n');
            // A program that does not read it says so in another way.
            let _ = stdin.write_all(&line);
        }
        Ok(Worker {
            child,
            _stdin: stdin,
            lines,
            last_words,
            doing: (None, "starting".to_owned()),
            since: Instant::now(),
        })
    }

    /// What it says next, if it says it within `wait`.
    ///
    /// # Errors
    /// Something that no worker of this version says.
    pub fn listen(&mut self, wait: Duration) -> anyhow::Result<Said> {
        let line = match self.lines.recv_timeout(wait) {
            Ok(line) => line?,
            Err(RecvTimeoutError::Timeout) => return Ok(Said::Nothing),
            Err(RecvTimeoutError::Disconnected) => return Ok(Said::Ended(self.obituary()?)),
        };
        self.since = Instant::now();
        let told = str::from_utf8(&line).ok();
        let message = told.and_then(|line| serde_json::from_str(line).ok());
        let message = message.ok_or_else(|| {
            let text = String::from_utf8_lossy(&line[..line.len().min(300)]);
            let text = shortened(text.trim_end(), 60);
            anyhow::anyhow!(
                "a worker said '{text}'; expected a message of protocol {PROTOCOL}: the program is \
                 of another version"
            )
        })?;
        Ok(match message {
            Message::Ready { protocol: PROTOCOL } => Said::Step("started".to_owned()),
            Message::Ready { protocol } => bail!(
                "the program speaks protocol {protocol}; expected {PROTOCOL}: it is of another \
                 version"
            ),
            Message::Doing { structure, step } => {
                let said = match &structure {
                    Some(structure) => format!("{step} {structure}"),
                    None => step.clone(),
                };
                self.doing = (structure, step);
                Said::Step(said)
            }
            Message::Part(part, samples) => Said::Part(part, samples),
            Message::Times(times) => Said::Times(times),
            Message::Failed(reason) => Said::Ended(Ended::Failed(reason)),
            Message::Done => Said::Ended(Ended::Done),
        })
    }

    /// Since when nothing has been heard.
    pub fn silent_for(&self) -> Duration {
        self.since.elapsed()
    }

    /// Ends it; what it was at is what took too long.
    fn give_up(mut self, patience: Duration) -> Ended {
        let (structure, step) = self.doing.clone();
        self.kill();
        let reason = format!("{step} took longer than {} s", patience.as_secs());
        Ended::Died(structure, Verdict::new(Status::TimedOut, reason))
    }

    /// Ends it at once.
    pub fn kill(&mut self) {
        let _ = self.child.kill();
        let _ = self.child.wait();
    }

    /// It stands still until [`Worker::go`]; where no signal does that, it runs on.
    pub fn hold(&self) {
        #[cfg(unix)]
        self.signal(rustix::process::Signal::STOP);
    }

    pub fn go(&self) {
        #[cfg(unix)]
        self.signal(rustix::process::Signal::CONT);
    }

    #[cfg(unix)]
    fn signal(&self, signal: rustix::process::Signal) {
        if let Some(pid) = rustix::process::Pid::from_raw(self.child.id().cast_signed()) {
            let _ = rustix::process::kill_process(pid, signal);
        }
    }

    fn obituary(&mut self) -> std::io::Result<Ended> {
        let status = self.child.wait()?;
        let words = self.last_words.take().and_then(|words| words.join().ok());
        let words = String::from_utf8_lossy(&words.unwrap_or_default()).into_owned();
        let (structure, step) = self.doing.clone();
        Ok(Ended::Died(structure, cause(status, &step, &words)))
    }
}

impl Drop for Worker {
    fn drop(&mut self) {
        self.kill();
    }
}

/// What the end of a process means.
fn cause(status: ExitStatus, step: &str, words: &str) -> Verdict {
    // What the allocator of std says before it aborts.
    if let Some(at) = words.find("memory allocation of") {
        let said = words[at..].lines().next().unwrap_or_default();
        return Verdict::new(Status::OutOfMemory, format!("while {step}: {said}"));
    }
    #[cfg(unix)]
    {
        use std::os::unix::process::ExitStatusExt;
        const SIGKILL: i32 = 9;
        match status.signal() {
            Some(SIGKILL) => {
                let reason =
                    format!("killed while {step}: the system was out of memory, most likely");
                return Verdict::new(Status::OutOfMemory, reason);
            }
            Some(signal) => {
                let reason = format!("ended by signal {signal} while {step}");
                return Verdict::new(Status::Panicked, reason);
            }
            None => {}
        }
    }
    let last = words.lines().rev().find(|line| !line.trim().is_empty());
    let reason = match last {
        Some(last) => format!("ended while {step} ({status}): {last}"),
        None => format!("ended while {step} ({status})"),
    };
    Verdict::new(Status::Panicked, reason)
}

/// Starts a worker and sees it through.
///
/// # Errors
/// The program cannot be started or is of another version; what `keep` says;
/// [`Interrupted`].
pub fn see_through(
    program: &Path,
    request: &Request,
    patience: Duration,
    keep: &mut dyn FnMut(Said) -> anyhow::Result<()>,
    step: &dyn Fn(&str),
) -> anyhow::Result<Ended> {
    let mut worker = Worker::start(program, request)?;
    loop {
        if interrupt::asked() {
            return Err(Interrupted.into());
        }
        match worker.listen(GLANCE)? {
            found @ (Said::Part(..) | Said::Times(_)) => keep(found)?,
            Said::Step(text) => step(&text),
            Said::Ended(ended) => return Ok(ended),
            Said::Nothing if worker.silent_for() > patience => {
                return Ok(worker.give_up(patience));
            }
            Said::Nothing => {}
        }
    }
}

/// This program, with what all its workers are given.
pub struct Workers {
    program: PathBuf,
    args: Vec<String>,
    patience: Duration,
    cpus: Vec<usize>,
    /// Bytes of pipes, for workers to read.
    spooled: BTreeMap<String, PathBuf>,
    _spool: Vec<NamedTempFile>,
}

impl Workers {
    /// For a study, which waits as long as it takes.
    ///
    /// # Errors
    /// As [`Workers::new`]; an argument that is no text.
    pub fn of_study() -> anyhow::Result<Workers> {
        let temporary = || temporary_in(&std::env::temp_dir());
        Workers::new(typed_args()?, Duration::MAX, &temporary)
    }

    /// `temporary` makes the files that stand for pipes.
    ///
    /// # Errors
    /// Such a file cannot be written.
    pub fn new(
        args: Vec<String>,
        patience: Duration,
        temporary: &dyn Fn() -> io::Result<NamedTempFile>,
    ) -> anyhow::Result<Workers> {
        let (mut spool, mut spooled) = (Vec::new(), BTreeMap::new());
        for (source, bytes) in input::pipes() {
            let kept = temporary().and_then(|mut file| {
                file.write_all(&bytes)?;
                Ok(file)
            });
            let place = || format!("{source}: cannot be kept for the processes to read");
            let file = kept.map_err(bare).with_context(place)?;
            spooled.insert(source, std::path::absolute(file.path())?);
            spool.push(file);
        }
        Ok(Workers {
            program: std::env::current_exe().context("this program cannot be found again")?,
            args,
            patience,
            cpus: processors(),
            spooled,
            _spool: spool,
        })
    }

    /// Sees a job through in a process of its own, on the next processor.
    ///
    /// # Errors
    /// As [`see_through`].
    pub fn see_through(
        &self,
        process: u32,
        job: Job,
        keep: &mut dyn FnMut(Said) -> anyhow::Result<()>,
        step: &dyn Fn(&str),
    ) -> anyhow::Result<Ended> {
        let request = Request {
            protocol: PROTOCOL,
            args: self.args.clone(),
            spooled: self.spooled.clone(),
            cpu: match self.cpus.len() {
                0 => None,
                count => Some(self.cpus[process as usize % count]),
            },
            layout: u64::from(process),
            files: input::held_files(),
            job,
        };
        see_through(&self.program, &request, self.patience, keep, step)
    }

    /// What a job finds that cannot do without any process.
    ///
    /// # Errors
    /// As [`see_through`]; a process that does not finish.
    pub fn found(&self, process: u32, job: Job, step: &dyn Fn(&str)) -> anyhow::Result<Vec<Said>> {
        let mut found = Vec::new();
        let mut keep = |said| {
            found.push(said);
            Ok(())
        };
        match self.see_through(process, job, &mut keep, step)? {
            Ended::Done => Ok(found),
            Ended::Failed(reason) => bail!("{reason}"),
            Ended::Died(structure, verdict) => bail!(
                "process {}: {}{}; expected one that finishes",
                process + 1,
                structure
                    .map(|structure| format!("{structure}: "))
                    .unwrap_or_default(),
                verdict.reason.unwrap_or_default()
            ),
        }
    }
}

/// The processors that this process may run on; empty where that is not known.
pub fn processors() -> Vec<usize> {
    #[cfg(target_os = "linux")]
    if let Ok(set) = rustix::thread::sched_getaffinity(None) {
        return (0..rustix::thread::CpuSet::MAX_CPU)
            .filter(|&cpu| set.is_set(cpu))
            .collect();
    }
    Vec::new()
}
