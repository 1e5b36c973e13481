//! Tables of the paper's pairs against the direct evaluator, and work around loops in them.

use fft_correlate::{
    AxisSymmetry, EnergyTable, Pair, Part, Pose, Response, RotationDomain, ScoreModel, TableSpec,
    TranslationWindow, Twist,
};
use glam::{DQuat, DVec3};
use pegfit_tests::{ByFft, ask, displacement, example, full_direct, rms, rotation};
use rand::{SeedableRng, rngs::SmallRng};
use sdf_grid::Silent;
use sdf_grid::shapes::PegInHole;

const H: f64 = 0.0025;
const BALL: f64 = 8.0;
const REACH: f64 = 3.0 * H;

fn table(pair: &Pair, step: f64, symmetry: Option<AxisSymmetry>) -> EnergyTable {
    let window = TranslationWindow::cube(REACH + 2.0 * H, H).expect("a window");
    let spec = TableSpec {
        model: *pair.model(),
        pivot: pair.pivot().to_array(),
        window: *window.lattice(),
        rotations: RotationDomain::ball(BALL, step),
        symmetry,
        far_energy: 0.0,
        fixed_mesh: String::new(),
        moving_mesh: String::new(),
    };
    EnergyTable::compute(spec, &ByFft::new(pair, &window), 1 << 30, &Silent).expect("a table")
}

/// Poses inside the table's domain, none of them a node.
fn held_out(pair: &Pair) -> Vec<Pose> {
    let mut rng = SmallRng::seed_from_u64(11);
    (0..200)
        .map(|_| {
            let turn = rotation(&mut rng, BALL.to_radians());
            pair.pose(turn, displacement(&mut rng, REACH))
        })
        .collect()
}

/// Errors of energy (of its range), force and torque about the pivot (of their rms), all rms.
fn errors(pair: &Pair, table: &EnergyTable, poses: &[Pose]) -> [f64; 3] {
    let source = full_direct(pair);
    let truth: Vec<Response> = poses.iter().map(|p| ask(&source, p)).collect();
    let found: Vec<Response> = poses.iter().map(|p| table.respond(p)).collect();
    let (low, high) = truth.iter().fold((f64::INFINITY, f64::NEG_INFINITY), |(a, b), r| {
        (a.min(r.energy), b.max(r.energy))
    });
    let about_pivot = |r: &Response, p: &Pose| r.wrench.about(p.rotation * pair.pivot());
    let each = |f: &dyn Fn(usize) -> f64| rms(&(0..poses.len()).map(f).collect::<Vec<_>>());
    let force = |r: &[Response], i: usize| r[i].wrench.force;
    let torque = |r: &[Response], i: usize| about_pivot(&r[i], &poses[i]).torque;
    [
        each(&|i| found[i].energy - truth[i].energy) / (high - low),
        each(&|i| (force(&found, i) - force(&truth, i)).length())
            / each(&|i| force(&truth, i).length()),
        each(&|i| (torque(&found, i) - torque(&truth, i)).length())
            / each(&|i| torque(&truth, i).length()),
    ]
}

/// A cubic interpolant between nodes 2 and 4 degrees apart, where the peg's edge moves by a
/// quarter and a half of a cell. The bounds state what such a table is good for; below them the
/// difference of correlation and quadrature under rotation remains.
#[test]
fn a_table_answers_as_the_direct_evaluator_on_poses_it_never_saw() {
    let pair = example(PegInHole::Rectangular, &ScoreModel::GUIDED, H);
    let poses = held_out(&pair);
    let coarse = errors(&pair, &table(&pair, 4.0, None), &poses);
    let fine = errors(&pair, &table(&pair, 2.0, None), &poses);
    println!("energy, force, torque at 4 degrees {coarse:?}, at 2 degrees {fine:?}");
    for (found, bound) in fine.iter().zip([0.02, 0.06, 0.12]) {
        assert!(*found < bound, "{fine:?}");
    }
    for (fine, coarse) in fine.iter().zip(coarse) {
        assert!(*fine < 1.02 * coarse, "{fine:?} {coarse:?}");
    }
}

/// The square peg's four-fold symmetry and the round peg's spin leave nodes out, not accuracy.
#[test]
fn symmetry_makes_a_table_smaller_not_worse() {
    let pair = example(PegInHole::Circular, &ScoreModel::GUIDED, H);
    let spin = AxisSymmetry {
        part: Part::Moving,
        axis: [0.0, 0.0, 1.0],
        point: [0.0; 3],
        order: 0,
    };
    let poses = held_out(&pair);
    let (whole, small) = (table(&pair, 4.0, None), table(&pair, 4.0, Some(spin)));
    let nodes = [&whole, &small].map(|t| t.grid().nodes().len());
    assert!(3 * nodes[1] < nodes[0], "{nodes:?}");
    let (a, b) = (
        errors(&pair, &whole, &poses),
        errors(&pair, &small, &poses),
    );
    println!("whole {a:?}, folded {b:?}, nodes {nodes:?}");
    assert!(b[0] < a[0] + 0.01 && b[1] < a[1] + 0.03, "{a:?} {b:?}");
}

/// Work of the table's own wrench around closed loops through the fit, by the midpoint rule. The
/// field is a gradient, so only the rule's error is left; it shrinks with the square of the step.
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
    let (low, high) = corners.iter().fold((f64::INFINITY, f64::NEG_INFINITY), |(a, b), p| {
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
    let found = [work(200), work(800)];
    println!("work around a loop, of the range of energy: {found:?}");
    assert!(found[0] < 1e-3 && found[1] < 1e-4, "{found:?}");
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
