//! Ctrl-C: the first one asks the work to stop at the next safe place, the
//! second one ends the program at once.

use std::sync::atomic::{AtomicBool, Ordering};

static ASKED: AtomicBool = AtomicBool::new(false);

/// Whether somebody has asked to stop.
pub fn asked() -> bool {
    ASKED.load(Ordering::Relaxed)
}

pub fn install() {
    let handler = || {
        if ASKED.swap(true, Ordering::Relaxed) {
            std::process::exit(130);
        }
    };
    // Without a handler Ctrl-C simply ends the program: nothing is lost but
    // the cell that was being measured.
    if let Err(error) = ctrlc::set_handler(handler) {
        super::tell(&format!("warning: no clean stop on Ctrl-C: {error}"));
    }
}
