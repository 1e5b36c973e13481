//! Density fields, run time against error: `field [--quick] [--out DIR] [solids] [only=NAME] [sigma=VALUE] [PARTS_DIR]`.
//!
//! For meshes of 1k to 1M triangles, lattices of 64 to 192 nodes per axis over twice the part and
//! every tolerance: nanoseconds per node (wall clock, all cores) and relative L2 error against the
//! f64 reference at sampled nodes; how many times faster that is than the paper's sum over all
//! triangles, plain and with SIMD on all cores, both timed on sampled nodes and given the distances, and than distance,
//! side and sum together, each over all triangles, which is what a field holds; than the plain sum with our setup left
//! apart; how long the tree takes to build, and all that does not depend on the lattice, which is that setup (a field of one
//! node). With a folder of meshes
//! (metres), those too. `solids` measures instead the worst error of 200 random solids (12 with
//! `--quick`) per tolerance and sigma: 0.03, 0.1, 0.2 and 0.5, or the one given. `only=NAME` leaves
//! out meshes whose names do not contain NAME.

use glam::DVec3;
use num_complex::Complex64;
use pegfit_benches::midpoint::{LANES, MidpointSum};
use pegfit_benches::{Arguments, Outcome, Row, Sweep, meshes, rms, timed};
use rayon::prelude::*;
use sdf_grid::shapes::{PegInHole, random_solid};
use sdf_grid::{
    Bvh, DensityField, DensityKernel, DensityOptions, Lattice, ReferenceDensity, Sampling, Silent,
    TriangleMesh,
};

const SIGMA: f64 = 0.1;
const TOLERANCES: [f64; 4] = [1e-2, 1e-3, 1e-4, 1e-5];

fn main() -> Outcome<()> {
    let arguments = Arguments::parse()?;
    let quick = arguments.quick;
    if arguments.rest.iter().any(|word| word == "solids") {
        let given = |word: &String| word.strip_prefix("sigma=").map(str::parse);
        let given = arguments.rest.iter().find_map(given).transpose()?;
        let sigmas = given.map_or(vec![0.03, 0.1, 0.2, 0.5], |sigma| vec![sigma]);
        return solids(if quick { 12 } else { 200 }, &sigmas);
    }
    let named = |word: &String| word.strip_prefix("only=").map(str::to_owned);
    let only = arguments.rest.iter().find_map(named);
    let mut parts = Vec::new();
    for which in PegInHole::ALL {
        let (hole, peg) = which.pair(0.0)?;
        parts.push((format!("{} hole", which.name()), hole));
        parts.push((format!("{} peg", which.name()), peg));
    }
    for count in [1_000, 10_000, 100_000, 1_000_000] {
        if quick && count > 100_000 && only.is_none() {
            continue;
        }
        type Make = fn(usize) -> Outcome<TriangleMesh>;
        let kinds: [(&str, Make, usize); 3] = [
            ("cad", meshes::cad, usize::MAX),
            ("curved", meshes::curved, usize::MAX),
            ("facets", meshes::facets, 10_000),
        ];
        for (kind, make, most) in kinds {
            let name = format!("{kind} {}k", count / 1000);
            // Large meshes are made only if they are wanted.
            if count <= most && only.as_ref().is_none_or(|o| name.contains(o)) {
                parts.push((name, make(count)?));
            }
        }
    }
    for folder in arguments.rest.iter().filter(|w| named(w).is_none()) {
        parts.extend(meshes::read_folder(folder)?);
    }
    if let Some(only) = &only {
        parts.retain(|(name, _)| name.contains(only));
    }
    let mut rows = Vec::new();
    println!(
        "{:<24}{:>9}{:>5}{:>8}{:>11}{:>10}{:>9}{:>9}{:>9}{:>9}{:>9}{:>10}{:>10}",
        "mesh",
        "triangles",
        "N",
        "tol",
        "ns/node",
        "error",
        "average",
        "x plain",
        "x SIMD",
        "x all",
        "x apart",
        "tree s",
        "setup s"
    );
    for (name, mesh) in &parts {
        rows.extend(measure(name, mesh, quick)?);
    }
    let sweep = Sweep {
        name: "field",
        title: "Density fields, sigma 0.1, all cores",
        cost: "seconds/node",
        errors: vec![
            "relative L2",
            "triangles",
            "x plain",
            "x SIMD",
            "x all",
            "x apart",
            "tree s",
            "setup s",
        ],
        rows,
    };
    sweep.publish(&arguments.out)
}

