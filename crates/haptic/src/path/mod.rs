//! One tick of the force path, part by part: from the handle's pose to the wrench on it.

pub(crate) mod body_force;
pub(crate) mod bundle;
pub(crate) mod coupling;
pub(crate) mod force_path;
pub(crate) mod gate;
pub(crate) mod joint_guide;
pub(crate) mod limiter;
pub(crate) mod metric;
pub(crate) mod passivity;
pub(crate) mod sample;
pub use coupling::{Coupling, CouplingStep, Gains, SpringLimits};
pub use gate::{Gate, GateDecision};
pub use limiter::LimitedWrench;
pub use passivity::Passivity;
