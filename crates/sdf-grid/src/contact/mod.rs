//! What the overlap of two solids loses by smoothing, from their surfaces alone.
//!
//! With `-Δg = δ - (1 - s²/2 Δ) M` and `M` the Gaussian of variance `s²` per axis, the kernel is
//! `g(r) = erfc(r/(√2 s))/(4π r) - s²/2 M(r)` and its integral over a plane at distance `x`
//! `K(x) = s L(x/s) - s/2 φ(x/s) = s κ(x²/s²) - |x|/2`, `L(z) = φ(z) - |z| Φ(-|z|)`, with `κ` an
//! entire function; what edges take from it follows from `K` alone.
//!
//! - [`samples`]: pieces of a surface;
//! - [`sum`]: the sum over both.
//!
//! And [`mating`]: on how much area they lie against each other.

pub(crate) mod error;
pub(crate) mod mating;
#[cfg(test)]
mod reference;
pub(crate) mod samples;
pub(crate) mod sum;
