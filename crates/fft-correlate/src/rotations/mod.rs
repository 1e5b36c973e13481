//! Which rotations a table, a docking run or a plot covers, and how queries find them.

pub(crate) mod atlas;
mod build;
pub(crate) mod chart;
pub(crate) mod domain;
pub(crate) mod grid;
pub(crate) mod search_rotations;
pub(crate) mod symmetry;
