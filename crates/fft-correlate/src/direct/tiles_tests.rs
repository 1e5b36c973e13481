use std::sync::atomic::AtomicBool;

use glam::DQuat;
use rand::rngs::SmallRng;
use rand::{Rng, SeedableRng};
use rayon::prelude::*;
use sdf_grid::shapes::{PegInHole, construction, cuboid, prism};
use sdf_grid::{Silent, TriangleMesh};

use super::*;

/// A plate and a rod, turned anyhow.
fn parts() -> [Arc<TriangleMesh>; 2] {
    let plate = cuboid(DVec3::new(0.16, 0.12, 0.012)).unwrap();
    let rod = prism(&construction::circle(0.004, 16), &[], 0.012).unwrap();
    let turn = DQuat::from_scaled_axis(DVec3::new(0.3, -0.8, 0.4));
    [plate, rod].map(|m| Arc::new(m.transformed(turn, DVec3::new(0.01, 0.02, -0.3))))
}

fn setup(fixed: &Arc<TriangleMesh>, moving: &Arc<TriangleMesh>) -> PairSetup {
    let mut setup = PairSetup::new(Arc::clone(fixed), Arc::clone(moving));
    setup.builder.spacing = Some(1.5e-3);
    setup.builder.halo = Some(0.006);
    setup.energy = crate::pair::setup::EnergyScale::PeakForce(3.0);
    setup
}

/// All over the plate and a little beyond, and far away.
fn poses(setup: &PairSetup, count: usize) -> Vec<Pose> {
    let mut rng = SmallRng::seed_from_u64(4);
    let [plate, middle] = [&setup.fixed, &setup.moving].map(|m| m.bounds().center());
    let mut cube = || DVec3::from_array(std::array::from_fn(|_| rng.random_range(-1.0..1.0)));
    let pose = |i: usize| {
        let turn = DQuat::from_scaled_axis(3.0 * cube());
        let spread = if i % 7 == 6 { 1.0 } else { 0.07 };
        Pose::new(turn, plate + spread * cube() - turn * middle)
    };
    (0..count).map(pose).collect()
}

fn tiles(of: &TiledEvaluator) -> &Tiles {
    match &of.content {
        Content::Tiles(tiles) => tiles,
        Content::Whole(_) => panic!("the pair is loaded whole"),
    }
}

/// Bytes at most that a tile needs while it is loaded, and the whole pair.
fn needed(of: &TiledEvaluator, poses: &[Pose]) -> [u64; 2] {
    let tiles = tiles(of);
    let each = poses.iter().filter_map(|pose| {
        let places = tiles.places(tiles.key(pose)?);
        let plan = tiles.plan.in_box(tiles.parts(), &places)?;
        Some(plan.building_bytes())
    });
    [each.max().unwrap_or(0), tiles.plan.building_bytes()]
}

/// By threads of a pool that ask in any order, in so little memory that tiles make room for others
/// while these are read; whichever part stays.
#[test]
fn answers_are_those_of_the_whole_pair_to_the_last_bit() {
    let [plate, rod] = parts();
    for parts in [[&plate, &rod], [&rod, &plate]] {
        let mut setup = setup(parts[0], parts[1]);
        let poses = poses(&setup, 60);
        let whole = DirectEvaluator::new(&setup.load(&Silent).unwrap(), &DirectOptions::FULL);
        let whole = whole.unwrap();
        let none = &mut Scratch::default();
        let expected: Vec<Response> = poses.iter().map(|p| whole.evaluate(p, none)).collect();
        assert!(expected.iter().filter(|r| r.energy != 0.0).count() > 10);

        let roomy = TiledEvaluator::new(&setup, &DirectOptions::FULL, &Silent).unwrap();
        let [tile, all] = needed(&roomy, &poses);
        assert!(3 * tile < all, "{tile} of {all} bytes");
        // An eighth of it is for contact.
        let limit = (tiles(&roomy).pieces.bytes() + 3 * tile / 2) * 8 / 7;
        setup.builder.memory_limit = Some(limit);
        let scarce = TiledEvaluator::new(&setup, &DirectOptions::FULL, &Silent).unwrap();
        for (evaluator, is_scarce) in [(roomy, false), (scarce, true)] {
            let source = evaluator.watched(&Silent);
            let pool = ThreadPoolBuilder::new().num_threads(4).build().unwrap();
            let found: Vec<Response> = pool.install(|| {
                let answer = |scratch: &mut _, pose| source.evaluate(pose, scratch);
                let each = poses.par_iter().with_max_len(1);
                each.map_init(|| source.scratch(), answer).collect()
            });
            assert_eq!(source.failure(), None);
            assert_eq!(found, expected);
            // Without a limit the whole pair is cheaper in the end.
            let tiles = tiles(&evaluator);
            assert_eq!(tiles.whole.get().is_none(), is_scarce);
            let kept = tiles.kept();
            assert!(tiles.limit.is_none_or(|limit| kept.bytes <= limit));
            let ready = kept.slots.values().map(|state| match state {
                State::Ready(tile) => tile.bytes,
                State::Loading { .. } => panic!("nothing is being loaded"),
            });
            let whole = tiles.whole.get().map_or(0, |whole| whole.bytes);
            assert_eq!(ready.sum::<u64>() + whole, kept.bytes);
            assert!(!is_scarce || kept.spent > 2 * tile, "{}", kept.spent);
        }
    }
}

