//! What answers with energy, force and torque at poses.

pub(crate) mod any;
mod query;
pub(crate) mod source_class;
