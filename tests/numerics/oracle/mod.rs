//! The oracle put to the proof. Expected verdicts come from the verified
//! vectors and from a linear program solved in whole numbers (`simplex`), which
//! knows nothing of certificates; the camera's planes come from a
//! floating-point arithmetic of 640 bits (`wide`) by formulas of its own.
//!
//! `CULLBENCH_ORACLE_CASES` is the number of cases of each kind; what is run by
//! default takes seconds (docs/NUMERICS.md has the figures of long runs).

mod camera;
mod camera_ties;
mod depth;
mod draw;
mod matrices;
mod planes;
mod simplex;
mod vectors;
mod wide;

/// How many cases of a kind to run: `by_default`, or as the environment says.
fn cases(by_default: usize) -> usize {
    match std::env::var("CULLBENCH_ORACLE_CASES") {
        Ok(text) => text.parse().expect("CULLBENCH_ORACLE_CASES is a number"),
        Err(_) => by_default,
    }
}
