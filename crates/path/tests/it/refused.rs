//! What is no question, or has another answer: named.

use std::sync::Arc;

use fft_correlate::Pose;
use glam::{DQuat, DVec3};
use pegfit_path::{Outcome, PathError, PathRequest, PathSearch, Start};
use sdf_grid::{Monitor, Silent, shapes};

use crate::common::Placed;

fn dovetail() -> Placed {
    Placed::new(pegfit_fixtures::dovetail(2e-4).unwrap(), 20)
}

fn search(placed: &Placed, options: PathRequest) -> PathSearch {
    PathSearch::new(placed.fixed.clone(), placed.moving.clone(), options).unwrap()
}

/// The goal moved in the frame in which the parts were made.
fn moved(placed: &Placed, shift: DVec3) -> Pose {
    placed.place * Pose::from_translation(shift) * placed.place.inverse() * placed.goal
}

#[test]
fn goals_that_overlap_are_refused_with_the_depth_unless_that_is_allowed() {
    let placed = dovetail();
    let goal = moved(&placed, DVec3::new(0.0, -6e-4, 0.0));
    let refused = search(&placed, PathRequest::default()).find(&goal, None, &Silent);
    let Err(PathError::Overlap {
        which: "goal",
        depth,
        volume,
        ..
    }) = refused
    else {
        panic!("{refused:?}");
    };
    assert!((depth - 4e-4).abs() < 1e-8, "{depth}");
    // Its foot, 10 mm x 16 mm, and a little of its flanks.
    assert!((0.9..1.2).contains(&(volume / (160e-6 * 4e-4))), "{volume}");
    let options = PathRequest {
        allow_overlap: true,
        others: 0.0,
        ..PathRequest::default()
    };
    let answer = search(&placed, options).find(&goal, None, &Silent).unwrap();
    assert_eq!(answer.outcome, Outcome::Free);
    assert!(answer.deepest().1 > 3e-4);
}

#[test]
fn goals_beside_the_part_and_options_out_of_range_are_refused() {
    let placed = dovetail();
    let ready = search(&placed, PathRequest::default());
    let beside = moved(&placed, DVec3::new(0.0, 0.0, 0.020));
    let refused = ready.find(&beside, None, &Silent);
    assert!(matches!(refused, Err(PathError::Outside { gap }) if (gap - 0.004).abs() < 1e-9));
    let no_pose = Pose {
        rotation: DQuat::from_xyzw(0.0, 0.0, 0.0, 2.0),
        translation: DVec3::ZERO,
    };
    let refused = ready.find(&no_pose, None, &Silent);
    assert!(matches!(refused, Err(PathError::Pose { which: "goal" })));
    for options in [
        PathRequest {
            tolerance: Some(0.0),
            ..PathRequest::default()
        },
        PathRequest {
            step: Some(f64::NAN),
            ..PathRequest::default()
        },
        PathRequest {
            others: -1.0,
            ..PathRequest::default()
        },
    ] {
        let (fixed, moving) = (placed.fixed.clone(), placed.moving.clone());
        let refused = PathSearch::new(fixed, moving, options);
        assert!(matches!(refused.err(), Some(PathError::Option { .. })));
    }
}

#[test]
fn a_monitor_that_cancels_ends_the_search() {
    struct Impatient;
    impl Monitor for Impatient {
        fn cancelled(&self) -> bool {
            true
        }
    }
    let placed = dovetail();
    let found = search(&placed, PathRequest::default()).find(&placed.goal, None, &Impatient);
    assert!(matches!(found, Err(PathError::Cancelled)));
}

/// From the other side of the block, round it, and in.
#[test]
fn ways_begin_where_they_are_asked_to() {
    let placed = dovetail();
    let start = moved(&placed, DVec3::new(0.0, -0.03, 0.0));
    let options = PathRequest {
        start: Start::Pose(start),
        ..PathRequest::default()
    };
    let answer = search(&placed, options)
        .find(&placed.goal, None, &Silent)
        .unwrap();
    assert!(answer.is_free());
    assert_eq!(answer.poses[0].pose, start);
    assert!(answer.length() > 0.04);
    let inside = Arc::new(shapes::cuboid(DVec3::splat(0.004)).unwrap());
    let shell = Arc::new(pegfit_fixtures::captive_ball(2e-4, 5e-4).unwrap().0);
    let options = PathRequest {
        start: Start::Pose(Pose::from_translation(DVec3::Z * 0.02)),
        ..PathRequest::default()
    };
    let free = PathSearch::new(shell, inside, options).unwrap();
    let answer = free.find(&Pose::IDENTITY, None, &Silent).unwrap();
    assert!(answer.is_free());
}
