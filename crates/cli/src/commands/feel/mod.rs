//! `pegfit feel`: the haptic loop.

mod run;

pub(super) use run::run;
