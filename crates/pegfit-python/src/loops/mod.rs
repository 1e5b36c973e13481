//! The haptic loop: one tick of it, and a run with the simulated hand.

pub(crate) mod feel;
pub(crate) mod force_path;
mod settings;
