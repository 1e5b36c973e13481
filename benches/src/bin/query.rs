//! Latency of one query and throughput of many: `query [--quick] [--out DIR]`.
//!
//! Three tables: a small one of the paper's square pair, which fits in the processor's caches; a
//! large one of a closed form, of which random queries read main memory; and the large one again as
//! whole numbers. Then a million poses through `pegfit score`'s own steps, and the paper's pairs in
//! contact at the default spacing.

use std::time::Instant;

use fft_correlate::{
    DirectEvaluator, DirectOptions, EnergySource, EnergyTable, NodeEnergies, Pair, PairBuilder,
    PairEnergies, Pose, Response, RotationDomain, ScoreModel, TableSpec, TranslationWindow, Twist,
};
use glam::DQuat;
use ndarray::ArrayViewMut3;
use pegfit_benches::frames::contact_paths;
use pegfit_benches::table::{Table, significant};
use pegfit_benches::{Arguments, Outcome, example, random_poses};
use pegfit_scene::poses::{PoseReader, ScoredPose, append_score};
use rand::{SeedableRng, rngs::SmallRng};
use sdf_grid::shapes::PegInHole;
use sdf_grid::{Lattice, Silent};

const QUANTILES: [&str; 5] = ["source", "poses", "p50, µs", "p99, µs", "p99.9, µs"];

fn main() -> Outcome<()> {
    let arguments = Arguments::parse()?;
    let h = 2e-3;
    let pair = example(PegInHole::Rectangular, &ScoreModel::GUIDED, h)?;
    let mut latency = Table::new(
        "latency",
        "Time of one query",
        "Microseconds for energy and wrench at one pose, one thread, after a pass to warm up: the \
         median and the slowest of a hundred and of a thousand. Along a path from pose to pose, \
         as a hand moves, or at random poses. The small table (of the square pair) fits in the \
         processor's caches; random poses in the large one (of a closed form) read main memory.",
        &QUANTILES,
    );
    let mut many = Table::new(
        "throughput",
        "Many queries",
        "Random poses per second on all threads, in memory; and, on one thread, the microseconds \
         that a query takes with its row of CSV, and that reading a pose from CSV takes, as in \
         `pegfit score`.",
        &[
            "table",
            "rotations",
            "displacements",
            "MB",
            "poses per second",
            "query and row, µs",
            "read, µs",
        ],
    );
    small_table(&pair, h, arguments.quick, &mut latency, &mut many)?;
    direct(&pair, &mut latency)?;
    large_table(&pair, arguments.quick, &mut latency, &mut many)?;
    let contact = in_contact(arguments.quick, &mut many)?;
    arguments.publish(&latency, None)?;
    arguments.publish(&contact, None)?;
    arguments.publish(&many, None)
}

fn small_table(
    pair: &Pair,
    h: f64,
    quick: bool,
    latency: &mut Table,
    many: &mut Table,
) -> Outcome<()> {
    let (angle, step) = if quick { (6.0, 3.0) } else { (20.0, 4.0) };
    let window = TranslationWindow::cube(0.010, h)?;
    let spec = TableSpec::for_pair(pair, &window, RotationDomain::ball(angle, step));
    let table = EnergyTable::compute(spec, &PairEnergies::plan(pair, &window)?, 4 << 30, &Silent)?;
    let mut rng = SmallRng::seed_from_u64(4);
    let random = random_poses(pair, &mut rng, f64::to_radians(0.9 * angle), 0.006, 20_000);
    let path = path_through(&random[..20], 1000);
    latency.push(latencies("small table", "along a path", &table, &path));
    latency.push(latencies("small table", "random", &table, &random));
    let rate = throughput(&table, &random);
    many.push(described("small", &table, rate, None));
    Ok(())
}

fn direct(pair: &Pair, latency: &mut Table) -> Outcome<()> {
    let mut rng = SmallRng::seed_from_u64(5);
    let poses = random_poses(pair, &mut rng, 0.3, 0.006, 2000);
    for points in [5_000, 20_000] {
        let options = DirectOptions {
            max_points: Some(points),
            ..DirectOptions::REAL_TIME
        };
        let source = DirectEvaluator::new(pair, &options)?;
        let name = format!("direct, {} points", source.describe().points());
        latency.push(latencies(&name, "random", &source, &poses));
    }
    Ok(())
}

/// Rotations and displacements of the tables in contact, degrees and metres.
const BALL: f64 = 7.2;
const REACH: f64 = 3.6e-3;

