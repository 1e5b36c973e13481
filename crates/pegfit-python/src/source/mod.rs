//! What answers with energy, force and torque at poses.

pub(crate) mod any;
pub(crate) mod bake;
mod claim;
pub(crate) mod query;
pub(crate) mod source_class;
pub(crate) mod table;
