//! `pegfit demo`: the paper's three examples from meshes to felt forces, and a page about them.

mod errors;
mod example;
mod page;
mod run;

pub(super) use run::run;
