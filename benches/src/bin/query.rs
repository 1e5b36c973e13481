//! Latency of one query and throughput of many: `query [--quick] [--out DIR]`.

use std::time::Instant;

use fft_correlate::{
    DirectEvaluator, DirectOptions, EnergySource, EnergyTable, Interpolation, PairEnergies, Pose,
    Response, RotationDomain, ScoreModel, TableSpec, TranslationWindow, Twist,
};
use pegfit_benches::{Arguments, Outcome, example, random_poses};
use rand::{SeedableRng, rngs::SmallRng};
use sdf_grid::shapes::PegInHole;
use sdf_grid::{Sampling, Silent};

fn main() -> Outcome<()> {
    let arguments = Arguments::parse()?;
    let h = 2e-3;
    let pair = example(
        PegInHole::Rectangular,
        &ScoreModel::GUIDED,
        h,
        Sampling::CellAverage,
    )?;
    let (angle, step) = if arguments.quick {
        (6.0, 3.0)
    } else {
        (20.0, 4.0)
    };
    let window = TranslationWindow::cube(0.010, h)?;
    let spec = TableSpec::for_pair(&pair, &window, RotationDomain::ball(angle, step));
    let table = EnergyTable::compute(spec, &PairEnergies::plan(&pair, &window)?, 4 << 30, &Silent)?;
    println!(
        "table: {} rotations x {:?} displacements, {:.1} MB",
        table.grid().nodes().len(),
        window.shape(),
        table.spec().bytes(table.grid().nodes().len()) as f64 / 1e6
    );
    let mut rng = SmallRng::seed_from_u64(4);
    let radians = f64::to_radians(0.9 * angle);
    let random = random_poses(&pair, &mut rng, radians, 0.006, 20_000);
    let path = path_through(&random[..20], 1000);
    println!("{:<38}{:>12}{:>12}{:>12} µs", "", "p50", "p99", "p99.9");
    for (name, how) in [
        ("cubic", Interpolation::CatmullRom),
        ("linear", Interpolation::Linear),
    ] {
        let table = table.clone().with_interpolation(how);
        latencies(&format!("table, {name}, along a path"), &table, &path);
        latencies(&format!("table, {name}, random poses"), &table, &random);
    }
    for points in [5_000, 20_000] {
        let options = DirectOptions {
            max_points: Some(points),
            ..DirectOptions::REAL_TIME
        };
        let source = DirectEvaluator::new(&pair, &options)?;
        let name = format!("direct, {} points", source.describe().points());
        latencies(&name, &source, &path[..2000]);
    }
    let mut responses = vec![Response::default(); random.len()];
    let (rounds, began) = (if arguments.quick { 2 } else { 20 }, Instant::now());
    for _ in 0..rounds {
        table.respond_many(&random, &mut responses);
    }
    let rate = (rounds * random.len()) as f64 / began.elapsed().as_secs_f64();
    println!("batch, cubic, all threads: {rate:.3e} poses/s");
    Ok(())
}

/// A path from pose to pose, as a hand would move.
fn path_through(corners: &[Pose], steps: usize) -> Vec<Pose> {
    corners
        .windows(2)
        .flat_map(|ends| {
            let whole = ends[0].twist_to(&ends[1]);
            (0..steps).map(move |i| {
                let s = i as f64 / steps as f64;
                ends[0].perturbed(&Twist {
                    angular: s * whole.angular,
                    linear: s * whole.linear,
                })
            })
        })
        .collect()
}

/// Prints quantiles of the time of one evaluation, after one pass to warm up.
fn latencies(name: &str, source: &dyn EnergySource, poses: &[Pose]) {
    let mut scratch = source.scratch();
    let mut sum = 0.0;
    for pose in &poses[..poses.len().min(2000)] {
        sum += source.evaluate(pose, &mut scratch).energy;
    }
    let mut micros: Vec<f64> = poses
        .iter()
        .map(|pose| {
            let began = Instant::now();
            sum += source.evaluate(pose, &mut scratch).energy;
            1e6 * began.elapsed().as_secs_f64()
        })
        .collect();
    assert!(sum.is_finite(), "energies are finite");
    micros.sort_unstable_by(f64::total_cmp);
    let at = |q: f64| micros[((micros.len() - 1) as f64 * q) as usize];
    println!(
        "{name:<38}{:>12.2}{:>12.2}{:>12.2}",
        at(0.5),
        at(0.99),
        at(0.999)
    );
}
