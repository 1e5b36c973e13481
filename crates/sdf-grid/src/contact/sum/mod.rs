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

mod border;
mod buckets;
mod cells;
mod chain;
mod circle;
mod clearance;
mod clusters;
pub(crate) mod contact_sum;
mod cylinder;
mod gathered;
mod grid;
mod kink;
mod lanes;
mod lattices;
mod osculating;
mod pass;
mod regions;
mod sharp_edges;
mod sheet;
mod sight;
mod simplified;
mod slopes;
mod smooth;
mod smooth_parts;
mod soft;
mod spread;
#[cfg(test)]
mod tests;
mod unrolled;
mod vectors;
mod views;
