//! Paths that are known, in frames of all kinds.

mod common;
mod known;
mod order;
mod refused;
mod resume;
