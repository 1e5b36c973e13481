//! From the fit into the open: poses that touch nothing, grown by sliding along what they touch.

pub(crate) mod cage;
pub(crate) mod directions;
pub(crate) mod escape;
pub(crate) mod explored;
pub(crate) mod grow;
pub(crate) mod node;
pub(crate) mod same;
pub(crate) mod single;
pub(crate) mod slide;
