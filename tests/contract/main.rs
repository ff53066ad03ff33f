//! The contract of a structure, and of what asks, times and judges it: the same sets by
//! every structure, instruction set and number of threads, pinned; and the same suites
//! put to the proof, by structures and roads that are broken on purpose.

mod conformance;
mod kernels;
#[cfg(feature = "cli")]
mod picking;
mod portable;
mod ranges;
mod road_sabotage;
mod sabotage;
mod stability;
#[cfg(feature = "cli")]
mod stress_sabotage;
mod threads;
