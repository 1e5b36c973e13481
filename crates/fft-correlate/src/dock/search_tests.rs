use std::f64::consts::{FRAC_PI_6, PI};
use std::sync::LazyLock;
use std::sync::atomic::{AtomicU64, Ordering};

use glam::{DVec2, DVec3};
use sdf_grid::{Aabb, Silent, TriangleMesh, shapes, symmetry};

use super::*;
use crate::direct::evaluator::{DirectEvaluator, DirectOptions};
use crate::dock::error::DockingError;
use crate::dock::grid_levels::GridLevels;
use crate::dock::options::DOCKING_RATIO;
use crate::dock::search::rerank;
use crate::dock::state::BATCH;
use crate::geometry::se3::Pose;
use crate::pair::builder::PairBuilder;
use crate::pair::model::ScoreModel;
use crate::rotations::search_rotations::{search_rotations, symmetry_group};

fn rectangle(x: f64, y: f64) -> Vec<DVec2> {
    [(-x, -y), (x, -y), (x, y), (-x, y)]
        .map(|(x, y)| DVec2::new(x, y) * 0.5e-3)
        .to_vec()
}

/// A keyed rod in a plate with a hole that fits, and the rod turned and shifted by `off`.
fn parts(off: &Pose) -> [TriangleMesh; 2] {
    let plate = shapes::prism(&rectangle(28.0, 32.0), &[rectangle(8.0, 14.0)], 0.012).unwrap();
    let rod = shapes::prism(&rectangle(8.0, 14.0), &[], 0.012).unwrap();
    [plate, rod.transformed(off.rotation, off.translation)]
}

/// Width of the cells, in a search's own, where what is tested is not how close a pose is.
const WIDE: f64 = 1.5;

struct Setup {
    /// Sketch, coarse, fine.
    pairs: [Pair; 3],
    domain: SearchDomain,
    screened: bool,
}

/// The lattices of a search with cells `width` times as wide.
fn wide(moving: &TriangleMesh, width: f64) -> GridLevels {
    let own = GridLevels::new(moving);
    GridLevels {
        screening: width * own.screening,
        coarse: width * own.coarse,
        fine: width * own.fine,
        ..own
    }
}

/// Rotations `step` degrees apart, on cells `width` times as wide as a search's own.
fn setup(off: &Pose, step: f64, width: f64) -> Setup {
    let [fixed, moving] = parts(off);
    let axes = symmetry::detect(&moving, 1e-5);
    let lattices = wide(&moving, width);
    let builder = PairBuilder::default();
    let plans = lattices
        .plans(&fixed, &moving, &ScoreModel::GUIDED, &builder)
        .unwrap();
    let pairs = plans.map(|plan| plan.build(&fixed, &moving, None, &Silent).unwrap());
    let step = step.to_radians();
    Setup {
        pairs,
        domain: SearchDomain {
            rotations: search_rotations(step, &axes),
            step,
            places: lattices.places(&fixed.bounds()),
            symmetries: symmetry_group(&axes),
        },
        screened: false,
    }
}

fn run(
    setup: &Setup,
    state: Option<&Path>,
    monitor: &dyn Monitor,
) -> Result<SearchResult, DockingError> {
    let options = SearchOptions {
        top: 3,
        coarse_poses: 20,
        fine_poses: 4,
        ..SearchOptions::default()
    };
    let [screening, coarse, fine] = &setup.pairs;
    let pairs = SearchPairs {
        screening: setup.screened.then_some(screening),
        coarse,
        fine,
    };
    search(&pairs, &setup.domain, &options, state, monitor)
}