/// The paper's pairs with parts that touch, at the default spacing.
fn in_contact(quick: bool, many: &mut Table) -> Outcome<Table> {
    let mut latency = Table::new(
        "latency-contact",
        "Time of one query in contact",
        "As above, along paths with parts that touch, at the default spacing: most of the time goes \
         to the sum over both surfaces.",
        &QUANTILES,
    );
    let step = if quick { 3.6 } else { 1.8 };
    for which in PegInHole::ALL {
        let (hole, peg) = which.pair(1e-4)?;
        let pair = PairBuilder::default().build(&hole, &peg, &ScoreModel::GUIDED, &Silent)?;
        let window = TranslationWindow::cube(2.0 * REACH, pair.spacing())?;
        let spec = TableSpec::for_pair(&pair, &window, RotationDomain::ball(BALL, step));
        let plan = PairEnergies::plan(&pair, &window)?;
        let table = EnergyTable::compute(spec, &plan, 4 << 30, &Silent)?;
        let direct = DirectEvaluator::new(&pair, &DirectOptions::REAL_TIME)?;
        let angle = 0.9 * BALL.to_radians();
        let path = contact_paths(&pair, angle, 0.9 * REACH, 400);
        let name = which.name();
        latency.push(latencies(
            &format!("table, {name}"),
            "in contact",
            &table,
            &path,
        ));
        let points = direct.describe().points();
        let told = format!("direct, {name}, {points} points");
        latency.push(latencies(&told, "in contact", &direct, &path));
        let mut rng = SmallRng::seed_from_u64(6);
        let random = random_poses(&pair, &mut rng, angle, 0.9 * REACH, 50_000);
        let rate = throughput(&table, &random);
        many.push(described(
            &format!("{name}, in contact"),
            &table,
            rate,
            None,
        ));
    }
    Ok(latency)
}

/// Smooth in displacement and rotation, and cheap: a query's cost does not depend on the values.
struct Waves(Lattice);

impl NodeEnergies for Waves {
    type Scratch = ();

    fn scratch(&self) {}

    fn energies(&self, rotation: DQuat, _: &mut (), mut out: ArrayViewMut3<'_, f32>) {
        let wave = |phase: f64, n: usize| -> Vec<f32> {
            (0..n)
                .map(|i| (0.13 * i as f64 + phase).sin() as f32)
                .collect()
        };
        let [nx, ny, nz] = self.0.shape();
        let (x, y, z) = (
            wave(5.0 * rotation.x, nx),
            wave(5.0 * rotation.y, ny),
            wave(5.0 * rotation.z, nz),
        );
        for ((i, j, k), e) in out.indexed_iter_mut() {
            *e = x[i] * y[j] * z[k];
        }
    }
}

fn large_table(pair: &Pair, quick: bool, latency: &mut Table, many: &mut Table) -> Outcome<()> {
    let (angle, step) = if quick { (20.0, 5.0) } else { (30.0, 4.0) };
    let window = TranslationWindow::cube(0.030, 1e-3)?;
    let spec = TableSpec::for_pair(pair, &window, RotationDomain::ball(angle, step));
    let waves = Waves(spec.window);
    let table = EnergyTable::compute(spec, &waves, 8 << 30, &Silent)?;
    let mut rng = SmallRng::seed_from_u64(6);
    let count = if quick { 100_000 } else { 1_000_000 };
    let random = random_poses(pair, &mut rng, f64::to_radians(angle), 0.029, count);
    let name = "large, float16";
    let path = path_through(&random[..20], 1000);
    latency.push(latencies(name, "along a path", &table, &path));
    latency.push(latencies(name, "random", &table, &random[..20_000]));
    let rate = throughput(&table, &random);
    let streamed = stream(&table, &random)?;
    many.push(described(name, &table, rate, Some(streamed)));
    Ok(())
}

/// A row of the table of throughput; `streamed` are the times of [`stream`].
fn described(
    name: &str,
    table: &EnergyTable,
    rate: f64,
    streamed: Option<[f64; 2]>,
) -> [String; 7] {
    let [x, y, z] = table.spec().window.shape();
    let [writing, reading] = streamed.map_or([const { String::new() }; 2], |times| {
        times.map(|t| significant(t, 2))
    });
    [
        name.to_owned(),
        table.grid().nodes().len().to_string(),
        format!("{x} x {y} x {z}"),
        significant(table.memory() as f64 / 1e6, 3),
        significant(rate, 2),
        writing,
        reading,
    ]
}

/// Poses per second on all threads, in memory.
fn throughput(table: &EnergyTable, poses: &[Pose]) -> f64 {
    let mut responses = vec![Response::default(); poses.len()];
    let few = poses.len() / 10;
    table.respond_many(&poses[..few], &mut responses[..few]);
    let began = Instant::now();
    table.respond_many(poses, &mut responses);
    poses.len() as f64 / began.elapsed().as_secs_f64()
}

/// One thread's microseconds for a query with its CSV row, and for reading a pose from CSV.
fn stream(table: &EnergyTable, poses: &[Pose]) -> Outcome<[f64; 2]> {
    let poses = &poses[..poses.len().min(100_000)];
    let mut text = String::new();
    let began = Instant::now();
    for pose in poses {
        let scored = ScoredPose {
            pose: *pose,
            score_re: 0.1,
            score_im: None,
            response: table.respond(pose),
            condition: None,
        };
        append_score(&mut text, &scored);
    }
    let writing = 1e6 * began.elapsed().as_secs_f64() / poses.len() as f64;
    let text = pegfit_scene::poses::score_header(false) + &text;
    let began = Instant::now();
    let count = PoseReader::new("poses", text.as_bytes())?.count();
    let reading = 1e6 * began.elapsed().as_secs_f64() / count as f64;
    Ok([writing, reading])
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

/// A row with the quantiles of the time of one evaluation, after one pass to warm up.
fn latencies(name: &str, kind: &str, source: &dyn EnergySource, poses: &[Pose]) -> [String; 5] {
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
    let at = |q: f64| significant(micros[((micros.len() - 1) as f64 * q) as usize], 3);
    [
        name.to_owned(),
        kind.to_owned(),
        at(0.5),
        at(0.99),
        at(0.999),
    ]
}
