//! A chase camera on a spring arm: methods that step it against what it should do,
//! as a study of work against precision. The arms and what they chase are in
//! `problem` and one file each, the methods in `methods` and `adaptive`, the
//! references in `exponential` and `extrapolation`; points, times and what follows
//! from them in `study`, `timing` and `choice`.

mod adaptive;
mod choice;
mod course;
mod exponential;
mod extrapolation;
mod limited;
pub(super) mod linear;
pub(super) mod methods;
pub(super) mod problem;
mod study;
mod timing;
mod turning;

pub use choice::{ArmChoice, conclude, conclusion};
pub use course::FrameTimes;
pub use methods::{Information, METHODS, Method};
pub use study::{ARMS, ArmKind, ArmOptions, ArmPoint, InformationError, Setting};
pub(super) use study::{errors, keys, settings};
pub(super) use timing::task;
