//! Pairs and closed forms shared by the tests of physics.

use std::f64::consts::TAU;
use std::sync::Arc;

use fft_correlate::{Pair, ScoreModel};
use glam::DVec3;
use ndarray::Array3;
use num_complex::{Complex32, Complex64};
use sdf_grid::shapes::PegInHole;
use sdf_grid::{
    DensityField, DensityKernel, DensityOptions, FIELD_VERSION, FieldProvenance, Lattice, Sampling,
    Silent, TriangleMesh,
};

/// A fixture at zero clearance, on lattices that end four spacings outside each part, without
/// halo: enough near the fit, and quick.
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
        let field = DensityField::compute(mesh, &kernel, &lattice, &options, &Silent);
        Arc::new(field.expect("a field"))
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

/// Edge of the square of columns that [`tongue_and_groove`] samples of its moving part, cells.
pub(crate) const COLUMNS: usize = 4;

/// An infinite plate of `thickness` metres across z in a slot that it fills, `cells` cells across:
/// the density depends on z alone and is one integral, so it can be sampled finely without a mesh.
/// The lattices hold a few columns; the moving part's, [`COLUMNS`]² of them, ends inside the fixed
/// part's on all sides, so that only faces meet faces.
pub(crate) fn tongue_and_groove(thickness: f64, cells: usize, model: &ScoreModel) -> Pair {
    let kernel = DensityKernel::new(model.sigma).expect("sigma in range");
    let spacing = thickness / cells as f64;
    let field = |columns: usize, layers: usize, solid_inside: bool| {
        let extent = DVec3::new(columns as f64, columns as f64, layers as f64);
        let origin = -0.5 * spacing * (extent - 1.0);
        let shape = [columns, columns, layers];
        let lattice = Lattice::new(origin, spacing, shape).expect("a small lattice");
        let z = |k: usize| lattice.position([0, 0, k]).z;
        let density: Vec<_> = (0..layers)
            .map(|k| plate_density(&kernel, thickness, z(k)))
            .collect();
        let part = |solid: bool| {
            Array3::from_shape_fn(shape, |(_, _, k)| {
                let inside = (z(k).abs() < 0.5 * thickness) == solid_inside;
                let value = if solid { density[k] } else { density[k].conj() };
                let value = if inside == solid {
                    value
                } else {
                    Complex64::ZERO
                };
                Complex32::new(value.re as f32, value.im as f32)
            })
        };
        Arc::new(DensityField {
            exterior: part(false),
            interior: part(true),
            signed_distance: Array3::from_shape_fn(shape, |(_, _, k)| {
                let outside = z(k).abs() - 0.5 * thickness;
                (if solid_inside { outside } else { -outside }) as f32
            }),
            provenance: FieldProvenance {
                version: FIELD_VERSION,
                mesh: String::new(),
                sigma: model.sigma,
                halo: f64::INFINITY,
                tolerance: 1e-3,
                sampling: Sampling::Point,
                lattice,
            },
        })
    };
    Pair::new(
        field(COLUMNS + 2, 3 * cells, false),
        field(COLUMNS, 2 * cells, true),
        *model,
        DVec3::ZERO,
    )
    .expect("matching fields")
}

/// The unit integral `a + i b` at height z: between the faces both are seen, beyond them the near
/// one (the far one is out of sight for thicknesses met here).
fn plate_density(kernel: &DensityKernel, thickness: f64, z: f64) -> Complex64 {
    let (near, far) = ((0.5 * thickness - z.abs()).abs(), 0.5 * thickness + z.abs());
    let both = z.abs() < 0.5 * thickness;
    let far = if both {
        plane_integral(kernel, far / near)
    } else {
        Complex64::ZERO
    };
    plane_integral(kernel, 1.0) + far
}

/// `∫ unit(u) dOmega` over a plane at `start` times the smallest distance: `dOmega` is
/// `2 pi start du / u²` for u from `start`. Simpson's rule to where the kernel has vanished.
fn plane_integral(kernel: &DensityKernel, start: f64) -> Complex64 {
    const PANELS: usize = 400;
    let width = 8.0 * kernel.sigma() / PANELS as f64;
    let sum: Complex64 = (0..=PANELS)
        .map(|i| {
            let u = start + i as f64 * width;
            let weight = match i {
                0 | PANELS => 1.0,
                _ => f64::from(2 + 2 * (i as u32 % 2)),
            };
            kernel.unit(u) * (weight / (u * u))
        })
        .sum();
    sum * (TAU * start * width / 3.0)
}
