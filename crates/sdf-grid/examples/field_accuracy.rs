//! Run time of density fields against their error, for the three peg-in-hole fixtures or for OBJ
//! files (in metres) named on the command line.
//!
//! `cargo run --release -p sdf-grid --example field_accuracy [-- MESH.obj...]`

use std::time::Instant;

use num_complex::{Complex32, Complex64};
use rayon::prelude::*;
use sdf_grid::shapes::PegInHole;
use sdf_grid::{
    DensityField, DensityKernel, DensityOptions, Lattice, LengthUnit, ReferenceDensity,
    RepairOptions, Sampling, Silent, TriangleMesh, UnitDensity, mesh_io,
};

/// Reference points per mesh.
const PROBES: usize = 600;

fn main() -> Result<(), Box<dyn std::error::Error>> {
    println!(
        "mesh,triangles,sigma,tolerance,nodes,points_per_axis,ns_per_node,ns_per_node_averaged,exterior_error,interior_error"
    );
    for (name, mesh) in meshes()? {
        for sigma in [0.1, 0.2] {
            let kernel = DensityKernel::new(sigma)?;
            for per_axis in [32, 64] {
                report(&name, &mesh, &kernel, per_axis)?;
            }
        }
    }
    Ok(())
}

fn meshes() -> Result<Vec<(String, TriangleMesh)>, Box<dyn std::error::Error>> {
    let files: Vec<String> = std::env::args().skip(1).collect();
    let mut meshes = Vec::new();
    if files.is_empty() {
        for fixture in [
            PegInHole::Circular,
            PegInHole::Rectangular,
            PegInHole::Combined,
        ] {
            let (hole, peg) = fixture.pair(0.0)?;
            meshes.push((format!("{}-hole", fixture.name()), hole));
            meshes.push((format!("{}-peg", fixture.name()), peg));
        }
    }
    for file in files {
        let (mesh, _) = mesh_io::read(&file, LengthUnit::M, &RepairOptions::default())?;
        meshes.push((file, mesh));
    }
    Ok(meshes)
}

/// One line per tolerance on a lattice of about `per_axis` nodes along a box of twice the part.
fn report(
    name: &str,
    mesh: &TriangleMesh,
    kernel: &DensityKernel,
    per_axis: usize,
) -> Result<(), Box<dyn std::error::Error>> {
    let size = mesh.bounds().size().max_element();
    let spacing = 2.0 * size / per_axis as f64;
    let lattice = Lattice::covering(&mesh.bounds(), 0.5 * size, spacing)?;
    let reference = ReferenceDensity::new(mesh, kernel);
    let stride = lattice.len().div_ceil(PROBES);
    let probes: Vec<usize> = (0..lattice.len()).step_by(stride).collect();
    let exact: Vec<UnitDensity> = probes
        .par_iter()
        .map(|i| reference.unit_density(lattice.position(lattice.unravel(*i)), 1e-4 * spacing))
        .collect();
    for tolerance in [1e-2, 1e-3, 1e-4, 1e-5] {
        let timed = |sampling| {
            let options = DensityOptions {
                tolerance,
                sampling,
                halo: f64::INFINITY,
            };
            let start = Instant::now();
            let field = DensityField::compute(mesh, kernel, &lattice, &options, &Silent)?;
            let nanoseconds = start.elapsed().as_secs_f64() * 1e9 / lattice.len() as f64;
            Ok::<_, sdf_grid::DensityError>((field, nanoseconds))
        };
        let (field, point_time) = timed(Sampling::Point)?;
        let (_, average_time) = timed(Sampling::CellAverage)?;
        let error = |part: &dyn Fn(usize) -> (Complex32, Complex64)| {
            let (mut error, mut norm) = (0.0, 0.0);
            for k in 0..probes.len() {
                let (found, expected) = part(k);
                let found = Complex64::new(found.re.into(), found.im.into());
                error += (found - expected).norm_sqr();
                norm += expected.norm_sqr();
            }
            (error / norm).sqrt()
        };
        let at = |k: usize| lattice.unravel(probes[k]);
        let exterior = error(&|k| (field.exterior[at(k)], exact[k].exterior));
        let interior = error(&|k| (field.interior[at(k)], exact[k].interior));
        println!(
            "{name},{},{},{tolerance:e},{},{per_axis},{point_time:.0},{average_time:.0},{exterior:.2e},{interior:.2e}",
            mesh.triangles().len(),
            kernel.sigma(),
            lattice.len(),
        );
    }
    Ok(())
}