/// Counts the fields that are computed; may cancel.
#[derive(Default)]
struct Watch {
    begun: AtomicU64,
    cancelled: AtomicBool,
}

impl Monitor for Watch {
    fn begin(&self, _: &str, _: u64) {
        self.begun.fetch_add(1, Ordering::Relaxed);
    }

    fn cancelled(&self) -> bool {
        self.cancelled.load(Ordering::Relaxed)
    }
}

#[test]
fn a_tile_that_several_threads_need_is_loaded_once() {
    let [plate, rod] = parts();
    let setup = setup(&plate, &rod);
    let fit = Pose::from_translation(plate.bounds().center() - rod.bounds().center());
    let one = TiledEvaluator::new(&setup, &DirectOptions::FULL, &Silent).unwrap();
    let alone = Watch::default();
    let expected = one.response(&fit, &mut one.scratch(), &alone).unwrap();
    let evaluator = TiledEvaluator::new(&setup, &DirectOptions::FULL, &Silent).unwrap();
    let together = Watch::default();
    std::thread::scope(|scope| {
        for _ in 0..6 {
            scope.spawn(|| {
                let found = evaluator.response(&fit, &mut evaluator.scratch(), &together);
                assert_eq!(found, Ok(expected));
            });
        }
    });
    let begun = [alone, together].map(|watch| watch.begun.load(Ordering::Relaxed));
    assert!(begun[0] > 0 && begun[0] == begun[1], "{begun:?}");
}

#[test]
fn who_cannot_be_answered_is_told_why_and_may_ask_again() {
    let [plate, rod] = parts();
    let mut setup = setup(&plate, &rod);
    let fit = Pose::from_translation(plate.bounds().center() - rod.bounds().center());
    let evaluator = TiledEvaluator::new(&setup, &DirectOptions::FULL, &Silent).unwrap();
    let mut scratch = evaluator.scratch();
    let watch = Watch::default();
    watch.cancelled.store(true, Ordering::Relaxed);
    let stopped = evaluator.response(&fit, &mut scratch, &watch);
    assert_eq!(stopped, Err(PairSetupError::Cancelled.into()));
    let source = evaluator.watched(&watch);
    let answer = source.evaluate(&fit, &mut scratch);
    assert!(answer.energy.is_nan() && answer.wrench.force.is_nan() && answer.coverage == 0.0);
    assert!(source.has_failed());
    assert_eq!(source.failure(), Some(&PairSetupError::Cancelled.into()));
    // Far away nothing is needed, but a source that has failed answers nothing any more.
    let far = Pose::from_translation(DVec3::splat(50.0));
    assert!(source.evaluate(&far, &mut scratch).energy.is_nan());
    assert_eq!(
        evaluator
            .response(&far, &mut scratch, &watch)
            .unwrap()
            .energy,
        0.0
    );
    watch.cancelled.store(false, Ordering::Relaxed);
    let found = evaluator.response(&fit, &mut scratch, &watch).unwrap();
    assert!(found.energy != 0.0 && evaluator.watched(&watch).failure().is_none());

    // What no pose has been asked of.
    let evaluator = TiledEvaluator::new(&setup, &DirectOptions::FULL, &Silent).unwrap();
    setup.builder.memory_limit = Some((tiles(&evaluator).pieces.bytes() + 1000) * 8 / 7);
    let evaluator = TiledEvaluator::new(&setup, &DirectOptions::FULL, &Silent).unwrap();
    let refused = evaluator.response(&fit, &mut evaluator.scratch(), &Silent);
    let too_large = |error: &TileError| {
        matches!(
            error,
            TileError::Setup(PairSetupError::Build(PairBuildError::Memory {
                limit: 990..=1010,
                ..
            }))
        )
    };
    assert!(refused.as_ref().is_err_and(too_large), "{refused:?}");
    assert!(tiles(&evaluator).kept().slots.is_empty());
}

#[test]
fn parts_of_like_size_are_loaded_whole() {
    let [hole, peg] = <[_; 2]>::from(PegInHole::Rectangular.pair(0.0).unwrap()).map(Arc::new);
    let [plate, rod] = parts();
    let of = |setup: &PairSetup, options| TiledEvaluator::is_worthwhile(setup, options).unwrap();
    assert!(!of(&setup(&hole, &peg), &DirectOptions::FULL));
    assert!(of(&setup(&plate, &rod), &DirectOptions::FULL));
    assert!(of(&setup(&plate, &rod), &DirectOptions::REAL_TIME));
    // How few points the larger part's become, only the whole one tells.
    assert!(of(&setup(&rod, &plate), &DirectOptions::FULL));
    assert!(!of(&setup(&rod, &plate), &DirectOptions::REAL_TIME));
}

#[test]
fn poses_of_a_tile_come_one_after_the_other() {
    let [plate, rod] = parts();
    let setup = setup(&plate, &rod);
    let evaluator = TiledEvaluator::new(&setup, &DirectOptions::FULL, &Silent).unwrap();
    let poses = poses(&setup, 40);
    let order = evaluator.order(&poses);
    let keys: Vec<_> = order
        .iter()
        .map(|i| tiles(&evaluator).key(&poses[*i]))
        .collect();
    let mut distinct = keys.clone();
    distinct.dedup();
    let all: std::collections::HashSet<_> = keys.iter().collect();
    assert_eq!(distinct.len(), all.len());
    let mut indices = order;
    indices.sort_unstable();
    assert!(indices.into_iter().eq(0..poses.len()));
}
