//! `pegfit disassemble`: in which order does an assembly come apart?

mod run;
mod summary;

pub(super) use run::run;
