//! The parent's side of a run: starting a worker, reading what it says, and
//! telling what has ended it: memory, time, a signal, or the user.

use std::io::{BufRead, BufReader, Read, Write};
use std::path::Path;
use std::process::{Child, ChildStdin, Command, ExitStatus, Stdio};
use std::sync::mpsc::{Receiver, RecvTimeoutError, channel};
use std::thread::{self, JoinHandle};
use std::time::{Duration, Instant};

use anyhow::{Context, bail};

use super::worker::{Message, PROTOCOL, Request};
use crate::measure::{Part, Status, TaskSamples, Verdict};

/// Longest wait before looking whether the user wants to stop.
const GLANCE: Duration = Duration::from_millis(20);
/// Bytes of a worker's last words that are kept.
const LAST_WORDS: usize = 4096;

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
    /// It does something else now.
    Step(String),
    Done,
    /// It could not do what it was asked to.
    Failed(String),
    /// It is gone; the structure it was at, and what became of it.
    Died(Option<String>, Verdict),
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
        let (send, lines) = channel();
        if let Some(out) = child.stdout.take() {
            thread::spawn(move || {
                for line in BufReader::new(out).split(b'\n') {
                    if send.send(line).is_err() {
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
            Err(RecvTimeoutError::Disconnected) => return Ok(self.obituary()?),
        };
        self.since = Instant::now();
        let message = serde_json::from_slice(&line).map_err(|_| {
            let text: String = String::from_utf8_lossy(&line).chars().take(60).collect();
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
            Message::Failed(reason) => Said::Failed(reason),
            Message::Done => Said::Done,
        })
    }

    /// Since when nothing has been heard.
    pub fn silent_for(&self) -> Duration {
        self.since.elapsed()
    }

    /// Ends it; what it was at is what took too long.
    pub fn give_up(mut self, patience: Duration) -> Said {
        let (structure, step) = self.doing.clone();
        self.kill();
        let reason = format!("{step} took longer than {} s", patience.as_secs());
        Said::Died(structure, Verdict::new(Status::TimedOut, reason))
    }

    /// Ends it at once.
    pub fn kill(&mut self) {
        let _ = self.child.kill();
        let _ = self.child.wait();
    }

    #[cfg(unix)]
    pub fn signal(&self, signal: rustix::process::Signal) {
        if let Some(pid) = rustix::process::Pid::from_raw(self.child.id().cast_signed()) {
            let _ = rustix::process::kill_process(pid, signal);
        }
    }

    fn obituary(&mut self) -> std::io::Result<Said> {
        let status = self.child.wait()?;
        let words = self.last_words.take().and_then(|words| words.join().ok());
        let words = String::from_utf8_lossy(&words.unwrap_or_default()).into_owned();
        let (structure, step) = self.doing.clone();
        Ok(Said::Died(structure, cause(status, &step, &words)))
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

/// How a share of the work ended.
pub enum Ended {
    Done,
    /// The user wants to stop.
    Stopped,
    Failed(String),
    Died(Option<String>, Verdict),
}

/// Starts a worker and sees it through.
///
/// # Errors
/// The program cannot be started or is of another version; what `keep` says.
pub fn see_through(
    program: &Path,
    request: &Request,
    patience: Duration,
    keep: &mut dyn FnMut(Part, Vec<TaskSamples>) -> anyhow::Result<()>,
    step: &dyn Fn(&str),
    stop: &dyn Fn() -> bool,
) -> anyhow::Result<Ended> {
    let mut worker = Worker::start(program, request)?;
    loop {
        if stop() {
            return Ok(Ended::Stopped);
        }
        match worker.listen(GLANCE)? {
            Said::Part(part, samples) => keep(*part, samples)?,
            Said::Step(text) => step(&text),
            Said::Done => return Ok(Ended::Done),
            Said::Failed(reason) => return Ok(Ended::Failed(reason)),
            Said::Died(structure, verdict) => return Ok(Ended::Died(structure, verdict)),
            Said::Nothing if worker.silent_for() > patience => {
                return Ok(match worker.give_up(patience) {
                    Said::Died(structure, verdict) => Ended::Died(structure, verdict),
                    _ => Ended::Stopped,
                });
            }
            Said::Nothing => {}
        }
    }
}
