//! Where docking, tables and the haptic loop begin: two parts, and what is asked of their pair.

pub(crate) mod energy_scale;
pub(crate) mod in_scene;
pub(crate) mod pair_setup;
