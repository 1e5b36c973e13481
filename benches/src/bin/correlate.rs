//! Time per rotation of the correlator by stage, its error, and the same work done by others:
//! `correlate [--quick] [--out DIR] [fftw] [N...]`.
//!
//! For each N a made-up pair whose transforms have N points along each axis. `half`: a moving part
//! and a window of N/2 along each axis, a fixed part without end. `full`: both parts N/2, all N - 1
//! displacements at which they meet. Rotations one by one, and, as in a search or a table of all
//! rotations, four at once that differ by half turns: all times are of one. Beside it, in the same
//! run, the same product of complex fields with plain rustfft, and with FFTW if `fftw` is given (a
//! C program, compiled with `cc`; its library must be installed), neither pruned and neither with
//! resampling.

use std::path::Path;
use std::process::Command;
use std::sync::Arc;
use std::time::Instant;

use fft_correlate::correlate::{
    CorrelatorPlan, CorrelatorScratch, HalfTurn, PairSupport, StageTimes,
};
use fft_correlate::{Correlator, Pair, PairBuilder, ScoreModel, TranslationWindow};
use glam::{DQuat, DVec3};
use ndarray::Array3;
use num_complex::{Complex, Complex32};
use pegfit_benches::table::{Table, significant};
use pegfit_benches::{Arguments, Outcome, plain, rms};
use rand::rngs::SmallRng;
use rand::{Rng, SeedableRng};
use sdf_grid::shapes::PegInHole;
use sdf_grid::{DensityField, FIELD_VERSION, FieldProvenance, Lattice, Sampling, Silent};

const SIZES: [usize; 6] = [64, 96, 128, 160, 192, 256];

fn main() -> Outcome<()> {
    let arguments = Arguments::parse()?;
    let mut sizes: Vec<usize> = arguments
        .rest
        .iter()
        .filter_map(|w| w.parse().ok())
        .collect();
    if sizes.is_empty() {
        sizes = SIZES[..if arguments.quick { 3 } else { 6 }].to_vec();
    }
    let seconds = if arguments.quick { 0.3 } else { 1.0 };
    let mut table = Table::new(
        "correlate",
        "One rotation's scores: time per stage",
        ABOUT,
        &COLUMNS,
    );
    for n in sizes {
        let fftw = if arguments.rest.iter().any(|w| w == "fftw") {
            Some(fftw(&arguments.out, n, seconds)?)
        } else {
            None
        };
        let rustfft = plain_seconds(n, seconds);
        eprintln!("N = {n}");
        for case in ["half", "full"] {
            for row in measure(n, case, seconds, rustfft, fftw, arguments.quick)? {
                table.push(row.cells());
            }
        }
    }
    arguments.publish(&table, None)?;
    arguments.publish(&smoothed(seconds)?, None)
}

/// What smoothing costs: wider densities, read from more nodes.
fn smoothed(seconds: f64) -> Outcome<Table> {
    let mut table = Table::new(
        "correlate-smoothed",
        "Smoothed densities beside cell averages",
        "Milliseconds per rotation, one by one, of the paper's pairs at the default spacing, with \
         windows of so many displacements along each axis; `a` of cell averages, read from 8 nodes, \
         `s` of smoothed densities, read from 27, as energies are computed.",
        &[
            "pair",
            "window",
            "points, a",
            "points, s",
            "a",
            "s",
            "s / a",
            "resample, a",
            "resample, s",
        ],
    );
    for which in PegInHole::ALL {
        let (hole, peg) = which.pair(0.0)?;
        let pairs = [None, PairBuilder::default().smoothing].map(|smoothing| {
            let builder = PairBuilder {
                smoothing,
                ..PairBuilder::default()
            };
            builder.build(&hole, &peg, &ScoreModel::GUIDED, &Silent)
        });
        for nodes in [9, 25] {
            let mut found = Vec::new();
            for pair in &pairs {
                let pair = pair.as_ref().map_err(|e| e.to_string())?;
                let half = 0.5 * (nodes - 1) as f64 * pair.spacing();
                let window = TranslationWindow::cube(half, pair.spacing())?;
                let plan = CorrelatorPlan::new(&PairSupport::of(pair)?, &window)?;
                let correlator = Correlator::build(&plan, pair)?;
                let (stages, total) = timed(&correlator, &window, 1, 1, seconds);
                found.push((plan.transform_size, stages.resample, total));
            }
            let [(points, first, before), (wider, then, after)] = found[..] else {
                unreachable!("two pairs");
            };
            let by = |[x, y, z]: [usize; 3]| format!("{x} x {y} x {z}");
            let ms = |v: f64| significant(1e3 * v, 3);
            table.push([
                which.name().to_owned(),
                nodes.to_string(),
                by(points),
                by(wider),
                ms(before),
                ms(after),
                significant(after / before, 3),
                ms(first),
                ms(then),
            ]);
        }
    }
    Ok(table)
}