/// The rod's place is found from a frame that gives nothing away, and told with what was done.
#[test]
fn a_turned_rod_finds_its_hole() {
    let turn = DQuat::from_scaled_axis(DVec3::new(1.1, -0.7, 2.0));
    let off = Pose::new(turn, DVec3::new(0.02, 0.01, -0.03));
    let setup = setup(&off, 20.0, 1.0);
    let report = run(&setup, None, &Silent).unwrap();
    let best = &report.poses[0];
    let pivot = setup.pairs[0].pivot();
    let miss = |symmetry: &Pose| {
        let seat = off.inverse() * *symmetry;
        let away = seat.apply(pivot).distance(best.pose.apply(pivot));
        (away, seat.angle_to(&best.pose))
    };
    let (away, angle) = setup
        .domain
        .symmetries
        .iter()
        .map(miss)
        .min_by(|a, b| a.1.total_cmp(&b.1))
        .unwrap();
    // Half a cell of the fine lattice, 12 cells from the middle.
    let h = setup.pairs[2].spacing();
    assert!(
        away < 0.5 * h && angle < 0.05,
        "{away} m, {angle} rad, cells of {h} m"
    );
    assert!(best.refined, "{best:?}");
    assert!(best.half_width.is_some_and(|w| w < 0.01));
    assert!(report.poses.windows(2).all(|p| p[0].energy <= p[1].energy));
    assert_eq!(report.scored, setup.domain.rotations.len());
    let items: Vec<_> = report.stages.iter().map(|s| s.items).collect();
    // Candidates as many as the scores leave, and the fine stage gets what is still distinct.
    assert_eq!(items[0], report.rotations);
    assert!((16..=20).contains(&items[1]), "{items:?}");
    assert!((1..=4).contains(&items[2]));
    assert_eq!(report.model.lambda_interior, DOCKING_RATIO);
}

/// A pose that the fine lattice calls deeper than the fit, by less than it can know, loses to the
/// fit on half the spacing, and every energy is then of that lattice.
#[test]
fn close_poses_are_told_apart_on_a_finer_lattice() {
    let setup = setup(&Pose::IDENTITY, 30.0, WIDE);
    let mut report = run(&setup, None, &Silent).unwrap();
    let best = report.poses[0];
    let pivot = setup.pairs[0].pivot();
    let tilt = DQuat::from_rotation_x(0.15);
    report.poses.insert(
        0,
        FoundPose {
            pose: Pose::new(tilt, pivot - tilt * pivot),
            energy: 1.01 * best.energy,
            ..best
        },
    );
    let close = report.close();
    assert!(close >= 2, "{:?}", report.poses);
    let [fixed, moving] = parts(&Pose::IDENTITY);
    let lattices = wide(&moving, WIDE);
    let builder = PairBuilder::default();
    let plan = lattices
        .plan(
            0.5 * lattices.fine,
            &fixed,
            &moving,
            &ScoreModel::GUIDED,
            &builder,
        )
        .unwrap();
    let finer = plan.build(&fixed, &moving, None, &Silent).unwrap();
    rerank(
        &mut report,
        &finer,
        &setup.domain,
        &SearchOptions::default(),
        &Silent,
    )
    .unwrap();
    let stage = report.stages.last().unwrap();
    assert_eq!((stage.name, stage.items), ("decision", close));
    let first = &report.poses[0];
    let symmetries = setup.domain.symmetries.iter();
    let angle = symmetries
        .map(|s| s.angle_to(&first.pose))
        .fold(f64::INFINITY, f64::min);
    assert!(angle < 0.02, "{angle} rad");
    assert!(report.poses.windows(2).all(|p| p[0].energy <= p[1].energy));
    let weighed = with_docking_weights(&finer, DOCKING_RATIO).unwrap();
    let source = DirectEvaluator::new(&weighed, &DirectOptions::FULL).unwrap();
    for p in &report.poses {
        let energy = source.evaluate_full(&p.pose).response.energy;
        assert!((p.energy / energy - 1.0).abs() < 1e-9, "{p:?}: {energy} J");
    }
}

struct CancelAfter {
    after: u64,
    seen: AtomicU64,
}

impl Monitor for CancelAfter {
    fn advance(&self, steps: u64) {
        self.seen.fetch_add(steps, Ordering::Relaxed);
    }
    fn cancelled(&self) -> bool {
        self.seen.load(Ordering::Relaxed) >= self.after
    }
}

