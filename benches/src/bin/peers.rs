//! Signed distance on a lattice by this crate and by parry3d, for `benches/peers/peers.py`, which
//! times Open3D and libigl on the same mesh and points in the same run.
//!
//!     peers MESH.obj OUT_DIR X Y Z SPACING N
//!
//! reads a mesh in metres, takes N x N x N points from (X, Y, Z) on (z fastest), prints build and
//! query times as JSON and writes the distances of each method, and of every 97th point by brute
//! force in f64, to OUT_DIR as raw little-endian f64.

use std::fs;
use std::path::Path;
use std::time::Instant;

use glam::DVec3;
use parry3d::math::Vector;
use parry3d::query::PointQuery;
use parry3d::shape::{TriMesh, TriMeshFlags};
use pegfit_benches::Outcome;
use rayon::prelude::*;
use sdf_grid::{
    Bvh, DensityField, DensityKernel, DensityOptions, Lattice, LengthUnit, ReferenceDensity,
    RepairOptions, Sampling, Silent, TriangleMesh, mesh_io, signed_distances,
};
use serde_json::{Value, json};

/// One point of so many is computed by brute force.
const CHECKED: usize = 97;

fn main() -> Outcome<()> {
    let words: Vec<String> = std::env::args().skip(1).collect();
    let [mesh, out, numbers @ ..] = words.as_slice() else {
        return Err("usage: peers MESH.obj OUT_DIR X Y Z SPACING N".into());
    };
    let numbers: Vec<f64> = numbers
        .iter()
        .map(|w| w.parse())
        .collect::<Result<_, _>>()?;
    let [x, y, z, spacing, n] = numbers[..] else {
        return Err("five numbers: X Y Z SPACING N".into());
    };
    let (mesh, _) = mesh_io::read(mesh, LengthUnit::M, &RepairOptions::default())?;
    let lattice = Lattice::new(DVec3::new(x, y, z), spacing, [n as usize; 3])?;
    let points: Vec<DVec3> = (0..lattice.len())
        .map(|i| lattice.position(lattice.unravel(i)))
        .collect();
    let out = Path::new(out);
    let times = [
        ("pegfit, points", single_points(&mesh, &points, out)?),
        ("pegfit, lattice", on_lattice(&mesh, &lattice, out)?),
        ("pegfit, with density", with_density(&mesh, &lattice, out)?),
        ("parry3d", parry(&mesh, &points, out)?),
    ];
    brute_force(&mesh, &points, out)?;
    println!("{}", json!(times.into_iter().collect::<Vec<_>>()));
    Ok(())
}

/// Seconds to build, seconds for all points.
fn timed(out: &Path, name: &str, build: f64, query: impl FnOnce() -> Vec<f64>) -> Outcome<Value> {
    let began = Instant::now();
    let distances = query();
    let seconds = began.elapsed().as_secs_f64();
    write(&out.join(format!("{name}.f64")), &distances)?;
    Ok(json!({"build": build, "query": seconds}))
}

fn write(path: &Path, values: &[f64]) -> Outcome<()> {
    let bytes: Vec<u8> = values.iter().flat_map(|v| v.to_le_bytes()).collect();
    Ok(fs::write(path, bytes)?)
}

fn single_points(mesh: &TriangleMesh, points: &[DVec3], out: &Path) -> Outcome<Value> {
    let began = Instant::now();
    let bvh = Bvh::build(mesh);
    let build = began.elapsed().as_secs_f64();
    timed(out, "pegfit, points", build, || {
        points.par_iter().map(|&p| bvh.signed_distance(p)).collect()
    })
}

/// Distances alone; the tree is built within.
fn on_lattice(mesh: &TriangleMesh, lattice: &Lattice, out: &Path) -> Outcome<Value> {
    let began = Instant::now();
    let found = signed_distances(mesh, lattice, &Silent)?;
    let seconds = began.elapsed().as_secs_f64();
    let distances: Vec<f64> = found.iter().map(|&d| d.into()).collect();
    write(&out.join("pegfit, lattice.f64"), &distances)?;
    Ok(json!({"build": 0.0, "query": seconds}))
}

/// Distance and density together, as fields are computed; the tree is built within.
fn with_density(mesh: &TriangleMesh, lattice: &Lattice, out: &Path) -> Outcome<Value> {
    let kernel = DensityKernel::new(0.1)?;
    let options = DensityOptions {
        sampling: Sampling::Point,
        ..DensityOptions::default()
    };
    let began = Instant::now();
    let field = DensityField::compute(mesh, &kernel, lattice, &options, &Silent)?;
    let seconds = began.elapsed().as_secs_f64();
    let distances: Vec<f64> = field.signed_distance.iter().map(|&d| d.into()).collect();
    write(&out.join("pegfit, with density.f64"), &distances)?;
    Ok(json!({"build": 0.0, "query": seconds}))
}

fn parry(mesh: &TriangleMesh, points: &[DVec3], out: &Path) -> Outcome<Value> {
    let vector = |p: DVec3| Vector::new(p.x as f32, p.y as f32, p.z as f32);
    let vertices = mesh.vertices().iter().map(|&v| vector(v)).collect();
    let began = Instant::now();
    let trimesh = TriMesh::with_flags(vertices, mesh.triangles().to_vec(), TriMeshFlags::ORIENTED)
        .map_err(|e| e.to_string())?;
    let build = began.elapsed().as_secs_f64();
    timed(out, "parry3d", build, || {
        points
            .par_iter()
            .map(|&p| {
                let found = trimesh.project_local_point(vector(p), false);
                let distance = f64::from((found.point - vector(p)).length());
                if found.is_inside { -distance } else { distance }
            })
            .collect()
    })
}

fn brute_force(mesh: &TriangleMesh, points: &[DVec3], out: &Path) -> Outcome<()> {
    let reference = ReferenceDensity::new(mesh, &DensityKernel::new(0.1)?);
    let some: Vec<DVec3> = points.iter().copied().step_by(CHECKED).collect();
    let distances: Vec<f64> = some
        .par_iter()
        .map(|&p| reference.signed_distance(p))
        .collect();
    write(&out.join("exact.f64"), &distances)
}
