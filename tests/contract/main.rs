//! The contract of structures, and of the code that queries, times and checks them.
//!
//! Every structure, instruction set and number of threads returns the same pinned sets.
//! Structures and code paths that are broken on purpose check that the suites fail.

mod conformance;
mod kernels;
mod motions;
#[cfg(feature = "cli")]
mod picking;
mod portable;
mod ranges;
mod road_sabotage;
mod sabotage;
mod sinks;
mod stability;
#[cfg(feature = "cli")]
mod stress_sabotage;
mod threads;