const ABOUT: &str = "Milliseconds per rotation: resampling the turned moving fields, transforms \
    forward, products with the fixed spectra, transforms back; `total` is the mean over rotations \
    and threads, the stages are those of the fastest round. Transforms have N points along each \
    axis. `half`: moving part and window N/2. `full`: both parts N/2, all displacements at which \
    they meet. `at once`: rotations scored one by one, or four that differ by half turns. \
    `planned` is what the plan expected. `x rustfft`, `x FFTW`: our total, resampling included, \
    over the time of the same product with unpruned transforms of complex fields, without \
    resampling, on one thread (FFTW only where the page was made with `fftw`). `error`: relative \
    L2 distance from double precision.";

const COLUMNS: [&str; 14] = [
    "N",
    "case",
    "threads",
    "at once",
    "resample",
    "forward",
    "product",
    "inverse",
    "total",
    "planned",
    "ns per point",
    "x rustfft",
    "x FFTW",
    "error",
];

/// One line of the table.
struct Row {
    n: usize,
    case: &'static str,
    threads: usize,
    /// Rotations scored together.
    at_once: usize,
    /// Of one rotation on one thread; with two threads both at once.
    stages: StageTimes,
    /// Per rotation, seconds.
    total: f64,
    planned: f64,
    rustfft: f64,
    fftw: Option<f64>,
    error: Option<f64>,
}

impl Row {
    fn cells(&self) -> [String; 14] {
        let s = self.stages;
        let ms = |v: f64| significant(1e3 * v, 2);
        let maybe = |v: Option<f64>| v.map_or(String::new(), |v| significant(v, 2));
        [
            self.n.to_string(),
            self.case.to_owned(),
            self.threads.to_string(),
            self.at_once.to_string(),
            ms(s.resample),
            ms(s.forward),
            ms(s.product),
            ms(s.inverse),
            ms(self.total),
            ms(self.planned),
            significant(1e9 * self.total / (self.n as f64).powi(3), 2),
            significant(self.total / self.rustfft, 2),
            maybe(self.fftw.map(|theirs| self.total / theirs)),
            maybe(self.error),
        ]
    }
}

/// Our times on one and two threads; the error against double precision up to N = 128.
fn measure(
    n: usize,
    case: &'static str,
    seconds: f64,
    rustfft: f64,
    fftw: Option<f64>,
    quick: bool,
) -> Outcome<Vec<Row>> {
    let (pair, window) = scene(n, case)?;
    let support = PairSupport::of(&pair)?;
    let one = Correlator::build(&CorrelatorPlan::new(&support, &window)?, &pair)?;
    let four = Correlator::build(&CorrelatorPlan::for_half_turns(&support, &window)?, &pair)?;
    let mut rows = Vec::new();
    for (correlator, at_once) in [(one, 1), (four, 4)] {
        let plan = correlator.plan();
        if plan.transform_size != [n; 3] || plan.shares_half_turns != (at_once > 1) {
            return Err(format!("N = {n}, {case}: planned {plan}").into());
        }
        let error = if n <= if quick { 64 } else { 128 } {
            Some(error(&correlator, &pair, &window, at_once)?)
        } else {
            None
        };
        for threads in [1, 2] {
            let (stages, total) = timed(&correlator, &window, threads, at_once, seconds);
            rows.push(Row {
                n,
                case,
                threads,
                at_once,
                stages,
                total,
                planned: plan.expected_seconds,
                rustfft,
                fftw,
                error,
            });
        }
    }
    Ok(rows)
}

