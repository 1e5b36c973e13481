//! Two parts and the model between them: from meshes to what every scorer works on.

pub(crate) mod builder;
pub(crate) mod contact;
pub(crate) mod fields;
pub(crate) mod interpolation;
pub(crate) mod model;
pub(crate) mod reach;
pub(crate) mod region;
pub(crate) mod setup;

pub use builder::{PairPlan, default_halo, default_spacing};
pub use contact::Contact;
