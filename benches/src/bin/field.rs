//! Density fields, run time against error:
//! `field [--quick] [--out DIR] [solids] [only=NAME] [sigma=VALUE] [PARTS_DIR]`.
//!
//! For meshes of 1k to 1M triangles, lattices of 64 to 192 nodes per axis over twice the part and
//! every tolerance: nanoseconds per node (wall clock, all cores) and relative L2 error against the
//! f64 reference at sampled nodes; how many times faster that is than sums over all triangles: the
//! paper's midpoint sum for the density alone, plain and with SIMD, both given the distances, and
//! distance, side and density together; and how long what does not depend on the lattice takes
//! (merging, tree, tables: a field of one node). With a folder of meshes (metres), those too.
//! `solids` measures instead the worst error of 200 random solids (12 with `--quick`) per tolerance
//! and sigma: 0.03, 0.1, 0.2 and 0.5, or the one given. `only=NAME` leaves out meshes whose names
//! do not contain NAME.

use glam::DVec3;
use num_complex::Complex64;
use pegfit_benches::midpoint::{LANES, MidpointSum};
use pegfit_benches::table::{Table, significant};
use pegfit_benches::{Arguments, Outcome, Row, Sweep, meshes, rms, timed};
use pegfit_fixtures::{PegInHole, random_solid};
use rayon::prelude::*;
use sdf_grid::{
    DensityField, DensityKernel, DensityOptions, Lattice, ReferenceDensity, Sampling, Silent,
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
        let worst = solids(if quick { 12 } else { 200 }, &sigmas)?;
        return arguments.publish(&worst, None);
    }
    let mut found = Vec::new();
    for (name, mesh) in &chosen(&arguments)? {
        for nodes in if quick { vec![64] } else { vec![64, 128, 192] } {
            eprintln!("{name}, {nodes} nodes per axis");
            found.push(measure(name, mesh, nodes)?);
        }
    }
    arguments.publish(&summary(&found), Some(&details(&found).chart()?))
}

/// The meshes that the arguments ask for.
fn chosen(arguments: &Arguments) -> Outcome<Vec<(String, TriangleMesh)>> {
    let quick = arguments.quick;
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
    Ok(parts)
}

/// One mesh on one lattice.
struct Measured {
    name: String,
    triangles: usize,
    /// Along each axis.
    nodes: usize,
    /// Seconds per node, relative L2 error, and seconds per node of cell averages, per tolerance.
    fields: [[f64; 3]; TOLERANCES.len()],
    /// Seconds per node of sums over all triangles: density plain, with SIMD; everything.
    sums: [f64; 3],
    /// Seconds that do not depend on the lattice.
    setup: f64,
}

fn summary(found: &[Measured]) -> Table {
    let mut table = Table::new(
        "field",
        "Density fields: time per node and error",
        "Wall nanoseconds per node on all cores, setup included, for each tolerance, at sigma \
         0.1, point samples, N nodes per axis over twice the part; the error at each tolerance \
         (relative L2, sampled nodes, against the sum over all triangles in double precision); \
         the time of cell averages at 1e-3; how many times as long sums over all triangles take \
         in the same run at 1e-3: the paper's midpoint sum given the distances, plain and with \
         SIMD, and distance, side and density, which is what a field holds; seconds that do not \
         depend on the lattice. `cad` is the combined hole finely cut, `curved` a torus, `facets` \
         a round hole of narrow facets.",
        &[
            "mesh",
            "triangles",
            "N",
            "ns 1e-2",
            "ns 1e-3",
            "ns 1e-4",
            "ns 1e-5",
            "error 1e-2",
            "error 1e-3",
            "error 1e-4",
            "error 1e-5",
            "averages, ns",
            "x plain",
            "x SIMD",
            "x all",
            "setup s",
        ],
    );
    for m in found {
        let [times, errors] = [0, 1].map(|k: usize| m.fields.map(|f| f[k]));
        let mut cells = vec![m.name.clone(), m.triangles.to_string(), m.nodes.to_string()];
        cells.extend(times.map(|t| significant(1e9 * t, 3)));
        cells.extend(errors.map(|e| significant(e, 2)));
        cells.push(significant(1e9 * m.fields[1][2], 3));
        cells.extend(m.sums.map(|s| significant(s / times[1], 3)));
        cells.push(significant(m.setup, 2));
        table.push(cells);
    }
    table
}

/// For the chart: error against time per node.
fn details(found: &[Measured]) -> Sweep {
    let rows = found.iter().flat_map(|m| {
        m.fields.iter().zip(TOLERANCES).map(|(f, tolerance)| Row {
            series: format!("{}, N = {}", m.name, m.nodes),
            setting: format!("{tolerance:.0e}"),
            seconds: f[0],
            errors: vec![f[1]],
        })
    });
    Sweep {
        name: "field",
        title: "Density fields, sigma 0.1, all cores",
        about: "",
        cost: "node",
        errors: vec!["error of the field"],
        rows: rows.collect(),
    }
}

