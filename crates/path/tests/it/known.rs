//! Straight pegs, a bayonet, a slot round a corner, a dovetail, nuts, a ball that stays.

use std::f64::consts::{FRAC_PI_2, TAU};

use glam::DVec3;
use pegfit_path::{Motion, Outcome, PathRequest};

use crate::common::Placed;

/// Of directions, radians: what the play of a short guide leaves, and some.
const ALIGNED: f64 = 0.12;

fn along(motion: &Motion, axis: DVec3) -> bool {
    DVec3::from_array(motion.axis).angle_between(axis) < ALIGNED
}

/// Rectangular, round, keyed and stepped; blind and through; from 0.02 to 0.5 mm of clearance.
#[test]
fn pegs_come_out_along_their_axis() {
    for seed in 0..4 {
        let fit = pegfit_fixtures::random_fit(seed).unwrap();
        let through = fit.slide != [0.0; 2];
        let (kind, clearance) = (fit.kind, fit.clearance);
        let placed = Placed::new((fit.fixed, fit.moving), 100 + seed);
        let answer = placed.free();
        let motions = placed.motions(&answer);
        let last = motions.last().unwrap();
        let inwards = along(last, -DVec3::Z) || (through && along(last, DVec3::Z));
        assert!(
            inwards && last.turn == 0.0,
            "{seed} {kind} {clearance}: {motions:?}"
        );
    }
}

#[test]
fn a_dovetail_goes_sideways() {
    for (seed, clearance) in [(0, 3e-5), (1, 3e-4)] {
        let placed = Placed::new(pegfit_fixtures::dovetail(clearance).unwrap(), seed);
        let motions = placed.motions(&placed.free());
        assert_eq!(motions.len(), 1, "{clearance}: {motions:?}");
        let straight = along(&motions[0], DVec3::Z) || along(&motions[0], -DVec3::Z);
        assert!(straight && motions[0].advance > 0.016, "{motions:?}");
    }
}

#[test]
fn a_spool_goes_round_the_corner_of_its_slot() {
    for (seed, clearance) in [(2, 5e-5), (3, 4e-4)] {
        let placed = Placed::new(pegfit_fixtures::spool_in_slot(clearance).unwrap(), seed);
        let motions = placed.motions(&placed.free());
        // In along +y from below, then along +x; the corner between may be cut.
        let [up, .., across] = &motions[..] else {
            panic!("{clearance}: {motions:?}");
        };
        assert!(
            along(up, DVec3::Y) && along(across, DVec3::X),
            "{motions:?}"
        );
        assert!(motions.iter().all(|m| m.turn == 0.0), "{motions:?}");
        let gone = |axis: usize| {
            motions
                .iter()
                .map(|m| m.advance * m.axis[axis])
                .sum::<f64>()
        };
        assert!(
            (gone(0) - 0.008).abs() < 2e-3 && gone(1) > 0.009,
            "{motions:?}"
        );
    }
}

#[test]
fn a_bayonet_is_pushed_turned_and_let_back() {
    for (seed, clearance) in [(4, 5e-5), (5, 2e-4)] {
        let placed = Placed::new(pegfit_fixtures::bayonet(clearance).unwrap(), seed);
        let motions = placed.motions(&placed.free());
        let turn: f64 = motions
            .iter()
            .filter(|m| m.turn > 0.2)
            .map(|m| m.turn)
            .sum();
        assert!((turn - FRAC_PI_2).abs() < 0.3, "{clearance}: {motions:?}");
        let [first, .., last] = &motions[..] else {
            panic!("{clearance}: {motions:?}");
        };
        assert!(along(first, -DVec3::Z), "{motions:?}");
        // Short, and with all the play of the lug.
        let back = last.advance * DVec3::from_array(last.axis);
        assert!(back.angle_between(DVec3::Z) < 0.3, "{motions:?}");
        assert!((back.length() - 0.002).abs() < 1.2e-3, "{motions:?}");
    }
}

#[test]
fn nuts_follow_their_thread() {
    for (seed, pitch, right_handed) in [(6, 0.002, true), (7, 0.003, false)] {
        let thread = pegfit_fixtures::Thread {
            pitch,
            radius: 0.004,
            depth: 0.4 * pitch,
            right_handed,
            segments: 32,
        };
        let bolt = thread.bolt(2.2 * pitch, [0.006, 0.002]).unwrap();
        let nut = thread
            .nut([0.2 * pitch, 1.4 * pitch], 0.013, 1.5e-4)
            .unwrap();
        let placed = Placed::new((bolt, nut), seed);
        let answer = placed.free();
        let motions = placed.motions(&answer);
        let screws = motions.iter().filter(|m| m.turn > 1.0);
        let screw = screws.max_by(|a, b| a.turn.total_cmp(&b.turn)).unwrap();
        let found = screw.pitch().unwrap();
        let expected = if right_handed { pitch } else { -pitch };
        assert!((found / expected - 1.0).abs() < 0.1, "{pitch}: {motions:?}");
        assert!(answer.turn() > TAU, "{}", answer.turn());
    }
}

/// Whatever play it has: a ball that is too large for the mouth proves it at once, and the overlap with
/// which it comes out is that of the lip, by which the mouth is narrower.
#[test]
fn a_captive_ball_does_not_come_out() {
    let cases = [(2e-5, 5e-4), (4e-5, 3e-4), (2e-4, 5e-4), (5e-4, 1e-3)];
    for (seed, (clearance, lip)) in (8..).zip(cases) {
        let placed = Placed::new(pegfit_fixtures::captive_ball(clearance, lip).unwrap(), seed);
        let answer = placed.find(PathRequest {
            others: 0.0,
            ..PathRequest::default()
        });
        let Outcome::Blocked {
            passed_at,
            stuck_at,
            exhausted,
            proven,
        } = answer.outcome
        else {
            panic!("{clearance}: free");
        };
        assert!(exhausted && proven, "{clearance}: {:?}", answer.effort);
        // Facets give path by a little.
        let passed = passed_at.unwrap();
        assert!(
            stuck_at < 1.1 * lip && passed > 0.8 * lip && passed < 2.0 * lip,
            "{clearance}: {stuck_at} {passed} {lip}"
        );
        assert!(answer.deepest().1 > 0.8 * lip);
    }
}
