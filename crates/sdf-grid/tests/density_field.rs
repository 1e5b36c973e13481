//! Fields on lattices: against the reference, invariances, boundary, halo, sampling.

mod common;

use common::{cuboid, random_star, relative_l2};
use glam::DVec3;
use num_complex::{Complex32, Complex64};
use sdf_grid::{
    DensityField, DensityKernel, DensityOptions, Lattice, ReferenceDensity, Sampling, Silent,
    TriangleMesh,
};

fn options(tolerance: f64, sampling: Sampling) -> DensityOptions {
    DensityOptions {
        tolerance,
        sampling,
        halo: f64::INFINITY,
    }
}

fn field(m: &TriangleMesh, sigma: f64, lattice: &Lattice, o: &DensityOptions) -> DensityField {
    let kernel = DensityKernel::new(sigma).unwrap();
    DensityField::compute(m, &kernel, lattice, o, &Silent).unwrap()
}

fn double(z: Complex32) -> Complex64 {
    Complex64::new(z.re.into(), z.im.into())
}

#[test]
fn every_tolerance_is_met_against_the_reference() {
    let meshes = [
        random_star(2, 7),
        cuboid(DVec3::splat(-0.6), DVec3::new(0.5, 0.7, 0.8), 3),
    ];
    for mesh in &meshes {
        let lattice = Lattice::covering(&mesh.bounds(), 0.6, 0.2).unwrap();
        for sigma in common::SIGMAS {
            let reference = ReferenceDensity::new(mesh, &DensityKernel::new(sigma).unwrap());
            let exact: Vec<_> = (0..lattice.len())
                .step_by(3)
                .map(|i| {
                    (
                        i,
                        reference.unit_density(lattice.position(lattice.unravel(i)), 2e-5),
                    )
                })
                .collect();
            for tolerance in [1e-2, 1e-3, 1e-4, 1e-5] {
                let f = field(mesh, sigma, &lattice, &options(tolerance, Sampling::Point));
                let at = |i: usize| lattice.unravel(i);
                let exterior = relative_l2(
                    exact
                        .iter()
                        .map(|(i, e)| (double(f.exterior[at(*i)]), e.exterior)),
                );
                let interior = relative_l2(
                    exact
                        .iter()
                        .map(|(i, e)| (double(f.interior[at(*i)]), e.interior)),
                );
                eprintln!(
                    "{sigma} {tolerance:e}: exterior {exterior:.2e}, interior {interior:.2e}"
                );
                assert!(
                    exterior < tolerance,
                    "{sigma} {tolerance}: exterior {exterior}"
                );
                assert!(
                    interior < tolerance,
                    "{sigma} {tolerance}: interior {interior}"
                );
            }
        }
    }
}
