//! Tables: baked and opened.

pub(crate) mod bake;
mod claim;
pub(crate) mod open;
