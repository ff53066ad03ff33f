//! Callback that gets the current step of a process, for progress and time limits.

/// Step that is reported at every turn of a timed pass.
pub const TIMING: &str = "timing";

/// Callback that gets each step of a process.
///
/// Its arguments are the structure, `None` for steps without one, and the step.
pub type Notice<'n> = &'n dyn Fn(Option<&str>, &str);
