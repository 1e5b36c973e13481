//! Which rotations a table, a docking run or a plot covers, and how queries find them.

pub(crate) mod atlas;
mod build;
pub(crate) mod chart;
pub(crate) mod domain;
mod fold;
pub(crate) mod grid;
mod near;
mod node_sum;
pub(crate) mod rest;
pub(crate) mod symmetry;
