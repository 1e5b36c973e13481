//! `pegfit feel`: the haptic loop.

mod charts;
mod page;
mod run;
mod subject;
mod words;

pub(super) use run::run;
