//! What the overlap of two solids loses by smoothing, from their surfaces alone.
//!
//! - [`kernel`]: the short-range kernel, integrated over planes;
//! - [`edge`]: what edges take from it;
//! - [`surface`]: one part's flat regions, found by where one stands;
//! - [`samples`]: the other part's surface as points;
//! - [`sum`]: the sum over both.
//!
//! And [`mating`]: on how much area they lie against each other.

pub(crate) mod edge;
pub(crate) mod error;
pub(crate) mod kernel;
pub(crate) mod mating;
pub(crate) mod samples;
pub(crate) mod sum;
pub(crate) mod surface;

#[cfg(test)]
mod tests;
