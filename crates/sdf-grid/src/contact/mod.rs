//! Short-range (contact) correction: restores what smoothing removes from the overlap integral of
//! two solids, as a double integral over their surfaces.
//!
//! With `-Δg = δ - (1 - s²/2 Δ) M` and `M` the Gaussian of variance `s²` per axis, the kernel is
//! `g(r) = erfc(r/(√2 s))/(4π r) - s²/2 M(r)` and its integral over a plane at distance `x`
//! `K(x) = s L(x/s) - s/2 φ(x/s) = s κ(x²/s²) - |x|/2`, `L(z) = φ(z) - |z| Φ(-|z|)`, with `κ` an
//! entire function. Integrals over polygons follow from `K` by integrals along their edges.
//!
//! - [`samples`]: cuts a surface into small pieces;
//! - [`sum`]: the sum over both surfaces.

pub(crate) mod error;
#[cfg(test)]
mod reference;
pub(crate) mod samples;
pub(crate) mod sum;
