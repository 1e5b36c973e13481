//! Error of energy, force and torque against a truth that knows no lattice, and what it costs:
//! `pareto [--quick] [--out DIR] [pair=NAME] [clearance=MM] [turned]`.
//!
//! Sweeps lattice spacing, rotation spacing, sampling scheme, storage precision of tables, and spacing, sampling and number of points of the direct evaluator, on one of the
//! pairs whose truths are kept (`truth --write`): the square peg-in-hole at zero clearance unless
//! another is named; `turned`: both parts turned together, so that no face lies along the lattice.
//! Poses are random ones, and paths in contact. Prints and writes tables, and a chart with the
//! efficient frontiers.

mod report;
mod truth;

use fft_correlate::{
    DirectEvaluator, DirectOptions, EnergyTable, Pair, PairEnergies, RotationDomain, TableSpec,
    TranslationWindow,
};
use pegfit_benches::truths::BALL;
use pegfit_benches::{Arguments, Outcome, ask, rms};
use rustix::time::{ClockId, clock_gettime};
use sdf_grid::Silent;

use report::publish;
use truth::Case;

/// Poses stay within this share of a table's window.
const INNER: f64 = 0.9;

/// How densities are put on a lattice: name, and how far they are smoothed, spacings.
const SCHEMES: [(&str, Option<f64>); 2] = [("cell averages", None), ("smoothed", Some(0.7))];

/// What is swept. The spacings are such that no face of the parts lies on a node or between cells
/// of the lattice, as in life.
struct Sweep {
    spacings_mm: &'static [f64],
    steps_deg: &'static [f64],
    points: &'static [Option<usize>],
    /// Poses are one in so many of those kept.
    every: usize,
}

const QUICK: Sweep = Sweep {
    spacings_mm: &[2.1, 1.4],
    steps_deg: &[8.0, 4.0],
    points: &[Some(5_000), None],
    every: 2,
};

const FULL: Sweep = Sweep {
    spacings_mm: &[2.1, 1.4, 0.9, 0.65],
    steps_deg: &[8.0, 4.0, 2.0],
    points: &[Some(2_000), Some(5_000), Some(20_000), Some(80_000), None],
    every: 1,
};

/// One way to answer, what it costs and how wrong it is.
struct Measured {
    kind: String,
    setting: [String; 4],
    /// Processor seconds of fields and table, on all threads together.
    bake: f64,
    /// Seconds for one random pose, on one thread.
    query: f64,
    bytes: u64,
    /// Energy, force, torque at random poses, then along the paths.
    errors: [Vec<f64>; 2],
}

impl Measured {
    /// What the frontiers are of: the rms of the errors of force and torque, at random poses and in
    /// contact.
    fn wrench(&self) -> f64 {
        rms(self.errors.iter().flat_map(|e| e[1..].iter().copied()))
    }
}

fn main() -> Outcome<()> {
    let arguments = Arguments::parse()?;
    let sweep = if arguments.quick { QUICK } else { FULL };
    let case = Case::read(&arguments.rest, sweep.every)?;
    let mut found = Vec::new();
    for &mm in sweep.spacings_mm {
        for (scheme, smoothing) in SCHEMES {
            eprintln!("{mm} mm, {scheme}");
            let (pair, fields) = charged(|| case.build(mm, smoothing));
            let base = [format!("{mm}"), scheme.to_owned()];
            let pair = pair?;
            for points in sweep.points {
                found.push(direct(&case, &pair, fields, &base, *points)?);
            }
            for &step in sweep.steps_deg {
                found.push(table(&case, &pair, fields, &base, step)?);
            }
        }
    }
    publish(&found, &case.title, &case.uncertainty, &arguments)
}

/// The result of `work` and the processor seconds it took, on all threads together: unlike the time
/// that passed, they hardly depend on what else the machine does.
fn charged<T>(work: impl FnOnce() -> T) -> (T, f64) {
    let now = || {
        let at = clock_gettime(ClockId::ProcessCPUTime);
        at.tv_sec as f64 + 1e-9 * at.tv_nsec as f64
    };
    let began = now();
    let result = work();
    (result, now() - began)
}

fn direct(
    case: &Case,
    pair: &Pair,
    fields: f64,
    base: &[String; 2],
    points: Option<usize>,
) -> Outcome<Measured> {
    let options = match points {
        None => DirectOptions::FULL,
        max_points => DirectOptions {
            max_points,
            ..DirectOptions::REAL_TIME
        },
    };
    let source = DirectEvaluator::new(pair, &options)?;
    let (query, errors) = case.compare(|pose| ask(&source, pose));
    let [mm, scheme] = base.clone();
    let number = format!("{} points", source.describe().points());
    Ok(Measured {
        kind: match points {
            None => "direct, every cell".into(),
            Some(_) => "direct, merged".into(),
        },
        setting: [mm, scheme, String::new(), number],
        bake: fields,
        query,
        bytes: source.describe().bytes,
        errors,
    })
}

/// A table.
fn table(
    case: &Case,
    pair: &Pair,
    fields: f64,
    base: &[String; 2],
    step: f64,
) -> Outcome<Measured> {
    let window = TranslationWindow::cube(case.reach() / INNER, pair.spacing())?;
    let energies = PairEnergies::plan(pair, &window)?;
    let spec = TableSpec::for_pair(pair, &window, RotationDomain::ball(BALL / INNER, step));
    let (table, seconds) = charged(|| EnergyTable::compute(spec, &energies, 4 << 30, &Silent));
    let table = table?;
    let [mm, scheme] = base.clone();
    let (query, errors) = case.compare(|pose| table.respond(pose));
    Ok(Measured {
        kind: "table".into(),
        setting: [mm, scheme, format!("{step}"), "float16".into()],
        bake: fields + seconds,
        query,
        bytes: table.memory(),
        errors,
    })
}
