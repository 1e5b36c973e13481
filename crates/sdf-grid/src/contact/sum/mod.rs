//! The sum over both surfaces, in single precision for sixteen samples at a time.
//!
//! - [`lanes`], [`smooth`]: elementary functions and the kernel for sixteen samples;
//! - [`clusters`]: samples in a tree of balls; [`clearance`]: which of them are out of reach;
//! - [`views`]: the flat regions that a cluster sees; [`border`], [`pass`]: what they give;
//! - [`contact_sum`]: all that together.

mod border;
mod clearance;
mod clusters;
pub(crate) mod contact_sum;
mod lanes;
mod pass;
mod smooth;
mod views;