/// A rotation that favours no axis.
fn turn(k: usize) -> DQuat {
    DQuat::from_scaled_axis(DVec3::new(0.3, -0.8, 0.5) * (1.0 + 0.37 * k as f64))
}

/// Scores the `k`th rotation, and with more than one output the half turns that follow it.
fn score(
    correlator: &Correlator,
    k: usize,
    scratch: &mut CorrelatorScratch,
    outs: &mut [Array3<f32>],
) {
    match outs {
        [out] => correlator.score(turn(k), scratch, out.view_mut()),
        [a, b, c, d] => {
            let outs = &mut [a.view_mut(), b.view_mut(), c.view_mut(), d.view_mut()];
            correlator.score_half_turns(turn(k), &HalfTurn::ALL, scratch, outs);
        }
        _ => unreachable!("one output or four"),
    }
}

/// Relative L2 distance of the scores from those in double precision, one by one.
fn error(
    correlator: &Correlator,
    pair: &Pair,
    window: &TranslationWindow,
    at_once: usize,
) -> Outcome<f64> {
    let exact = Correlator::build_double(correlator.plan(), pair)?;
    let mut scratch = exact.scratch();
    let mut found = vec![Array3::zeros(window.shape()); at_once];
    score(correlator, 1, &mut correlator.scratch(), &mut found);
    let mut worst = 0f64;
    for (half, found) in HalfTurn::ALL.iter().zip(&found) {
        let mut truth = Array3::zeros(window.shape());
        exact.score(half.rotation() * turn(1), &mut scratch, truth.view_mut());
        let wrong = found.iter().zip(&truth).map(|(a, b)| f64::from(*a) - b);
        worst = worst.max(rms(wrong) / rms(truth.iter().copied()));
    }
    Ok(worst)
}

/// The stages of the fastest rotation, and seconds per rotation over all threads: the fastest of
/// several rounds. `at_once` rotations per thread at a time.
fn timed(
    correlator: &Correlator,
    window: &TranslationWindow,
    threads: usize,
    at_once: usize,
    seconds: f64,
) -> (StageTimes, f64) {
    let mut work: Vec<(CorrelatorScratch, Vec<Array3<f32>>)> = (0..threads)
        .map(|_| {
            let outs = vec![Array3::zeros(window.shape()); at_once];
            (correlator.scratch(), outs)
        })
        .collect();
    let (mut stages, mut best) = (StageTimes::default(), f64::INFINITY);
    let (began, mut per_round) = (Instant::now(), 1);
    while began.elapsed().as_secs_f64() < seconds || best.is_infinite() {
        let round = Instant::now();
        std::thread::scope(|scope| {
            for (scratch, outs) in &mut work {
                scope.spawn(move || {
                    (0..per_round).for_each(|k| score(correlator, k, scratch, outs))
                });
            }
        });
        let took = round.elapsed().as_secs_f64();
        let each = took / (per_round * threads * at_once) as f64;
        // Rounds long enough that starting threads does not count.
        if took < 0.02 {
            per_round *= 2;
            continue;
        }
        if each < best {
            best = each;
            stages = per_rotation(work[0].0.stage_times(), at_once);
        }
    }
    (stages, best)
}

fn per_rotation(of_all: StageTimes, at_once: usize) -> StageTimes {
    let share = 1.0 / at_once as f64;
    StageTimes {
        resample: share * of_all.resample,
        forward: share * of_all.forward,
        product: share * of_all.product,
        inverse: share * of_all.inverse,
    }
}

