//! The whole search: checks, levels, what is made of what was found.

pub(crate) mod finish;
pub(crate) mod levels;
pub(crate) mod options;
pub(crate) mod plan;
