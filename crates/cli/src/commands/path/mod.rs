//! `pegfit path`: how does the part get to where it fits?

mod charts;
mod page;
mod question;
mod rows;
mod run;
mod summary;

pub(super) use run::run;