#[test]
fn an_interrupted_search_goes_on_to_the_same_result() {
    let setup = setup(&Pose::IDENTITY, 19.0, WIDE);
    let rotations = setup.domain.rotations.len();
    assert!(rotations > 2 * BATCH, "{rotations}");
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("state.json");
    let straight = run(&setup, None, &Silent).unwrap();
    let stop = CancelAfter {
        after: BATCH as u64 + 40,
        seen: AtomicU64::new(0),
    };
    let part = run(&setup, Some(&file), &stop).unwrap();
    assert_eq!((part.scored, part.resumed), (BATCH, 0));
    assert!(part.poses.iter().all(|p| !p.refined) && part.poses.len() == 3);
    let whole = run(&setup, Some(&file), &Silent).unwrap();
    assert_eq!((whole.scored, whole.resumed), (rotations, BATCH));
    assert_eq!(whole.poses, straight.poses);
    // Another search is refused.
    let mut other = setup;
    other.domain.rotations[0] = DQuat::from_rotation_x(0.3);
    assert!(matches!(
        run(&other, Some(&file), &Silent),
        Err(DockingError::OtherState { .. })
    ));
}

#[test]
fn unusable_searches_are_refused() {
    let mut setup = setup(&Pose::IDENTITY, 30.0, WIDE);
    let cancelled = CancelAfter {
        after: 0,
        seen: AtomicU64::new(0),
    };
    assert!(matches!(
        run(&setup, None, &cancelled),
        Err(DockingError::Cancelled)
    ));
    setup.domain.rotations[1] *= 2.0;
    assert!(matches!(
        run(&setup, None, &Silent),
        Err(DockingError::Rotation { index: 1, .. })
    ));
    setup.domain.rotations.clear();
    assert!(matches!(
        run(&setup, None, &Silent),
        Err(DockingError::NoRotations)
    ));
}

/// A screening leaves most rotations out, but not those that lead to the fit.
#[test]
fn screening_saves_rotations_and_finds_the_same_fit() {
    let turn = DQuat::from_scaled_axis(DVec3::new(-0.4, 1.7, 0.6));
    let mut setup = setup(&Pose::new(turn, DVec3::splat(0.01)), 15.0, WIDE);
    let count = setup.domain.rotations.len();
    let all = run(&setup, None, &Silent).unwrap();
    assert_eq!(
        (all.rotations, all.chosen, all.scored),
        (count, count, count)
    );
    setup.screened = true;
    let report = run(&setup, None, &Silent).unwrap();
    assert_eq!((report.rotations, report.chosen), (count, report.scored));
    assert!(report.chosen < count / 4, "{} of {count}", report.chosen);
    let names: Vec<_> = report.stages.iter().map(|s| (s.name, s.items)).collect();
    assert_eq!(names[..2], [("sketch", count), ("scoring", report.chosen)]);
    // The same start, so the same bits; and its rotation is told by its place among all.
    assert_eq!(report.poses[0], all.poses[0]);
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("state.json");
    let stop = CancelAfter {
        after: 40,
        seen: AtomicU64::new(0),
    };
    assert!(matches!(
        run(&setup, Some(&file), &stop),
        Err(DockingError::Cancelled)
    ));
    assert!(!file.exists());
    let kept = run(&setup, Some(&file), &Silent).unwrap();
    let resumed = run(&setup, Some(&file), &Silent).unwrap();
    assert_eq!((kept.resumed, resumed.resumed), (0, report.chosen));
    assert_eq!(kept.poses, report.poses);
    assert_eq!(resumed.poses, report.poses);
}

const H: f64 = 1e-3;

/// The keyed rod in its plate, modelled in place, on one lattice.
fn seated() -> &'static Pair {
    static PAIR: LazyLock<Pair> = LazyLock::new(|| {
        let [plate, rod] = parts(&Pose::IDENTITY);
        let builder = PairBuilder {
            spacing: Some(H),
            halo: Some(6e-3),
            ..PairBuilder::default()
        };
        builder
            .build(&plate, &rod, &ScoreModel::GUIDED, &Silent)
            .unwrap()
    });
    &PAIR
}