/// All tolerances of one mesh on a lattice of `nodes` per axis.
fn measure(name: &str, mesh: &TriangleMesh, nodes: usize) -> Outcome<Measured> {
    let kernel = DensityKernel::new(SIGMA)?;
    let size = mesh.bounds().size().max_element();
    let spacing = 2.0 * size / nodes as f64;
    let corner = mesh.bounds().center() - 0.5 * spacing * (nodes - 1) as f64;
    // Not aligned with the part: faces lie anywhere in their cells.
    let origin = corner + spacing * DVec3::new(0.11, 0.23, 0.37);
    let lattice = Lattice::new(origin, spacing, [nodes; 3])?;
    let (exact, sampled) = reference(mesh, &kernel, &lattice);
    let repeat = if nodes == 64 { 3 } else { 1 };
    let mut fields = [[0.0; 3]; TOLERANCES.len()];
    for (tolerance, measured) in TOLERANCES.into_iter().zip(&mut fields) {
        let compute = |sampling| {
            let options = DensityOptions {
                tolerance,
                sampling,
                halo: f64::INFINITY,
            };
            timed(repeat, || {
                DensityField::compute(mesh, &kernel, &lattice, &options, &Silent)
            })
        };
        let (field, seconds) = compute(Sampling::Point);
        let error = relative_error(&field?, &exact);
        let (_, average) = compute(Sampling::CellAverage);
        let each = 1.0 / lattice.len() as f64;
        *measured = [seconds * each, error, average * each];
    }
    Ok(Measured {
        name: name.to_owned(),
        triangles: mesh.triangles().len(),
        nodes,
        fields,
        sums: baselines(mesh, &kernel, &sampled),
        setup: setup(mesh, &kernel)?,
    })
}

/// Seconds of what does not depend on the lattice (merging, tree, tables): a field of one node, the
/// fastest of many.
fn setup(mesh: &TriangleMesh, kernel: &DensityKernel) -> Outcome<f64> {
    let size = mesh.bounds().size().max_element();
    let node = Lattice::new(mesh.bounds().max + size, size, [1; 3])?;
    let options = DensityOptions {
        sampling: Sampling::Point,
        ..DensityOptions::default()
    };
    let (one, seconds) = timed(9, || {
        DensityField::compute(mesh, kernel, &node, &options, &Silent)
    });
    one?;
    Ok(seconds)
}

/// Relative L2 error of a field at the nodes where the density is known.
fn relative_error(field: &DensityField, exact: &[Exact]) -> f64 {
    let wrong = exact.iter().map(|(node, density)| {
        let v = field.exterior[*node] + field.interior[*node];
        (Complex64::new(v.re.into(), v.im.into()) - density).norm()
    });
    rms(wrong) / rms(exact.iter().map(|(_, b)| b.norm()))
}

/// The worst relative L2 error and error of signed distance over random solids.
fn solids(count: u64, sigmas: &[f64]) -> Outcome<Table> {
    let mut table = Table::new(
        "solids",
        &format!("Worst error over {count} random solids"),
        "Hulls, perforated blocks, plates, needles, tori and stars \
         (`pegfit_fixtures::random_solid`), each on a lattice around it and on a cube of twice \
         its size: the worst relative L2 error at each tolerance, the solid's number in brackets, \
         and the largest error of the signed distance, in sizes of the part.",
        &["sigma", "1e-2", "1e-3", "1e-4", "1e-5", "distance"],
    );
    for &sigma in sigmas {
        let kernel = DensityKernel::new(sigma)?;
        let mut worst = [(0f64, 0u64); TOLERANCES.len()];
        let mut distance = 0f64;
        for seed in 0..count {
            let mesh = random_solid(seed)?;
            for lattice in lattices(&mesh)? {
                let (errors, wrong) = errors(&mesh, &kernel, &lattice)?;
                distance = distance.max(wrong);
                for (error, worst) in errors.into_iter().zip(&mut worst) {
                    if error > worst.0 {
                        *worst = (error, seed);
                    }
                }
            }
        }
        eprintln!("sigma {sigma}: {count} solids measured");
        let cells = worst.map(|(error, seed)| format!("{error:.1e} ({seed})"));
        let first = std::iter::once(sigma.to_string());
        table.push(first.chain(cells).chain([format!("{distance:.1e}")]));
    }
    Ok(table)
}

/// Around the part, and a cube of twice its size: most nodes of that are far away, where little is
/// left of thin parts.
fn lattices(mesh: &TriangleMesh) -> Outcome<[Lattice; 2]> {
    let (bounds, size) = (mesh.bounds(), mesh.bounds().size().max_element());
    let near = Lattice::covering(&bounds, 0.3 * size, size / 15.3)?;
    let corner = bounds.center() - size * DVec3::new(0.991, 0.993, 0.997);
    Ok([near, Lattice::new(corner, size / 15.7, [32; 3])?])
}

/// Relative L2 errors of the field at every tolerance, and the error of distances in sizes of the
/// part.
fn errors(
    mesh: &TriangleMesh,
    kernel: &DensityKernel,
    lattice: &Lattice,
) -> Outcome<([f64; TOLERANCES.len()], f64)> {
    let size = mesh.bounds().size().max_element();
    let (exact, sampled) = reference(mesh, kernel, lattice);
    let (mut errors, mut distance) = ([0.0; TOLERANCES.len()], 0f64);
    for (tolerance, error) in TOLERANCES.into_iter().zip(&mut errors) {
        let options = DensityOptions {
            tolerance,
            sampling: Sampling::Point,
            halo: f64::INFINITY,
        };
        let field = DensityField::compute(mesh, kernel, lattice, &options, &Silent)?;
        *error = relative_error(&field, &exact);
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

/// Seconds per node of sums over all triangles, all cores busy: the density's given the distance,
/// plain and with SIMD; distance, side and density.
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
