//! Collision checks between two bodies, and the projection of a pose to contact.

pub(crate) mod body;
pub(crate) mod checker;
pub(crate) mod contact_points;
