//! Ctrl-C, and the signals of `kill` and of a closed terminal.
//!
//! Until a command has results to keep, each ends the program at once. After `from_now_on_finish`
//! the first one stops the work at the next safe point, and the second one ends the program.

use std::sync::atomic::{AtomicBool, Ordering};

static ASKED: AtomicBool = AtomicBool::new(false);
static HEARD: AtomicBool = AtomicBool::new(false);
static TO_FINISH: AtomicBool = AtomicBool::new(false);

/// Makes the work check [`asked`] from now on, to leave nothing half done.
pub fn from_now_on_finish() {
    TO_FINISH.store(true, Ordering::Relaxed);
}

/// Ends a command without results to keep.
#[derive(Debug, thiserror::Error)]
#[error("interrupted: nothing was saved; anything printed is incomplete")]
pub struct Interrupted;

/// Returns true after a request to stop.
///
/// For points before work that is then skipped, which [`heard`] reports.
pub fn asked() -> bool {
    let is_asked = ASKED.load(Ordering::Relaxed);
    HEARD.fetch_or(is_asked, Ordering::Relaxed);
    is_asked
}

/// Returns true if work was skipped.
pub fn heard() -> bool {
    HEARD.load(Ordering::Relaxed)
}

/// Fails after a request to stop.
///
/// # Errors
/// [`Interrupted`].
pub fn check() -> Result<(), Interrupted> {
    (!asked()).then_some(()).ok_or(Interrupted)
}

pub fn install() {
    let handler = || {
        let again = ASKED.swap(true, Ordering::Relaxed);
        if again || !TO_FINISH.load(Ordering::Relaxed) {
            if !again {
                tell!("{Interrupted}");
            }
            std::process::exit(130);
        }
        tell!("stopping at the next safe place; again ends at once");
    };
    if ignores_hangup() {
        return;
    }
    // Without a handler Ctrl-C simply ends the program: only the cell being measured is lost.
    if let Err(error) = ctrlc::set_handler(handler) {
        tell!("warning: no clean stop on Ctrl-C: {error}");
    }
}

/// Returns true if `nohup` started the program.
///
/// The handler takes all three signals or none, and a run under `nohup` must outlive its terminal.
fn ignores_hangup() -> bool {
    let status = std::fs::read_to_string("/proc/self/status").unwrap_or_default();
    let ignored = status.lines().find_map(|line| line.strip_prefix("SigIgn:"));
    let ignored = ignored.and_then(|mask| u64::from_str_radix(mask.trim(), 16).ok());
    ignored.is_some_and(|mask| mask & 1 != 0)
}
