//! Pairs of fixtures and closed forms shared by the tests of physics.

use std::sync::Arc;

use fft_correlate::{Pair, ScoreModel};
use glam::DVec3;
use sdf_grid::shapes::PegInHole;
use sdf_grid::{DensityField, DensityKernel, DensityOptions, Lattice, Silent, TriangleMesh};

/// The pair at zero clearance on lattices that end four spacings outside each part, without halo:
/// enough near the fit, and quick.
pub(crate) fn fitted(shape: PegInHole, spacing: f64, model: &ScoreModel) -> Pair {
    let (hole, peg) = shape.pair(0.0).expect("a fixture");
    let field = |mesh: &TriangleMesh| {
        let lattice = Lattice::covering(&mesh.bounds(), 4.0 * spacing, spacing);
        let options = DensityOptions {
            tolerance: 1e-2,
            ..DensityOptions::default()
        };
        let kernel = DensityKernel::new(model.sigma).expect("sigma in range");
        let lattice = lattice.expect("a small lattice");
        Arc::new(DensityField::compute(mesh, &kernel, &lattice, &options, &Silent).expect("a field"))
    };
    Pair::new(field(&hole), field(&peg), *model, DVec3::ZERO).expect("matching fields")
}

/// Slope of the energy per metre of lateral offset at zero clearance, where `area` is
/// `∮ |n·t| dA` over the mating faces of one part: reward is lost at the squared magnitude of the
/// half-space density, penalty and separation are gained at the real part of its square.
pub(crate) fn kink_slope(model: &ScoreModel, area: f64) -> f64 {
    let kernel = DensityKernel::new(model.sigma).expect("sigma in range");
    let density = kernel.half_space();
    let (l1, l2, w) = (
        model.lambda_exterior,
        model.lambda_interior,
        model.separation_weight,
    );
    let reward = 2.0 * l1 * l2 * density.norm_sqr();
    let penalty = (l2 * l2 + w * l1 * l1) * (density.im.powi(2) - density.re.powi(2));
    model.gamma * 0.5 * area * (reward + penalty)
}
