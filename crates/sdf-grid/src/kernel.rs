//! The kernel of the density and its unit integrals.

/// The density kernel of thickness `sigma` (the paper's eq_2, written as the bounded `H(u)` of
/// `docs/conventions.md`).
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct DensityKernel {
    sigma: f64,
}
