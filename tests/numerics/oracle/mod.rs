//! Checks of the oracle against independent computations.
//!
//! Expected verdicts come from the verified vectors and from a linear program solved in
//! integers (`simplex`), which uses no certificates. The planes of a camera come from
//! 640-bit floating-point arithmetic (`wide`) by independent formulas.
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
