//! In which order an assembly comes apart.

mod groups;
pub(crate) mod options;
pub(crate) mod search;
pub(crate) mod tries;
