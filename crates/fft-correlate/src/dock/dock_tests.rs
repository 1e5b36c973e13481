use std::f64::consts::{FRAC_PI_6, PI};
use std::sync::LazyLock;
use std::sync::atomic::{AtomicU64, Ordering};

use glam::{DVec2, DVec3};
use sdf_grid::{Silent, shapes};

use super::*;
use crate::{DirectEvaluator, DirectOptions, PairBuilder, ScoreModel};

const H: f64 = 1e-3;

/// A rectangular rod of 8 x 12 x 10 mm in a plate of the same thickness with a hole that fits; the
/// rod modelled away from its place by `off`, so that the seated pose is the inverse of `off`.
fn pair(off: Pose) -> Pair {
    let rectangle = |x: f64, y: f64| {
        [(-x, -y), (x, -y), (x, y), (-x, y)].map(|(x, y)| DVec2::new(x, y) * 0.5e-3)
    };
    let (rod, plate) = (rectangle(8.0, 12.0), rectangle(28.0, 32.0));
    let plate = shapes::prism(&plate, &[rod.to_vec()], 0.01).unwrap();
    let rod = shapes::prism(&rod, &[], 0.01).unwrap();
    let rod = rod.transformed(off.rotation, off.translation);
    let builder = PairBuilder {
        spacing: Some(H),
        halo: Some(6e-3),
        ..PairBuilder::default()
    };
    builder
        .build(&plate, &rod, &ScoreModel::GUIDED, &Silent)
        .unwrap()
}

/// The pair modelled in place, computed once.
fn seated() -> &'static Pair {
    static PAIR: LazyLock<Pair> = LazyLock::new(|| pair(Pose::IDENTITY));
    &PAIR
}

fn spins() -> Vec<DQuat> {
    (0..12)
        .map(|n| DQuat::from_rotation_z(n as f64 * FRAC_PI_6))
        .collect()
}

fn window() -> TranslationWindow {
    TranslationWindow::cube(4.0 * H, H).unwrap()
}

#[test]
fn the_rod_finds_its_hole_and_its_half_turn() {
    let pair = seated();
    let mut options = DockOptions::new(pair, 2);
    let found = dock(pair, &spins(), &window(), &options, None, &Silent).unwrap();
    assert_eq!(
        (found.scored, found.rotations, found.poses.len()),
        (12, 12, 2)
    );
    // The two are equally deep but for rounding.
    let mut poses = found.poses.clone();
    poses.sort_by_key(|pose| pose.rotation);
    for (pose, seated) in poses.iter().zip([0.0, PI]) {
        let expected = Pose::new(DQuat::from_rotation_z(seated), DVec3::ZERO);
        assert!(pose.pose.angle_to(&expected) < 1e-9, "{pose:?}");
        assert!(pair.displacement(&pose.pose).length() < 1e-12, "{pose:?}");
        assert!(pose.energy < 0.0 && !pose.refined && pose.half_width < 6.0 * H);
    }
    let [a, b] = [found.poses[0].energy, found.poses[1].energy];
    assert!((a - b).abs() < 1e-4 * a.abs(), "{a} {b}");

    options.spacing.symmetries = vec![Pose::new(DQuat::from_rotation_z(PI), DVec3::ZERO)];
    let found = dock(pair, &spins(), &window(), &options, None, &Silent).unwrap();
    assert!(
        found.poses[1].energy > 0.9 * a,
        "the half turn is the same pose: {found:?}"
    );
}

#[test]
fn refinement_finds_a_pose_between_lattice_and_rotations() {
    let off = Pose::new(DQuat::from_rotation_z(0.07), DVec3::new(0.4, -0.3, 0.2) * H);
    let pair = &pair(off);
    let source = DirectEvaluator::new(pair, &DirectOptions::FULL).unwrap();
    let options = DockOptions::new(pair, 2);
    let found = dock(pair, &spins(), &window(), &options, Some(&source), &Silent).unwrap();
    let best = &found.poses[0];
    assert!(
        best.refined && best.energy <= best.lattice_energy * 0.95,
        "{best:?}"
    );
    let seated = [0.0, PI].map(|turn| Pose::new(DQuat::from_rotation_z(turn), DVec3::ZERO));
    let seated = seated.map(|half| half * off.inverse());
    let miss = |s: &Pose| {
        let distance = (s.apply(pair.pivot()) - best.pose.apply(pair.pivot())).length();
        (distance, s.angle_to(&best.pose))
    };
    let (distance, angle) = seated
        .iter()
        .map(miss)
        .min_by(|a, b| a.1.total_cmp(&b.1))
        .unwrap();
    // The lattice resolves the rod to a fraction of a cell, 7 cells from the axis.
    assert!(
        distance < 0.3 * H && angle < 0.03,
        "{distance} m, {angle} rad"
    );
}

#[test]
fn the_result_does_not_depend_on_the_number_of_threads() {
    let pair = seated();
    let options = DockOptions::new(pair, 5);
    let with = |threads| {
        let pool = rayon::ThreadPoolBuilder::new()
            .num_threads(threads)
            .build()
            .unwrap();
        pool.install(|| dock(pair, &spins(), &window(), &options, None, &Silent).unwrap())
    };
    assert_eq!(with(1), with(3));
}

/// Cancels after a number of rotations.
struct Impatient {
    after: u64,
    seen: AtomicU64,
}

impl Monitor for Impatient {
    fn advance(&self, steps: u64) {
        self.seen.fetch_add(steps, Ordering::Relaxed);
    }

    fn cancelled(&self) -> bool {
        self.seen.load(Ordering::Relaxed) >= self.after
    }
}

#[test]
fn a_cancelled_search_keeps_what_it_has() {
    let pair = seated();
    let options = DockOptions::new(pair, 3);
    let run = |after| {
        let monitor = Impatient {
            after,
            seen: AtomicU64::new(0),
        };
        dock(pair, &spins(), &window(), &options, None, &monitor)
    };
    assert_eq!(run(0), Err(DockError::Cancelled));
    let part = run(2).unwrap();
    assert!(
        (2..12).contains(&part.scored) && !part.poses.is_empty(),
        "{}",
        part.scored
    );
}

#[test]
fn bad_rotations_are_named() {
    let pair = seated();
    let options = DockOptions::new(pair, 3);
    let run = |rotations: &[DQuat]| dock(pair, rotations, &window(), &options, None, &Silent);
    assert_eq!(run(&[]), Err(DockError::NoRotations));
    let bad = DQuat::from_xyzw(0.0, 0.0, 0.0, 1.1);
    let refused = run(&[DQuat::IDENTITY, bad]);
    assert_eq!(
        refused,
        Err(DockError::Rotation {
            index: 1,
            found: bad
        })
    );
}

/// Beside the fit every descent leads to it, out of the window: poses stay at its edge, unrefined.
#[test]
fn poses_stay_in_the_domain() {
    let pair = seated();
    let source = DirectEvaluator::new(pair, &DirectOptions::FULL).unwrap();
    let (from, to) = (DVec3::X * 2.0 * H, DVec3::X * 4.0 * H);
    let beside = TranslationWindow::new(from, to, H).unwrap();
    let options = DockOptions::new(pair, 3);
    let still = [DQuat::IDENTITY];
    let found = dock(pair, &still, &beside, &options, Some(&source), &Silent).unwrap();
    assert!(!found.poses.is_empty());
    for pose in &found.poses {
        assert!(!pose.refined, "{pose:?}");
        assert!((pair.displacement(&pose.pose) - from).length() < 1e-12);
    }
}
