//! `pegfit path`: how does the part get to where it fits?

mod charts;
mod page;
pub(super) mod question;
pub(super) mod rows;
mod run;
pub(super) mod summary;

pub(super) use run::run;
