//! Notes on ignored or guessed input, shown once each by the program.

use std::collections::BTreeSet;
use std::sync::{Mutex, PoisonError};

type Told = (fn(&str), BTreeSet<String>);

static LISTENER: Mutex<Option<Told>> = Mutex::new(None);

/// From now on `tell` gets each different note once. Without it notes are dropped.
pub fn tell_notes(tell: fn(&str)) {
    let mut listener = LISTENER.lock().unwrap_or_else(PoisonError::into_inner);
    *listener = Some((tell, BTreeSet::new()));
}

/// One line about an input that is no error.
pub(crate) fn note(text: &str) {
    let mut listener = LISTENER.lock().unwrap_or_else(PoisonError::into_inner);
    if let Some((tell, told)) = listener.as_mut()
        && told.insert(text.to_owned())
    {
        tell(text);
    }
}
