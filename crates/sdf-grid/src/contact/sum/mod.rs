//! The sum over both surfaces, in single precision for sixteen samples at a time.
//!
//! - [`lanes`], [`vectors`], [`smooth`]: elementary functions and the kernel for sixteen samples;
//! - [`smooth_parts`], [`sharp_edges`]: a surface between its sharp edges, and these; [`spread`],
//!   [`gathered`], [`lattices`], [`cells`]: samples of the one surface; [`clusters`]: those in a tree
//!   of balls; [`clearance`]: which of them are out of reach;
//! - [`regions`]: flat and curved regions of the other surface; [`osculating`], [`cylinder`]: the
//!   latter as tori, [`simplified`]: where they are bent too much, in few faces; [`chain`]: borders
//!   in fewer pieces; [`grid`], [`buckets`], [`sheet`], [`views`]: what of all that a cluster sees;
//! - [`border`], [`sight`], [`soft`], [`kink`], [`circle`], [`unrolled`], [`pass`]: what it gives;
//! - [`contact_sum`]: all that together.

mod boundary_edges;
pub(crate) mod contact_sum;
mod curved;
mod decimation;
mod kernel;
mod lookup;
mod patch_integral;
mod patches;
mod polylines;
mod regions;
mod sampling;
#[cfg(test)]
mod tests;
