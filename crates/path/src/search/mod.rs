//! The search for exit paths: poses expanded from the goal by compliant motion until the part is outside.

pub(crate) mod compliant_step;
pub(crate) mod directions;
pub(crate) mod exit;
pub(crate) mod expand;
pub(crate) mod inscribed_sphere;
pub(crate) mod single_motion;
pub(crate) mod space;
pub(crate) mod visited;
