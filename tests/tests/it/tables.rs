//! Tables of the paper's pairs, baked to disk and read back, against the direct evaluator, and work
//! around loops in them.

use fft_correlate::{
    AxisSymmetry, EnergyTable, ErrorReport, Pair, PairEnergies, RotationDomain, ScoreModel, Share,
    Side, TableSpec, TableStore, TranslationWindow, Twist, bake, measure_error,
};
use glam::{DQuat, DVec3};
use pegfit_tests::{displacement, example, full_direct, rotation};
use rand::{SeedableRng, rngs::SmallRng};
use sdf_grid::Silent;
use sdf_grid::shapes::PegInHole;

const H: f64 = 0.0025;
const BALL: f64 = 8.0;
const REACH: f64 = 4.0 * H;
const POSES: usize = 200;
const SEED: u64 = 11;

/// A table on disk, in a folder that goes with it.
fn baked(
    pair: &Pair,
    step: f64,
    symmetry: Option<AxisSymmetry>,
) -> (TableStore, tempfile::TempDir) {
    let window = TranslationWindow::cube(REACH, H).expect("a window");
    let spec = TableSpec {
        symmetry,
        ..TableSpec::for_pair(pair, &window, RotationDomain::ball(BALL, step))
    };
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path().join("table.zarr");
    let energies = PairEnergies::plan(pair, &window).expect("a plan");
    let report = bake(&path, &spec, &energies, Share::ALL, &Silent).expect("a bake");
    assert_eq!(report.computed, report.rotations);
    (TableStore::open(&path).expect("the table baked"), folder)
}

fn table(pair: &Pair, step: f64, symmetry: Option<AxisSymmetry>) -> EnergyTable {
    let (store, _folder) = baked(pair, step, symmetry);
    store.load(1 << 30).expect("a whole table")
}

/// Root mean square errors of energy, force and torque, each of its own root mean square.
fn relative(report: &ErrorReport) -> [f64; 3] {
    [&report.energy, &report.force, &report.torque].map(|e| e.rms / e.scale)
}

/// Nodes 2 and 4 degrees apart, where the peg's edge moves by a quarter and by half a cell.
/// Held-out poses fill the whole domain. The bounds say what a table on 8 cells across the peg is
/// good for.
/// The report kept with the table is what a second measurement finds.
#[test]
fn a_table_answers_as_the_direct_evaluator_on_poses_it_never_saw() {
    let pair = example(PegInHole::Rectangular, &ScoreModel::GUIDED, H);
    let source = full_direct(&pair);
    let [coarse, fine] = [4.0, 2.0].map(|step| {
        let (mut store, _folder) = baked(&pair, step, None);
        let measured = measure_error(&store.load(1 << 30).expect("whole"), &source, POSES, SEED);
        store.write_error_report(&measured).expect("a report");
        let again = TableStore::open(store.path()).expect("the same table");
        let stored = again.error_report().expect("a report was stored").clone();
        let table = again.load(1 << 30).expect("whole");
        let second = measure_error(&table, &source, stored.poses, stored.seed);
        for (a, b) in relative(&stored).iter().zip(relative(&second)) {
            assert!((a - b).abs() < 1e-9 * b, "{stored:?} {second:?}");
        }
        relative(&measured)
    });
    println!("energy, force, torque at 4 degrees {coarse:?}, at 2 degrees {fine:?}");
    for (found, bound) in fine.iter().zip([0.01, 0.04, 0.08]) {
        assert!(*found < bound, "{fine:?}");
    }
    for (fine, coarse) in fine.iter().zip(coarse) {
        // Torque is what the step between displacements leaves, whatever the rotations': it varies
        // with the poses held out.
        assert!(*fine < 1.1 * coarse, "{fine:?} {coarse:?}");
    }
}

/// The round peg's spin leaves nodes out, not accuracy.
#[test]
fn symmetry_makes_a_table_smaller_not_worse() {
    let pair = example(PegInHole::Circular, &ScoreModel::GUIDED, H);
    let source = full_direct(&pair);
    let spin = AxisSymmetry {
        part: Side::Moving,
        axis: [0.0, 0.0, 1.0],
        point: [0.0; 3],
        order: 0,
    };
    let tables = [None, Some(spin)].map(|s| table(&pair, 4.0, s));
    let nodes = tables.each_ref().map(|t| t.grid().nodes().len());
    assert!(3 * nodes[1] < nodes[0], "{nodes:?}");
    let [a, b] = tables.map(|t| relative(&measure_error(&t, &source, POSES, SEED)));
    println!("whole {a:?}, folded {b:?}, nodes {nodes:?}");
    assert!(b[0] < a[0] + 0.01 && b[1] < a[1] + 0.03, "{a:?} {b:?}");
}

/// Work of the table's own wrench around closed loops through the fit, by the midpoint rule. The
/// field is a gradient, so only the rule's error is left; it shrinks with the step, to and fro where
/// samples pass edges (3e-4, 4e-5, 1e-4, 2e-5, 4e-6 from 200 steps to 3200).
#[test]
fn a_loop_through_a_table_gives_back_its_work() {
    let pair = example(PegInHole::Rectangular, &ScoreModel::GUIDED, H);
    let table = table(&pair, 4.0, None);
    let mut rng = SmallRng::seed_from_u64(5);
    let corners: Vec<_> = (0..5)
        .map(|_| {
            let turn = rotation(&mut rng, BALL.to_radians());
            pair.pose(turn, displacement(&mut rng, REACH))
        })
        .collect();
    let (low, high) = corners
        .iter()
        .fold((f64::INFINITY, f64::NEG_INFINITY), |(a, b), p| {
            let e = table.respond(p).energy;
            (a.min(e), b.max(e))
        });
    let work = |steps: usize| -> f64 {
        let mut work = 0.0;
        for (a, b) in corners.iter().zip(corners.iter().cycle().skip(1)) {
            let whole = a.twist_to(b);
            let at = |s: f64| {
                a.perturbed(&Twist {
                    angular: s * whole.angular,
                    linear: s * whole.linear,
                })
            };
            for i in 0..steps {
                let s = |offset: f64| (i as f64 + offset) / steps as f64;
                let (from, to) = (at(s(0.0)), at(s(1.0)));
                let wrench = table.respond(&at(s(0.5))).wrench;
                work += wrench.dot(&from.twist_to(&to));
            }
        }
        work.abs() / (high - low)
    };
    let found = [work(200), work(3200)];
    println!("work around a loop, of the range of energy: {found:?}");
    assert!(found[0] < 1e-3 && found[1] < 2e-5, "{found:?}");
}

/// The quaternion's sign and poses far away through a real table.
#[test]
fn a_table_fades_outside_its_window() {
    let pair = example(PegInHole::Rectangular, &ScoreModel::GUIDED, H);
    let table = table(&pair, 4.0, None);
    let far = table.respond(&pair.pose(DQuat::IDENTITY, DVec3::X * 0.1));
    assert_eq!((far.energy, far.coverage), (0.0, 0.0));
    let fit = table.respond(&pair.pose(DQuat::IDENTITY, DVec3::ZERO));
    assert_eq!(fit.coverage, 1.0);
    assert!(fit.energy < 0.0);
}