/// Twelve turns about z in a box of pivot displacements.
fn spins(min: DVec3, max: DVec3) -> SearchDomain {
    let pivot = seated().pivot();
    SearchDomain {
        rotations: (0..12)
            .map(|n| DQuat::from_rotation_z(n as f64 * FRAC_PI_6))
            .collect(),
        step: FRAC_PI_6,
        places: Aabb {
            min: pivot + min,
            max: pivot + max,
        },
        symmetries: Vec::new(),
    }
}

fn seat(domain: &SearchDomain, monitor: &dyn Monitor) -> Result<SearchResult, DockingError> {
    let pairs = SearchPairs {
        screening: None,
        coarse: seated(),
        fine: seated(),
    };
    let options = SearchOptions {
        top: 3,
        coarse_poses: 12,
        fine_poses: 6,
        ..SearchOptions::default()
    };
    search(&pairs, domain, &options, None, monitor)
}

fn around(reach: f64) -> SearchDomain {
    spins(DVec3::splat(-reach), DVec3::splat(reach))
}

/// The fit and its half turn are the two deepest, equally deep; with the symmetry they are one.
#[test]
fn the_rod_finds_its_hole_and_its_half_turn() {
    let mut domain = around(4.0 * H);
    let found = seat(&domain, &Silent).unwrap();
    let mut poses = found.poses[..2].to_vec();
    poses.sort_by(|a, b| a.pose.rotation.z.abs().total_cmp(&b.pose.rotation.z.abs()));
    for (found, turn) in poses.iter().zip([0.0, PI]) {
        let expected = Pose::new(DQuat::from_rotation_z(turn), DVec3::ZERO);
        assert!(found.pose.angle_to(&expected) < 0.02, "{found:?}");
        let displacement = seated().displacement(&found.pose).length();
        assert!(displacement < 0.3 * H && found.refined, "{found:?}");
    }
    let [a, b] = [found.poses[0].energy, found.poses[1].energy];
    assert!((a - b).abs() < 1e-2 * a.abs(), "{a} {b}");
    domain.symmetries = vec![Pose::new(DQuat::from_rotation_z(PI), DVec3::ZERO)];
    let found = seat(&domain, &Silent).unwrap();
    assert!(
        found.poses.get(1).is_none_or(|p| p.energy > 0.9 * a),
        "the half turn is the same pose: {found:?}"
    );
}

#[test]
fn the_result_does_not_depend_on_the_number_of_threads() {
    let with = |threads| {
        let pool = rayon::ThreadPoolBuilder::new()
            .num_threads(threads)
            .build()
            .unwrap();
        pool.install(|| seat(&around(4.0 * H), &Silent).unwrap().poses)
    };
    assert_eq!(with(1), with(3));
}

#[test]
fn a_cancelled_search_keeps_what_it_has() {
    let monitor = CancelAfter {
        after: 2,
        seen: AtomicU64::new(0),
    };
    let part = seat(&around(4.0 * H), &monitor).unwrap();
    assert!((2..12).contains(&part.scored), "{}", part.scored);
    assert!(!part.poses.is_empty() && part.poses.iter().all(|p| !p.refined));
}

/// Beside the fit every descent leads to it, out of the window: poses stay at its edge, unrefined.
#[test]
fn poses_stay_in_the_domain() {
    let from = DVec3::X * 2.0 * H;
    let mut domain = spins(from, DVec3::X * 4.0 * H);
    domain.rotations.truncate(1);
    let found = seat(&domain, &Silent).unwrap();
    assert!(!found.poses.is_empty());
    for pose in &found.poses {
        assert!(!pose.refined, "{pose:?}");
        let off = seated().displacement(&pose.pose) - from;
        assert!(off.length() < 1e-12, "{pose:?}");
    }
}