/// All lattices and tolerances of one mesh.
fn measure(name: &str, mesh: &TriangleMesh, quick: bool) -> Outcome<Vec<Row>> {
    let kernel = DensityKernel::new(SIGMA)?;
    let (_, build) = timed(3, || Bvh::build(mesh));
    let size = mesh.bounds().size().max_element();
    // What does not depend on the lattice: merging, tree, tables.
    let node = Lattice::new(mesh.bounds().max + size, size, [1; 3])?;
    let options = DensityOptions {
        sampling: Sampling::Point,
        ..DensityOptions::default()
    };
    // The fastest of many, so that what it is taken off does not come out too fast.
    let (one, setup) = timed(9, || {
        DensityField::compute(mesh, &kernel, &node, &options, &Silent)
    });
    one?;
    let mut rows = Vec::new();
    for nodes in if quick { vec![64] } else { vec![64, 128, 192] } {
        let spacing = 2.0 * size / nodes as f64;
        let corner = mesh.bounds().center() - 0.5 * spacing * (nodes - 1) as f64;
        // Not aligned with the part: faces lie anywhere in their cells.
        let origin = corner + spacing * DVec3::new(0.11, 0.23, 0.37);
        let lattice = Lattice::new(origin, spacing, [nodes; 3])?;
        let (exact, sampled) = reference(mesh, &kernel, &lattice);
        let [plain, simd, all] = baselines(mesh, &kernel, &sampled);
        for tolerance in TOLERANCES {
            let options = DensityOptions {
                tolerance,
                sampling: Sampling::Point,
                halo: f64::INFINITY,
            };
            let repeat = if nodes == 64 { 3 } else { 1 };
            let compute = |o: &DensityOptions| {
                timed(repeat, || {
                    DensityField::compute(mesh, &kernel, &lattice, o, &Silent)
                })
            };
            let (field, seconds) = compute(&options);
            let field = field?;
            let averaged = DensityOptions {
                sampling: Sampling::CellAverage,
                ..options
            };
            let average = compute(&averaged).1 / lattice.len() as f64;
            let found = exact.iter().map(|(node, _)| {
                let v = field.exterior[*node] + field.interior[*node];
                Complex64::new(v.re.into(), v.im.into())
            });
            let wrong = rms(found.zip(&exact).map(|(a, (_, b))| (a - b).norm()));
            let error = wrong / rms(exact.iter().map(|(_, b)| b.norm()));
            let each = seconds / lattice.len() as f64;
            let apart = each - setup / lattice.len() as f64;
            println!(
                "{name:<24}{:>9}{nodes:>5}{tolerance:>8.0e}{:>11.1}{error:>10.1e}{:>9.1}{:>9.0}{:>9.1}{:>9.0}{:>9.0}{build:>10.4}{setup:>10.4}",
                mesh.triangles().len(),
                each * 1e9,
                average * 1e9,
                plain / each,
                simd / each,
                all / each,
                plain / apart
            );
            rows.push(Row {
                series: name.to_owned(),
                setting: format!("{nodes}^3, {tolerance:.0e}"),
                seconds: each,
                errors: vec![
                    error,
                    mesh.triangles().len() as f64,
                    plain / each,
                    simd / each,
                    all / each,
                    plain / apart,
                    build,
                    setup,
                ],
            });
        }
    }
    Ok(rows)
}

/// Prints the worst relative L2 error and error of signed distance over random solids.
fn solids(count: u64, sigmas: &[f64]) -> Outcome<()> {
    for &sigma in sigmas {
        let kernel = DensityKernel::new(sigma)?;
        let mut worst = [(0f64, 0u64); TOLERANCES.len()];
        let mut distance = 0f64;
        for seed in 0..count {
            let mesh = random_solid(seed)?;
            let (bounds, size) = (mesh.bounds(), mesh.bounds().size().max_element());
            let near = Lattice::covering(&bounds, 0.3 * size, size / 15.3)?;
            // A cube of twice the part: most of its nodes are far away, where little is left of thin parts.
            let corner = bounds.center() - size * DVec3::new(0.991, 0.993, 0.997);
            let far = Lattice::new(corner, size / 15.7, [32; 3])?;
            for lattice in [near, far] {
                let (errors, wrong) = errors(&mesh, &kernel, &lattice)?;
                distance = distance.max(wrong);
                for (error, worst) in errors.into_iter().zip(&mut worst) {
                    if error > worst.0 {
                        *worst = (error, seed);
                    }
                }
            }
        }
        println!(
            "sigma {sigma}, {count} solids: signed distance within {distance:.1e} of the part"
        );
        for (tolerance, (error, seed)) in TOLERANCES.into_iter().zip(worst) {
            println!("   tolerance {tolerance:.0e}: worst {error:.1e} (solid {seed})");
        }
    }
    Ok(())
}

