//! What a process says it is doing, for progress and for those who wait.

/// The step that is told at every turn of a timed pass.
pub const TIMING: &str = "timing";

/// Who is told what the process is about to do: the structure (none for the
/// harness's own work) and the step.
pub type Notice<'n> = &'n dyn Fn(Option<&str>, &str);
