//! Run time against error:
//! `accuracy [--quick] [--out DIR] [density|correlation|table|direct]... [parts=DIR]`.
//!
//! Prints each sweep and writes it as CSV and as a chart. Without names, all sweeps. With `parts`,
//! only the density fields of the meshes (OBJ or STL, metres) in that folder.

use fft_correlate::{
    DirectEvaluator, DirectOptions, EnergyTable, Pair, PairEnergies, Pose, Response,
    RotationDomain, ScoreModel, TableSpec, TranslationWindow,
};
use num_complex::Complex64;
use pegfit_benches::{
    Arguments, Outcome, Row, Sweep, ask, example, meshes, random_poses, response_errors, rms, timed,
};
use rand::{SeedableRng, rngs::SmallRng};
use rayon::prelude::*;
use sdf_grid::shapes::PegInHole;
use sdf_grid::{
    DensityField, DensityKernel, DensityOptions, Lattice, ReferenceDensity, Sampling, Silent,
    TriangleMesh,
};

/// What the errors of fields are.
const FIELD_ERRORS: &str = "Relative L2 error of the field against the sum over all triangles in \
    double precision, at nodes spread over the lattice, for each tolerance asked for, and the \
    largest error of the signed distance, in sizes of the part. A tolerance is kept where the \
    error is below it.";

/// Measures; true for a quick run.
type Measure = fn(bool) -> Outcome<Sweep>;

fn main() -> Outcome<()> {
    let arguments = Arguments::parse()?;
    let sweeps: [(&str, Measure); 3] = [("density", density), ("table", table), ("direct", direct)];
    let folder = arguments.rest.iter().find_map(|w| w.strip_prefix("parts="));
    if let Some(folder) = folder {
        return parts(folder, arguments.quick)?.publish(&arguments);
    }
    for name in &arguments.rest {
        if sweeps.iter().all(|s| s.0 != name) {
            return Err(format!("no sweep {name}: density, table, direct or parts=DIR").into());
        }
    }
    for (name, sweep) in sweeps {
        if arguments.rest.is_empty() || arguments.rest.iter().any(|n| n == name) {
            sweep(arguments.quick)?.publish(&arguments)?;
        }
    }
    Ok(())
}

/// Fields of the combined hole at every tolerance.
fn density(quick: bool) -> Outcome<Sweep> {
    let (hole, _) = PegInHole::Combined.pair(0.0)?;
    let h = if quick { 2e-3 } else { 1e-3 };
    let lattice = Lattice::covering(&hole.bounds(), 0.01, h)?;
    let mut rows = Vec::new();
    for sigma in [0.1, 0.2] {
        let name = format!("sigma {sigma}, {:?} nodes", lattice.shape());
        rows.extend(fields(
            &name,
            &hole,
            sigma,
            &lattice,
            37,
            if quick { 1 } else { 3 },
        )?);
    }
    Ok(Sweep {
        name: "density",
        title: "Density field of the combined hole",
        about: FIELD_ERRORS,
        cost: "field",
        errors: vec!["error", "error of distance"],
        rows,
    })
}

/// Fields of every mesh in a folder, over its bounds and 0.3 of its size more.
fn parts(folder: &str, quick: bool) -> Outcome<Sweep> {
    let (cells, count) = if quick { (15.3, 300) } else { (31.3, 2000) };
    let mut rows: Vec<Row> = Vec::new();
    for (name, mesh) in meshes::read_folder(folder)? {
        let size = mesh.bounds().size().max_element();
        let lattice = Lattice::covering(&mesh.bounds(), 0.3 * size, size / cells)?;
        // No common factors with the lattice, so that the nodes lie all over it.
        let stride = (lattice.len() / count) | 1;
        println!(
            "{name}: {} triangles, {:?} nodes",
            mesh.triangles().len(),
            lattice.shape()
        );
        for sigma in [0.03, 0.1, 0.2, 0.5] {
            let series = format!("{name}, sigma {sigma}");
            let measured = fields(&series, &mesh, sigma, &lattice, stride, 1)?;
            for row in &measured {
                println!("   sigma {sigma}, {}: {:.1e}", row.setting, row.errors[0]);
            }
            rows.extend(measured);
        }
    }
    Ok(Sweep {
        name: "parts",
        title: "Density fields of parts",
        about: FIELD_ERRORS,
        cost: "field",
        errors: vec!["error", "error of distance"],
        rows,
    })
}

