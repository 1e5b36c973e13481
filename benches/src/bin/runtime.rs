//! What a tick of the haptic loop costs, without the field and against the number of parts:
//! `runtime [--quick] [--out DIR]`.

use std::sync::Arc;
use std::sync::atomic::AtomicBool;
use std::time::Instant;

use fft_correlate::{
    DirectEvaluator, DirectOptions, EnergySource, Placement, Pose, Response, ScoreModel, Scratch,
    Wrench,
};
use glam::DVec3;
use haptic::{
    Clock, Device, ForcePath, Geometry, HapticConfig, LiveSource, OperatorConfig, PlacedSource,
    Script, Session, SharedSource, SimulatedOperator, SumSource, Workspace,
};
use pegfit_benches::table::{Table, significant};
use pegfit_benches::{Arguments, Outcome, example};
use sdf_grid::Aabb;
use sdf_grid::shapes::PegInHole;

/// Quadrature points of a pair: a part among many gets few.
const POINTS: usize = 1_000;

/// Metres between parts that stand apart.
const APART: f64 = 0.2;

/// A field that costs nothing: a bowl.
struct Bowl;

impl EnergySource for Bowl {
    fn scratch(&self) -> Scratch {
        Scratch::default()
    }

    fn evaluate(&self, pose: &Pose, _: &mut Scratch) -> Response {
        let p = pose.translation;
        Response {
            energy: 50.0 * p.length_squared(),
            wrench: Wrench {
                torque: DVec3::ZERO,
                force: p * -100.0,
            },
            coverage: 1.0,
        }
    }
}

fn main() -> Outcome<()> {
    let arguments = Arguments::parse()?;
    let ticks = if arguments.quick { 4_000 } else { 20_000 };
    arguments.publish(&overhead(ticks)?, None)?;
    let pair = example(PegInHole::Rectangular, &ScoreModel::GUIDED, 2.5e-3)?;
    let options = DirectOptions {
        max_points: Some(POINTS),
        ..DirectOptions::REAL_TIME
    };
    let source = SharedSource::new(Arc::new(DirectEvaluator::new(&pair, &options)?));
    let counts = [1usize, 2, 4, 8, 16, 32, 64];
    let mut table = Table::new(
        "parts",
        "A tick against the number of parts",
        "Microseconds of a tick of the force path with its evaluations of the field, median and \
         99 of 100, for scenes of many parts of which some are in range of the hand; each in \
         range is evaluated directly with about 1000 points. The hand's own physics is left out.",
        &["in range", "parts", "median, µs", "p99, µs"],
    );
    for in_range in [1, 4, 16, 64] {
        for parts in counts.into_iter().filter(|n| *n >= in_range) {
            let sum = scene(&source, parts, in_range);
            let [median, p99] = tick_times(&sum, ticks / in_range.min(8))?;
            let times = [median, p99].map(|ns| significant(1e-3 * ns, 3));
            table.push(
                [in_range, parts]
                    .map(|n| n.to_string())
                    .into_iter()
                    .chain(times),
            );
        }
    }
    arguments.publish(&table, None)
}

/// `parts` parts, of which `in_range` stand where the hand is and the rest in a row.
fn scene(source: &SharedSource, parts: usize, in_range: usize) -> SumSource {
    let placed = (0..parts).map(|k| {
        let away = k.saturating_sub(in_range - 1) as f64 * APART;
        PlacedSource {
            source: Some(source.clone()),
            placement: Placement::of_fixed(Pose::from_translation(DVec3::new(away, 0.0, 0.0))),
            reach: Some(Aabb {
                min: DVec3::splat(-0.05),
                max: DVec3::splat(0.05),
            }),
        }
    });
    SumSource::new(DVec3::ZERO, placed.collect())
}

fn hand() -> (SimulatedOperator, Workspace) {
    let geometry = Geometry {
        seated: Pose::IDENTITY,
        axis: DVec3::NEG_Z,
        depth: 0.02,
        radius: 0.006,
        tilt: 0.05,
    };
    let workspace = Workspace::new(1.0, Pose::IDENTITY, DVec3::ZERO);
    let hand = SimulatedOperator::new(OperatorConfig::default(), Script::Snap, geometry, workspace);
    (hand, workspace)
}

/// Nanoseconds of a tick of the force path with its evaluations, median and 99 of 100; the hand's
/// own physics is left out.
fn tick_times(source: &dyn EnergySource, ticks: usize) -> Outcome<[f64; 2]> {
    let (mut hand, workspace) = hand();
    let config = HapticConfig::default();
    let mut path = ForcePath::new(hand.spec(), &config, workspace, source.scratch())?;
    let period = config.period();
    let mut times = Vec::with_capacity(ticks);
    for tick in 0..ticks {
        let now = tick as f64 * period;
        let input = hand.poll(now)?;
        let began = Instant::now();
        let sample = path.step(source, Some(&input), now, period);
        times.push(began.elapsed().as_secs_f64() * 1e9);
        hand.send(&sample.wrench)?;
    }
    times.sort_by(f64::total_cmp);
    Ok([times[ticks / 2], times[ticks * 99 / 100]])
}

/// A tick without the field's cost: the force path alone, through a scene that may be exchanged,
/// and the whole loop with and without a log.
fn overhead(ticks: usize) -> Outcome<Table> {
    let mut table = Table::new(
        "tick",
        "A tick without the field",
        "Microseconds of a tick, median and 99 of 100, of a field that costs nothing: gate, \
         coupling, passivity and limits (the force path); the same through a scene whose parts \
         may be exchanged; the whole loop with the simulated hand, without and with a log.",
        &["what", "median, µs", "p99, µs"],
    );
    let mut add = |name: &str, ns: [f64; 2]| {
        let times = ns.map(|t| significant(1e-3 * t, 3));
        table.push(std::iter::once(name.to_owned()).chain(times));
    };
    add("force path", tick_times(&Bowl, ticks)?);
    let placed = PlacedSource {
        source: Some(SharedSource::new(Arc::new(Bowl))),
        placement: Placement::IDENTITY,
        reach: None,
    };
    let sum = SumSource::new(DVec3::ZERO, vec![placed]);
    let live = LiveSource::new(sum, &Pose::IDENTITY);
    add("force path, scene of one part", tick_times(&live, ticks)?);
    let folder = std::env::temp_dir().join(format!("pegfit-runtime-{}.csv", std::process::id()));
    for log in [false, true] {
        let (mut hand, workspace) = hand();
        let session = Session::new(HapticConfig::default(), workspace);
        let session = match log {
            true => session.record_to(&folder),
            false => session,
        };
        let stop = AtomicBool::new(false);
        let seconds = ticks as f64 * 1e-3;
        let outcome = session.run(&mut hand, &Bowl, Clock::Simulated, seconds, &stop)?;
        let q = outcome.report.latency_us;
        let name = ["loop, simulated hand", "loop, simulated hand, log"][usize::from(log)];
        add(name, [1e3 * q.p50, 1e3 * q.p99]);
    }
    std::fs::remove_file(folder)?;
    Ok(table)
}
