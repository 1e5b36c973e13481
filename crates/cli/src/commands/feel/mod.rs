//! `pegfit feel`: the haptic loop.

mod again;
mod run;

pub(super) use run::run;
