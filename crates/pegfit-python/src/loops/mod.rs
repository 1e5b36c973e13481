//! The haptic loop: one tick of it, a run with the simulated hand, and the force on a body.

pub(crate) mod body_force;
pub(crate) mod feel;
pub(crate) mod force_path;
mod settings;
