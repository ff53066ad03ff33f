//! Notes and warnings about input, shown once each by the program.

use std::collections::BTreeSet;
use std::mem;
use std::sync::{Mutex, PoisonError};

use crate::shown::counted;

/// Receiver of the lines, all lines so far, and warnings that were not told yet.
type Told = (fn(&str), BTreeSet<String>, Vec<String>);

static LISTENER: Mutex<Option<Told>> = Mutex::new(None);

/// From now on `tell` gets each different line once. Without it lines are dropped.
pub fn tell_notes(tell: fn(&str)) {
    listening(|listener| *listener = Some((tell, BTreeSet::new(), Vec::new())));
}

/// One line about an input that is no error.
pub fn note(text: &str) {
    once(format!("note: {text}"), |(tell, ..), line| tell(&line));
}

/// A line for each count above zero of what it counts and what was done with it.
pub fn note_counted<const N: usize>(file: &str, rows: [(usize, &str, &str); N]) {
    for (count, one, what) in rows.into_iter().filter(|row| row.0 > 0) {
        note(&format!("{file}: {} {what}", counted(count, one)));
    }
}

/// Holds one line about a doubtful input for [`tell_warnings`].
pub fn warn(text: &str) {
    once(format!("warning: {text}"), |(.., held), line| {
        held.push(line)
    });
}

/// Tells all warnings so far.
///
/// Called where inputs are known to be sound, so that an error stands alone.
pub fn tell_warnings() {
    listening(|listener| {
        if let Some((tell, _, held)) = listener {
            mem::take(held).iter().for_each(|warning| tell(warning));
        }
    });
}

/// All warnings so far, told or not.
pub fn warnings() -> Vec<String> {
    listening(|listener| {
        let told = listener.iter().flat_map(|(_, lines, _)| lines);
        let told = told.filter_map(|line| line.strip_prefix("warning: "));
        told.map(str::to_owned).collect()
    })
}

/// Does something without its notes and warnings.
pub fn unheard<T>(work: impl FnOnce() -> T) -> T {
    let kept = listening(Option::take);
    let done = work();
    listening(|listener| *listener = kept);
    done
}

/// Does something with a line that is new to the listener.
fn once(line: String, act: impl FnOnce(&mut Told, String)) {
    listening(|listener| {
        if let Some(told) = listener
            && told.1.insert(line.clone())
        {
            act(told, line);
        }
    });
}

fn listening<T>(act: impl FnOnce(&mut Option<Told>) -> T) -> T {
    act(&mut LISTENER.lock().unwrap_or_else(PoisonError::into_inner))
}
