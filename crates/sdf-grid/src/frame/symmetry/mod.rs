//! Rotational symmetry axes of a part.
//!
//! Every axis passes through the centroid. Candidates come from two sources, each of which covers
//! what the other misses: the principal axes of inertia (all axes of a body with unequal moments,
//! the main axis of one that is tessellated unevenly), and the rotations that carry one pair of
//! far-out vertices to another (all axes of a body with equal moments, such as a cube). A candidate
//! counts if it carries sample points of the surface to within a tolerance of the surface.

pub(crate) mod axis;
mod candidates;
mod detect;
mod samples;

pub use detect::detect;
