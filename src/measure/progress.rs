//! Notices of a process about its current step, for progress and time limits.

/// The step that is noticed at every turn of a timed pass.
pub const TIMING: &str = "timing";

/// Gets each next step of a process: the structure (none for the harness's own
/// work) and the step.
pub type Notice<'n> = &'n dyn Fn(Option<&str>, &str);
