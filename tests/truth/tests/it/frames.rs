//! The same numbers from parts in other frames, other cells, and differences.

use fft_correlate::{Pose, ScoreModel, Wrench};
use glam::{DQuat, DVec3};
use pegfit_truth::{Truth, TruthError, TruthOptions};
use sdf_grid::shapes::PegInHole;

use crate::common::{apart, difference, poses};

/// Both parts turned and shifted, each by its own frame: cells and fits are others.
#[test]
#[ignore = "long; run by `just truth`"]
fn frames_are_forgotten() {
    let turned = DQuat::from_scaled_axis(DVec3::new(0.4, -0.9, 0.7));
    let fixed_frame = Pose::new(turned, DVec3::new(3e-3, -1e-3, 2e-3));
    let moving_frame = Pose::new(turned.inverse(), DVec3::ZERO);
    let which = PegInHole::Rectangular;
    let (hole, peg) = which.pair(1e-4).unwrap();
    // The halo is part of the model, and its default depends on the frame.
    let options = TruthOptions {
        halo: Some(0.0155),
        ..TruthOptions::COARSE
    };
    let here = Truth::new(&hole, &peg, &ScoreModel::GUIDED, &options).unwrap();
    let hole = hole.transformed(fixed_frame.rotation, fixed_frame.translation);
    let peg = peg.transformed(moving_frame.rotation, moving_frame.translation);
    let there = Truth::new(&hole, &peg, &ScoreModel::GUIDED, &options).unwrap();
    let (mut a, mut b) = (Vec::new(), Vec::new());
    for pose in poses() {
        let first = here.at(&pose);
        let second = there.at(&(fixed_frame * pose * moving_frame.inverse()));
        let energy = first.energy / second.energy - 1.0;
        println!("{}: energy {energy:.4}", which.name());
        assert!(energy.abs() < 0.01);
        let back = fixed_frame.rotation.conjugate();
        a.push(first.wrench);
        b.push(Wrench {
            torque: back * second.wrench.torque,
            force: back * second.wrench.force,
        });
    }
    let [force, torque] = apart(&a, &b);
    println!("{}: force {force:.4}, torque {torque:.4}", which.name());
    // What coarse cells err by.
    assert!(
        force < 0.04 && torque < 0.08,
        "{} {force} {torque}",
        which.name()
    );
}

#[test]
#[ignore = "long; run by `just truth`"]
fn wrenches_are_slopes_of_energies() {
    let (hole, peg) = PegInHole::Rectangular.pair(3e-4).unwrap();
    let truth = Truth::new(&hole, &peg, &ScoreModel::GUIDED, &TruthOptions::COARSE).unwrap();
    let found: Vec<Wrench> = poses().iter().map(|p| truth.at(p).wrench).collect();
    let slopes: Vec<Wrench> = poses()
        .iter()
        .map(|p| difference(&truth, p, 5e-5))
        .collect();
    // Which cells are cut changes with the pose: energies of coarse cells are not smooth.
    let [force, torque] = apart(&found, &slopes);
    println!("force {force:.4}, torque {torque:.4}");
    assert!(force < 0.03 && torque < 0.08, "{force} {torque}");
}

#[test]
fn options_out_of_range_are_refused() {
    let (hole, peg) = PegInHole::Rectangular.pair(0.0).unwrap();
    for (name, options) in [
        (
            "tolerance",
            TruthOptions {
                tolerance: 0.0,
                ..TruthOptions::COARSE
            },
        ),
        (
            "smallest",
            TruthOptions {
                smallest: f64::NAN,
                ..TruthOptions::COARSE
            },
        ),
        (
            "largest",
            TruthOptions {
                largest: 0.01,
                ..TruthOptions::COARSE
            },
        ),
        (
            "halo",
            TruthOptions {
                halo: Some(-1.0),
                ..TruthOptions::COARSE
            },
        ),
    ] {
        let refused = Truth::new(&hole, &peg, &ScoreModel::GUIDED, &options);
        assert!(matches!(refused, Err(TruthError::Option { name: n, .. }) if n == name));
    }
}