/// Fields of one mesh at every tolerance, against the f64 sum over all triangles at every
/// `stride`-th node: relative L2 error, and the worst error of the signed distance in sizes of the
/// part.
fn fields(
    series: &str,
    mesh: &TriangleMesh,
    sigma: f64,
    lattice: &Lattice,
    stride: usize,
    times: usize,
) -> Outcome<Vec<Row>> {
    let kernel = DensityKernel::new(sigma)?;
    let reference = ReferenceDensity::new(mesh, &kernel);
    let size = mesh.bounds().size().max_element();
    let nodes: Vec<_> = (0..lattice.len())
        .step_by(stride)
        .map(|n| lattice.unravel(n))
        .collect();
    let exact: Vec<(Complex64, f64)> = nodes
        .par_iter()
        .map(|n| {
            let p = lattice.position(*n);
            let unit = reference.unit_density(p, 1e-4 * lattice.spacing());
            (unit.combined(1.0, 1.0), reference.signed_distance(p))
        })
        .collect();
    let mut rows = Vec::new();
    for tolerance in [1e-2, 1e-3, 1e-4, 1e-5] {
        let options = DensityOptions {
            tolerance,
            sampling: Sampling::Point,
            halo: f64::INFINITY,
        };
        let (field, seconds) = timed(times, || {
            DensityField::compute(mesh, &kernel, lattice, &options, &Silent)
        });
        let field = field?;
        let wrong = nodes.iter().zip(&exact).map(|(n, (density, _))| {
            let v = field.exterior[*n] + field.interior[*n];
            (Complex64::new(v.re.into(), v.im.into()) - density).norm()
        });
        let error = rms(wrong) / rms(exact.iter().map(|e| e.0.norm()));
        let away = nodes.iter().zip(&exact).map(|(n, (_, distance))| {
            (f64::from(field.signed_distance[*n]) - distance).abs() / size
        });
        rows.push(Row {
            series: series.to_owned(),
            setting: format!("tolerance {tolerance:e}"),
            seconds,
            errors: vec![error, away.fold(0.0, f64::max)],
        });
    }
    Ok(rows)
}

/// The pair of the table and direct sweeps, held-out poses about the fit, and the truth there.
fn held_out(
    h: f64,
    angle: f64,
    reach: f64,
    count: usize,
) -> Outcome<(Pair, Vec<Pose>, Vec<Response>)> {
    let model = ScoreModel::GUIDED;
    let pair = example(PegInHole::Rectangular, &model, h)?;
    let mut rng = SmallRng::seed_from_u64(9);
    let poses = random_poses(&pair, &mut rng, angle.to_radians(), reach, count);
    let source = DirectEvaluator::new(&pair, &DirectOptions::FULL)?;
    let truth = poses.iter().map(|p| ask(&source, p)).collect();
    Ok((pair, poses, truth))
}

/// Table errors against the direct evaluator on the same densities: rotation spacing at one
/// translation spacing, then the reverse; cubic and linear.
fn table(quick: bool) -> Outcome<Sweep> {
    let (angle, count) = (6.0, 300);
    let runs: &[(f64, f64)] = if quick {
        &[(2.0, 6.0), (2.0, 3.0), (3.0, 3.0)]
    } else {
        &[
            (2.0, 6.0),
            (2.0, 4.0),
            (2.0, 3.0),
            (2.0, 2.0),
            (1.5, 3.0),
            (3.0, 3.0),
        ]
    };
    let mut rows = Vec::new();
    for &(h, step) in runs {
        let h = h * 1e-3;
        let (pair, poses, truth) = held_out(h, angle, 0.006, count)?;
        let window = TranslationWindow::cube(0.006 + 2.0 * h, h)?;
        let spec = TableSpec::for_pair(&pair, &window, RotationDomain::ball(angle, step));
        let table =
            EnergyTable::compute(spec, &PairEnergies::plan(&pair, &window)?, 4 << 30, &Silent)?;
        let setting = format!(
            "{step}°, {:.1} mm, {} rot.",
            h * 1e3,
            table.grid().nodes().len()
        );
        let (found, seconds) = timed(3, || {
            poses.iter().map(|p| table.respond(p)).collect::<Vec<_>>()
        });
        rows.push(Row {
            series: "cubic splines".into(),
            setting,
            seconds: seconds / poses.len() as f64,
            errors: response_errors(&pair, &poses, &truth, &found),
        });
    }
    Ok(Sweep {
        name: "table",
        title: "Tables of the rectangular pair against the direct evaluator",
        about: "What interpolation and storage cost: 300 random poses that are not nodes, \
            answered by the table and by direct quadrature on the same densities. Errors are rms, \
            of energy over its range, of force and torque over their rms. What the lattice itself \
            costs is not in them.",
        cost: "query",
        errors: vec!["error of energy", "error of force", "error of torque"],
        rows,
    })
}

/// The direct evaluator with merged points against every cell its own point.
fn direct(quick: bool) -> Outcome<Sweep> {
    let h = if quick { 2e-3 } else { 1e-3 };
    let (pair, poses, truth) = held_out(h, 20.0, 0.008, 200)?;
    let mut rows = Vec::new();
    for max in [2_000, 5_000, 10_000, 20_000, 50_000, 100_000] {
        let options = DirectOptions {
            max_points: Some(max),
            ..DirectOptions::REAL_TIME
        };
        let source = DirectEvaluator::new(&pair, &options)?;
        let (found, seconds) = timed(3, || {
            poses.iter().map(|p| ask(&source, p)).collect::<Vec<_>>()
        });
        rows.push(Row {
            series: format!("h {:.0} mm", h * 1e3),
            setting: format!("{} points", source.describe().points()),
            seconds: seconds / poses.len() as f64,
            errors: response_errors(&pair, &poses, &truth, &found),
        });
    }
    Ok(Sweep {
        name: "direct",
        title: "Direct evaluator with merged points",
        about: "What merging cells into fewer quadrature points costs, against every cell its own \
            point, at 200 random poses. Errors as in the table before.",
        cost: "pose",
        errors: vec!["error of energy", "error of force", "error of torque"],
        rows,
    })
}
