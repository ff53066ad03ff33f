//! Camera level.
