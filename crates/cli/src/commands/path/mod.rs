//! `pegfit path`: how does the part get to where it fits?

pub(super) mod question;
mod run;

pub(super) use run::run;
