//! `pegfit play`: the loop on a page.

mod browser;
mod exhibits;
mod route;
mod run;
mod way;

pub(super) use run::run;