/// A moving ball and a fixed block of noise, with separation weight one (one product).
fn scene(n: usize, case: &str) -> Outcome<(Pair, TranslationWindow)> {
    let mut rng = SmallRng::seed_from_u64(n as u64);
    let half = n as f64 / 2.0;
    let reach = if case == "half" { half } else { half / 2.0 };
    // The corners of the last cells stay within the quarter of N that the support may fill.
    let moving = noise(half / 2.0 - 1.74, true, &mut rng)?;
    let fixed = noise(reach, false, &mut rng)?;
    let pair = Pair::new(
        Arc::new(fixed),
        Arc::new(moving),
        ScoreModel::PAPER,
        DVec3::ZERO,
    )?;
    let (first, last) = if case == "half" {
        (-half / 2.0, half / 2.0 - 1.0)
    } else {
        (1.0 - half, half - 1.0)
    };
    Ok((
        pair,
        TranslationWindow::new(DVec3::splat(first), DVec3::splat(last), 1.0)?,
    ))
}

/// Noise in a ball, or in the cube around it; cells are of unit size.
fn noise(radius: f64, ball: bool, rng: &mut SmallRng) -> Outcome<DensityField> {
    let nodes = 2 * radius.floor() as usize;
    let origin = DVec3::splat(0.5 - radius.floor());
    let lattice = Lattice::new(origin, 1.0, [nodes; 3])?;
    let exterior = Array3::from_shape_fn([nodes; 3], |(i, j, k)| {
        if !ball || lattice.position([i, j, k]).length() <= radius {
            Complex32::new(rng.random_range(-1.0..1.0), rng.random_range(-1.0..1.0))
        } else {
            Complex32::default()
        }
    });
    Ok(DensityField {
        interior: Array3::zeros([nodes; 3]),
        signed_distance: Array3::zeros([nodes; 3]),
        exterior,
        provenance: FieldProvenance {
            version: FIELD_VERSION,
            mesh: String::new(),
            sigma: ScoreModel::PAPER.sigma,
            halo: 1.0,
            tolerance: 1e-3,
            sampling: Sampling::Point,
            lattice,
        },
    })
}

/// Seconds of the fastest plain rustfft correlation of complex fields.
fn plain_seconds(n: usize, seconds: f64) -> f64 {
    let mut rng = SmallRng::seed_from_u64(1);
    let mut field = || {
        Array3::from_shape_simple_fn([n; 3], || {
            Complex::new(rng.random_range(-1.0f32..1.0), rng.random_range(-1.0..1.0))
        })
    };
    let (spectra, moving) = (vec![field()], field());
    let (began, mut best) = (Instant::now(), f64::INFINITY);
    while began.elapsed().as_secs_f64() < seconds || best.is_infinite() {
        let moving = vec![moving.clone()];
        let round = Instant::now();
        std::hint::black_box(plain::correlate(&spectra, moving));
        best = best.min(round.elapsed().as_secs_f64());
    }
    best
}

/// Seconds of the faster of FFTW's complex and real loops.
fn fftw(out: &Path, n: usize, seconds: f64) -> Outcome<f64> {
    let source = Path::new(env!("CARGO_MANIFEST_DIR")).join("peers/fftw/correlate.c");
    let program = out
        .join("fftw-correlate")
        .canonicalize()
        .unwrap_or_default();
    let program = if program.is_file() {
        program
    } else {
        let program = out.canonicalize()?.join("fftw-correlate");
        let done = Command::new("cc")
            .args(["-O3", "-march=native", "-o"])
            .arg(&program)
            .arg(source)
            .args(["-lfftw3f", "-lm"])
            .status()?;
        if !done.success() {
            return Err("cc could not build the FFTW program; is libfftw3 installed?".into());
        }
        program
    };
    let output = Command::new(program)
        .args([seconds.to_string(), n.to_string()])
        .output()?;
    let text = String::from_utf8(output.stdout)?;
    let times: Vec<f64> = text
        .split_whitespace()
        .skip(1)
        .flat_map(str::parse)
        .collect();
    let best = times.into_iter().reduce(f64::min);
    best.map(|ms| 1e-3 * ms)
        .ok_or_else(|| "FFTW's program printed no time".into())
}