/// Relative L2 errors of the field at every tolerance, and the error of distances in sizes of the part.
fn errors(
    mesh: &TriangleMesh,
    kernel: &DensityKernel,
    lattice: &Lattice,
) -> Outcome<([f64; TOLERANCES.len()], f64)> {
    let size = mesh.bounds().size().max_element();
    let (exact, sampled) = reference(mesh, kernel, lattice);
    let norm = rms(exact.iter().map(|(_, b)| b.norm()));
    let (mut errors, mut distance) = ([0.0; TOLERANCES.len()], 0f64);
    for (tolerance, error) in TOLERANCES.into_iter().zip(&mut errors) {
        let options = DensityOptions {
            tolerance,
            sampling: Sampling::Point,
            halo: f64::INFINITY,
        };
        let field = DensityField::compute(mesh, kernel, lattice, &options, &Silent)?;
        let wrong = exact.iter().map(|(node, b)| {
            let v = field.exterior[*node] + field.interior[*node];
            (Complex64::new(v.re.into(), v.im.into()) - b).norm()
        });
        *error = rms(wrong) / norm;
        for ((node, _), (_, xi)) in exact.iter().zip(&sampled) {
            let found = f64::from(field.signed_distance[*node]);
            distance = distance.max((found - xi).abs() / size);
        }
    }
    Ok((errors, distance))
}

/// A node and the density there.
type Exact = ([usize; 3], Complex64);

/// The density at nodes spread over the lattice, and their places and signed distances.
fn reference(
    mesh: &TriangleMesh,
    kernel: &DensityKernel,
    lattice: &Lattice,
) -> (Vec<Exact>, Vec<(DVec3, f64)>) {
    let reference = ReferenceDensity::new(mesh, kernel);
    // About a second and a half of work.
    let count = (30_000_000 / mesh.triangles().len()).clamp(LANES * 8, 2000);
    // A stride without common factors with the lattice.
    let stride = (lattice.len() / count) | 1;
    let nodes: Vec<_> = (0..count)
        .map(|i| lattice.unravel(i * stride % lattice.len()))
        .collect();
    let exact = nodes.par_iter().map(|n| {
        let p = lattice.position(*n);
        let density = reference
            .unit_density(p, 1e-4 * lattice.spacing())
            .combined(1.0, 1.0);
        ((*n, density), (p, reference.signed_distance(p)))
    });
    exact.unzip()
}

/// Seconds per node of sums over all triangles, all cores busy: the density's given the distance, plain and with SIMD;
/// distance, side and density.
fn baselines(mesh: &TriangleMesh, kernel: &DensityKernel, sampled: &[(DVec3, f64)]) -> [f64; 3] {
    let sum = MidpointSum::new(mesh, SIGMA);
    // About half a second of plain sums.
    let count = (40_000_000 / mesh.triangles().len()).min(sampled.len()) / LANES * LANES;
    let sampled = &sampled[..count.max(2 * LANES)];
    let (_, plain) = timed(1, || {
        sampled
            .par_iter()
            .map(|(p, xi)| sum.at(*p, *xi))
            .sum::<Complex64>()
    });
    let (_, simd) = timed(3, || {
        let packet = |s: &[(DVec3, f64)]| {
            let points = std::array::from_fn(|i| s[i].0);
            let distances = std::array::from_fn(|i| s[i].1 as f32);
            let [re, im] = sum.packet(&points, &distances);
            re[0] + im[0]
        };
        sampled.par_chunks_exact(LANES).map(packet).sum::<f32>()
    });
    let each = 1.0 / sampled.len() as f64;
    // Each takes several times as long.
    let fewer = &sampled[..sampled.len() / 8];
    let reference = ReferenceDensity::new(mesh, kernel);
    let (_, distance) = timed(1, || {
        let distances = fewer.par_iter().map(|(p, _)| reference.signed_distance(*p));
        distances.sum::<f64>()
    });
    let all = plain * each + distance / fewer.len() as f64;
    [plain * each, simd * each, all]
}
