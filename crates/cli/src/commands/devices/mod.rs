//! `pegfit devices`: what is attached, what it can do, and which one `--device` means.

mod choose;
mod probe;
mod run;

pub(super) use choose::{Chosen, choose};
pub(super) use run::run;
